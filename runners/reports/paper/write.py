"""Write the folder of a paper from recorded runs: all of it, or nothing."""

from __future__ import annotations

import os
import re
import shutil
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Self

from lme.errors import InputError
from runners.config.escaping import latex_text, visible
from runners.config.quoting import lme_command, override
from runners.config.schema import COMMANDS
from runners.records.atomic_write import write_atomically
from runners.records.launch_record import Launch, read_launch
from runners.records.records import find_runs, read_episodes
from runners.reports.analysis import compare_report, study, tables
from runners.reports.analysis.ablation import AblationStudy
from runners.reports.analysis.compare_runs import RunComparison, compare_runs
from runners.reports.analysis.curves import CurveStudy
from runners.reports.analysis.sensitivity import SensitivityStudy
from runners.reports.analysis.summary import Row, rows_of_runs
from runners.reports.analysis.text_table import Latex, render
from runners.reports.figures.style import COLUMN_IN, PAGE_IN
from runners.reports.paper import figures, methods
from runners.reports.paper.figures import PaperFigure

if TYPE_CHECKING:
    import pandas as pd

KINDS: tuple[type[study.SweepStudy], ...] = (AblationStudy, SensitivityStudy, CurveStudy)
_CITED = re.compile(rf" \[@({methods.SOFTWARE}|{methods.PAPER})\]")
REPRODUCED = Path("outputs/reproduced")  # where the runs are driven again


@dataclass(frozen=True, slots=True)
class Recorded:
    """Runs for a paper.

    paths: runs and sweeps, as they were given. run_dirs: of the runs below. frame: their records. rows: of their table.
    """

    paths: Sequence[Path]
    run_dirs: Sequence[Path]
    frame: pd.DataFrame
    rows: Sequence[Row]

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Self:
        """Read the records of these runs and sweeps. Raises InputError for a path without records."""
        run_dirs = find_runs(paths)
        frame = read_episodes(run_dirs)
        return cls(
            paths, run_dirs, frame, rows_of_runs(frame, run_dirs, is_sweep=run_dirs != list(paths)[:1])
        )


def write_paper(recorded: Recorded, folder: Path) -> list[Path]:
    """Write everything into a new `folder`, and return the files, relative to it.

    Raises InputError if the folder is in use or cannot be written, and for records that cannot be read.
    """
    with _drafted(folder) as draft:
        for name in ("tables", "figures"):
            (draft / name).mkdir()
        comparisons = _comparisons(recorded)
        # Tables in three formats; the text of each .tex is one or several floats.
        studies = [studies_of_kind for kind in KINDS if (studies_of_kind := kind.studies(recorded.frame))]
        written = _write_results(recorded, draft / "tables")
        if comparisons:
            written += compare_report.write(comparisons, (), draft / "tables")
        for studies_of_kind in studies:
            written += study.write_tables(studies_of_kind, draft / "tables")
        # Figures, methods, citation and commands; then a document that has them all.
        drawn = figures.draw(
            recorded.frame, recorded.rows, recorded.run_dirs, comparisons, studies, draft / "figures"
        )
        launches = [launch for run in recorded.run_dirs if (launch := read_launch(run)) is not None]
        paragraphs = methods.paragraphs(recorded.frame, launches, bool(comparisons))
        texts = {
            "methods.md": "\n\n".join(paragraphs) + "\n",
            "methods.tex": "\n\n".join(map(_in_latex, paragraphs)) + "\n",
            "references.bib": methods.bibtex(),
            "reproduce.sh": script(recorded.paths, recorded.run_dirs),
        }
        for name, text in texts.items():
            write_atomically(draft / name, text)
        floats = [path for path in written if path.suffix == ".tex"]
        write_atomically(draft / "main.tex", _document(recorded, draft, floats, drawn))
        return sorted(path.relative_to(draft) for path in draft.rglob("*") if path.is_file())


def _write_results(recorded: Recorded, folder: Path) -> list[Path]:
    texts = {
        "results.md": tables.to_markdown(recorded.rows),
        "results.csv": tables.to_csv(recorded.rows),
        "results.tex": tables.to_latex(recorded.frame, recorded.rows),
    }
    for name, text in texts.items():
        write_atomically(folder / name, text)
    return [folder / name for name in texts]


