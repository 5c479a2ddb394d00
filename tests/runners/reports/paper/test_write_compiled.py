"""The document of a paper compiles, with names that LaTeX would read and letters that pdfTeX lacks."""

import re
import shutil
import subprocess

import pytest

from runners.reports.paper.write import Recorded, write_paper


@pytest.mark.slow
def test_it_compiles(runs, tmp_path):
    if not (shutil.which("pdflatex") and shutil.which("bibtex")):
        pytest.skip("needs pdflatex and bibtex: apt-get install texlive-latex-extra lmodern")
    write_paper(Recorded.read([runs]), tmp_path / "paper")
    latex = ["pdflatex", "-no-shell-escape", "-interaction=nonstopmode", "-halt-on-error", "main"]
    for command in (latex, ["bibtex", "main"], latex, latex):
        done = subprocess.run(command, cwd=tmp_path / "paper", capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout
    assert not re.findall(r"undefined|multiply|Overfull \\hbox|Missing character", done.stdout)
    assert (tmp_path / "paper" / "main.pdf").read_bytes().startswith(b"%PDF")
