"""Write a folder for a paper: tables, figures, methods in words, the citation and the commands of recorded runs."""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path

from runners.cli.help import add_trust, texts

EXAMPLES = (
    "lme eval -m system=lme,lme_plus,dwa_tuned hydra.sweep.dir=outputs/mine",
    "lme paper outputs/mine --into paper/lme",
    "lme paper outputs/eval/RUN1 outputs/eval/RUN2",
)


def main(argv: list[str]) -> int:
    """Write the folder and say what is in it. Raises InputError; then nothing is written."""
    from runners.records.run_directories import ROOT
    from runners.reports.paper.write import Recorded, write_paper

    arguments = _parser().parse_args(argv)
    folder = arguments.into or ROOT / "paper" / f"{datetime.now():%Y-%m-%d_%H-%M-%S}"
    files = write_paper(Recorded.read(arguments.runs), folder)
    print(f"Paper: {folder}")
    for line in _described(files):
        print(f"  {line}")
    return 0


def _parser() -> argparse.ArgumentParser:
    notes = (
        "Everything is made from records; nothing is driven. Of several runs, or a sweep, the first is the reference\n"
        "of the paired differences, as in lme compare.\n"
        "\n"
        "In your own document:\n"
        "  \\usepackage{adjustbox,booktabs,threeparttable,graphicx}\n"
        "  \\input{paper/lme/tables/results}\n"
        "  \\includegraphics[width=\\columnwidth]{paper/lme/figures/outcomes}\n"
        "\n"
        "main.tex has all of it and compiles as it is: cd paper/lme && latexmk -pdf main (or pdflatex, bibtex\n"
        "and pdflatex twice)"
    )
    parser = argparse.ArgumentParser(prog="lme paper", **texts(__doc__, EXAMPLES, notes))
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="a run's directory, or a sweep's")
    parser.add_argument(
        "--into", type=Path, metavar="DIR", help="a new folder; default: one in outputs/paper/, named by date"
    )
    add_trust(parser)
    return parser


def _described(files: list[Path]) -> list[str]:
    """Return a line for each part of the folder."""
    names = {
        folder: [path.name for path in files if str(path.parent) == folder]
        for folder in ("tables", "figures")
    }
    return [
        "main.tex        all of it in one document: latexmk -pdf main (or pdflatex, bibtex and pdflatex twice)",
        "methods.tex     what was driven, in words; methods.md: the same",
        *(
            f"{f'{folder}/':<15} {', '.join(files_of_folder)}"
            for folder, files_of_folder in names.items()
            if files_of_folder
        ),
        "references.bib  lme and its paper",
        "reproduce.sh    the commands that make it again",
    ]
