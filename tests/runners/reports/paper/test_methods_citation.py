"""CITATION.cff as BibTeX."""

import re

import lme
from runners.reports.paper.methods import bibtex


def test_the_software_and_the_paper_are_cited():
    entries = bibtex()
    assert re.findall(r"^@misc\{([\w-]+),$", entries, re.MULTILINE) == ["lme-software", "lme-paper"]
    assert f"note = {{Version {lme.__version__}}}" in entries
    assert "author = {{The lme authors}}" in entries
    assert "author = {Gu, Yin and Zhang, Xinming and " in entries
    assert entries.count("{") == entries.count("}")
