"""The documentation site: `python -m sphinx -W --keep-going -c docs . build/site`.

The source folder is the checkout, so links to maps/, examples/ and benchmarks/ hold here as they do in the files.
"""

from pathlib import Path

import lme
from runners.config import reference

project = "lme"
author = "The lme authors"
project_copyright = "the lme authors, MIT licence"
version = release = lme.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc"]
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
    "maps/README.md",
]

html_theme = "furo"
html_title = f"lme {release}"
html_extra_path = ["index.html"]  # the site's root; the pages keep the paths of their files
html_copy_source = False

myst_heading_anchors = 4  # links to headings, as GitHub makes them

nb_execution_mode = "force"
nb_execution_timeout = 120
nb_execution_raise_on_error = True


def setup(app):
    """Before the pages are read: write the config reference into docs/config/, which git ignores."""
    app.connect("builder-inited", lambda app: write_config_reference(Path(app.confdir) / "config"))


def write_config_reference(folder):
    folder.mkdir(exist_ok=True)
    for name, text in reference.pages().items():
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
