"""The citation of lme and of the paper that it implements: `CITATION.cff` as BibTeX."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lme.errors import InputError
from lme.inputs.guarded_file import read_yaml
from lme.inputs.resources import citation_file
from runners.config.escaping import latex_text

SOFTWARE, PAPER = "lme-software", "lme-paper"  # what \cite calls them


def bibtex() -> str:
    """Return the entries of the software and of the paper. Raises InputError if CITATION.cff cannot be read."""
    citation = read_yaml(citation_file())
    if not isinstance(citation, dict) or not citation.get("references"):
        raise InputError(f"{citation_file()}: is damaged: lme must be installed again")
    return "\n".join([_entry(SOFTWARE, citation), _entry(PAPER, citation["references"][0])])


def _entry(key: str, work: Mapping[str, Any]) -> str:
    """Return a `@misc`, the one kind of entry that needs neither a journal nor a year."""
    released = str(work.get("date-released", ""))
    fields = {
        "author": " and ".join(map(_name, work["authors"])),
        "title": f"{{{latex_text(str(work['title']))}}}",
        "year": str(work.get("year") or released[:4]),
        "note": f"Version {work['version']}" if "version" in work else "",
        "howpublished": "Software" if work.get("type") == "software" else "",
    }
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join([f"@misc{{{key},", *lines, "}", ""])


def _name(author: Mapping[str, str]) -> str:
    """Return a person as "Family, Given", and a group in braces, which keep it whole."""
    if "family-names" in author:
        return latex_text(f"{author['family-names']}, {author['given-names']}")
    return f"{{{latex_text(author['name'])}}}"
