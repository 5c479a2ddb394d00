"""The documentation site: `python -m sphinx --fail-on-warning --keep-going --conf-dir docs . build/site`.

The source folder is the checkout, so links to maps/, examples/ and benchmarks/ hold here as they do in the files.
"""

import inspect
from dataclasses import is_dataclass
from pathlib import Path

import lme
from runners.config import reference

project = "lme"
author = "The lme authors"
project_copyright = "the lme authors, MIT licence"
version = release = lme.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton"]
root_doc = "docs/index"
include_patterns = [
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "benchmarks/results/*.md",
    "conf/network/*.md",
    "docs/**",
    "examples/*",
    "integrations/*/README.md",
    "integrations/*/*/README.md",
    "maps/README.md",
    "research/*.md",
]

html_theme = "furo"
html_title = f"lme {release}"
html_extra_path = ["index.html"]  # the site's root; the pages keep the paths of their files
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_search_scorer = str(Path(__file__).parent / "static" / "scorer.js")
copybutton_selector = "div.highlight:not(.highlight-text *, .cell_output *) pre"  # typed, not printed

myst_heading_anchors = 4  # links to headings, as GitHub makes them

autodoc_default_options = {"members": True, "imported-members": True}
autoclass_content = "both"  # what __init__ raises stands in its own docstring
default_role = "code"  # docstrings have Markdown's backticks

nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 600  # [s] of a cell
nb_execution_raise_on_error = True


def setup(app):
    """Write the config reference before the pages are read; leave the research record out of the search."""
    app.connect("builder-inited", lambda app: reference.write(Path(app.confdir) / "reference" / "config"))
    app.connect("doctree-read", leave_out_of_search)
    app.connect("autodoc-process-docstring", drop_of_modules)
    app.connect("autodoc-process-docstring", add_fields)
    app.connect("autodoc-skip-member", skip_told_elsewhere)


def leave_out_of_search(app, doctree):
    """The research record is read from the pages that link it."""
    if app.env.docname.startswith("research/"):
        app.env.metadata[app.env.docname]["nosearch"] = True


def drop_of_modules(app, what, name, member, options, lines):
    """The pages introduce the modules themselves."""
    if what == "module":
        lines.clear()


def add_fields(app, what, name, member, options, lines):
    """A table of the fields of a dataclass, or of the Config of a class, below the first docstring of the class."""
    schema = getattr(member, "Config", member)
    if what == "class" and is_dataclass(schema) and lines[:1] == inspect.getdoc(member).splitlines()[:1]:
        heading = f"Keys of `{name.rpartition('.')[2]}.Config`:" if schema is not member else "Fields:"
        if rows := reference.fields(schema):
            lines += ["", heading, "", *reference.as_rst(rows)]


def skip_told_elsewhere(app, what, name, member, skip, options):
    """Fields of a NamedTuple stand in its signature and docstring, keys of a Config in the table of its class."""
    return True if type(member).__name__ == "_tuplegetter" or name == "Config" else None