def _comparisons(recorded: Recorded) -> list[RunComparison]:
    """Return the comparisons of runs that share worlds; none, with a warning, of several runs that share none."""
    if recorded.frame["run_dir"].nunique() < 2:
        return []
    try:
        return compare_runs(frame for _, frame in recorded.frame.groupby("run_dir", sort=False))
    except InputError as error:
        warnings.warn(f"no comparison: {error}", stacklevel=3)
        return []


def _in_latex(paragraph: str) -> str:
    return _CITED.sub(r"~\\cite{\1}", latex_text(paragraph))


def _document(recorded: Recorded, draft: Path, floats: Sequence[Path], drawn: Sequence[PaperFigure]) -> str:
    """Return the document that has all tables and figures, and names for letters that pdfTeX does not know."""
    values = {
        "title": tables.title(recorded.frame),
        "text_in": str(PAGE_IN),
        "gap_in": f"{PAGE_IN - 2 * COLUMN_IN:.2f}",
        "tables": [path.stem for path in floats],
        "table_labels": [
            Latex(label)
            for path in floats
            for label in re.findall(r"^\\label\{(.*)\}$", path.read_text(encoding="utf-8"), re.MULTILINE)
        ],
        "figures": drawn,
    }
    template = (Path(__file__).parent / "main.tex").read_text(encoding="utf-8")
    texts = [
        path.read_text(encoding="utf-8")
        for path in (*floats, draft / "methods.tex", draft / "references.bib")
    ]
    letters = sorted({letter for text in (*texts, render(template, letters=[], **values)) for letter in text})
    unknown = [(Latex(letter), f"{ord(letter):04X}") for letter in letters if ord(letter) > 0x7F]
    return render(template, letters=unknown, **values)


def script(paths: Sequence[Path], run_dirs: Sequence[Path]) -> str:
    """Return the commands that make the runs and the paper again, from their launch records, as a shell script.

    paths: runs and sweeps, as they were given. run_dirs: the runs below them.
    """
    lines = ["#!/bin/sh", "# Drives the runs of this paper again, then makes its folder again.", "set -e"]
    made: list[Path] = []
    for path in paths:
        # A sweep is one command, unless only its runs are recorded.
        is_recorded = read_launch(path) is not None
        for directory in [path] if is_recorded else [run for run in run_dirs if path in (run, run.parent)]:
            launch = read_launch(directory)
            if launch is None or launch.command not in COMMANDS:
                lines += ["", f"# {visible(str(directory))}: how it was started is not recorded"]
                continue
            made.append(REPRODUCED / str(len(made) + 1))
            lines += ["", *_commands(launch, made[-1])]
    again = ["", lme_command("paper", *made, "--into", Path("paper_again"))] if made else []
    return "\n".join([*lines, *again]) + "\n"


def _commands(launch: Launch, into: Path) -> list[str]:
    """Return the lines for one run or sweep. Its record may come from anyone, so a comment stays one line."""
    folder = "hydra.sweep.dir" if launch.multirun else "hydra.run.dir"
    again = replace(launch, overrides=[*launch.overrides, override(folder, into)])
    needed = [
        f"# needs {visible(file.source)}, SHA-256 {visible(file.sha256)}"
        for entry in launch.inputs
        for file in entry.files.values()
    ]
    code = f"# driven by {visible(launch.code or 'a version that is not recorded')}"
    return [code, *needed, again.command_line]


@contextmanager
def _drafted(folder: Path) -> Iterator[Path]:
    """Yield a new folder beside `folder`, which gets its name when the `with` ends without an error.

    Raises InputError if `folder` exists and is not empty, or if something cannot be written.
    """
    if os.path.lexists(folder) and not (folder.is_dir() and not any(folder.iterdir())):
        raise InputError(f"{folder}: exists already: remove it, or choose another folder with --into")
    draft = folder.with_name(f".{folder.name}.{os.getpid()}.new")
    try:
        draft.mkdir(parents=True)
        yield draft
        draft.replace(folder)
    except OSError as error:
        raise InputError(f"cannot write to {folder} ({error.strerror})") from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)
