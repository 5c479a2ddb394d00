"""Measures the time of `lme train`, against the paper's 1.5 hours.

    python -m benchmarks.training [--record] [--gp]

Two worker processes, with compiled code in the cache. --record also writes benchmarks/results/training.md. --gp also
measures the Gaussian process (needs the extra `gp`).
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine, timed

ENV1_ALONE = ["map=env1", "race=null", "restarts=1", "start_from_config=false", "tracking=none"]
PAPER_S = 5400.0  # "approximately 1.5 hours" on an Intel i9-13900KF with ROS Stage (paper §IV.A)


def main() -> None:
    """Print the report, and write it with --record."""
    words = parser(__doc__, "training")
    words.add_argument("--gp", action="store_true", help="also measure search=gp")
    arguments = words.parse_args()
    show(report(arguments.gp), "training", arguments.record)


def report(with_gp: bool) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Training\n"
    yield f"`python -m benchmarks.training --record`, {machine()}\n"
    yield "Two workers. The search is the time from the first trial to the last, the search's own share included. With"
    yield "`map=env1` a trial drives 4 episodes; the paper's 600 episodes took 5,400 s on an Intel i9-13900KF, in ROS"
    yield "Stage. The last row is the default: three families, the race, both weights on held-out worlds, the report.\n"
    yield "| command | whole command [s] | search [s] | the paper's 5,400 s are … times the whole |"
    yield "|---|---:|---:|---:|"
    cases = [
        [*ENV1_ALONE, "trials=75"],
        ENV1_ALONE,
        [*ENV1_ALONE, "trials=300"],
        [*ENV1_ALONE, "search=random"],
    ]
    cases += [[*ENV1_ALONE, "search=gp"]] if with_gp else []
    for words in [*cases, ["tracking=none"]]:
        total_s, search = measured(words)
        is_papers = words[0] == ENV1_ALONE[0] and not any(word.startswith("trials=") for word in words)
        share = f"{PAPER_S / total_s:,.0f}" if is_papers else ""
        yield f"| `{' '.join(['lme', 'train', *words])}` | {total_s:.1f} | {search:.1f} | {share} |"


def measured(words: list[str]) -> tuple[float, float]:
    """Wall times of a training command and of its search [s]."""
    lme = str(Path(sys.executable).parent / "lme")
    with tempfile.TemporaryDirectory() as folder:
        total_s, _ = timed([lme, "train", *words, "executor.workers=2", "hydra.run.dir=run"], folder)
        return total_s, search_time(Path(folder) / "run" / "study.journal")


def search_time(journal: Path) -> float:
    """Time from the start of the first trial to the end of the last [s]."""
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    storage = JournalStorage(JournalFileBackend(str(journal)))
    trials = storage.get_all_trials(storage.get_all_studies()[0]._study_id)
    start = min(trial.datetime_start for trial in trials if trial.datetime_start)
    end = max(trial.datetime_complete for trial in trials if trial.datetime_complete)
    return (end - start).total_seconds()


if __name__ == "__main__":
    run_main(main)
