"""Measures the time of `lme train`, against the paper's 1.5 hours.

    python -m benchmarks.training [--record] [--gp]

Two worker processes, with compiled code in the cache. --record also writes benchmarks/results/training.md. --gp also
measures the Gaussian process (needs the extra `gp`).
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.recording import parser, show
from benchmarks.speed import machine, timed

PAPER_S = 5400.0  # "approximately 1.5 hours" on an Intel i9-13900KF with ROS Stage (paper §IV.A)


def main() -> None:
    """Print the report, and write it with --record."""
    words = parser(__doc__, "training")
    words.add_argument("--gp", action="store_true", help="also measure search=gp")
    given = words.parse_args()
    show(report(given.gp), "training", given.record)


def report(with_gp: bool) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Training\n"
    yield f"`python -m benchmarks.training --record`, {machine()}\n"
    yield "Two workers. The search is the time from the first trial to the last: 4 episodes a trial, the search's own"
    yield "share included. The paper's 600 episodes took 5,400 s on an Intel i9-13900KF, in ROS Stage.\n"
    yield "| command | whole command [s] | search [s] | the paper's 5,400 s are … times the whole |"
    yield "|---|---:|---:|---:|"
    cases = [["trials=75", "tracking=none"], ["tracking=none"], ["trials=300", "tracking=none"], []]
    cases += [["search=random", "tracking=none"]] + ([["search=gp", "tracking=none"]] if with_gp else [])
    for words in cases:
        whole, search = measured(words)
        share = f"{PAPER_S / whole:,.0f}" if not words or words[0].partition("=")[0] != "trials" else ""
        yield f"| `{' '.join(['lme', 'train', *words])}` | {whole:.1f} | {search:.1f} | {share} |"


def measured(words: list[str]) -> tuple[float, float]:
    """Wall times of a training command and of its search [s]."""
    lme = str(Path(sys.executable).parent / "lme")
    with tempfile.TemporaryDirectory() as folder:
        whole, _ = timed([lme, "train", *words, "executor.workers=2", "hydra.run.dir=run"], folder)
        return whole, search_time(Path(folder) / "run" / "study.journal")


def search_time(journal: Path) -> float:
    """Time from the start of the first trial to the end of the last [s]."""
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    storage = JournalStorage(JournalFileBackend(str(journal)))
    trials = storage.get_all_trials(storage.get_all_studies()[0]._study_id)
    begin = min(trial.datetime_start for trial in trials if trial.datetime_start)
    end = max(trial.datetime_complete for trial in trials if trial.datetime_complete)
    return (end - begin).total_seconds()


if __name__ == "__main__":
    main()
