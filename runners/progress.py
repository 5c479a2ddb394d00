"""Progress bars that also say how it goes."""

from __future__ import annotations

from collections import Counter
from time import perf_counter
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


class EpisodeProgress:
    """Episodes done, how they ended, and the time left; on a terminal a bar, elsewhere one closing line."""

    def __init__(self, label: str, total: int) -> None:
        self._label = label
        self._total = total
        self._outcomes: Counter[str] = Counter()
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[outcomes]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )

    def __enter__(self) -> EpisodeProgress:
        self._bar.start()
        self._task = self._bar.add_task(self._label, total=self._total, outcomes="")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def skip(self, done: int) -> None:
        """Count episodes that an earlier run finished."""
        self._bar.update(self._task, completed=done)

    def add(self, outcome: str) -> None:
        """Count one more episode."""
        self._outcomes[outcome] += 1
        text = ", ".join(f"{count} {name}" for name, count in self._outcomes.most_common())
        self._bar.update(self._task, advance=1, outcomes=text)


class TrialProgress:
    """Trials done, the best reward so far, trials per second and the time left."""

    def __init__(self, label: str, total: int) -> None:
        self._label = label
        self._total = total
        self._here = 0  # trials of this process
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("best reward {task.fields[best]}"),
            TextColumn("{task.fields[rate]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )

    def __enter__(self) -> TrialProgress:
        self._bar.start()
        self._task = self._bar.add_task(self._label, total=self._total, best="–", rate="")
        self._began = perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def skip(self, done: int, best: float | None) -> None:
        """Count trials that an earlier run, or another machine, finished."""
        self._bar.update(self._task, completed=done, best=_reward_text(best))

    def add(self, best: float | None) -> None:
        """Count one more trial."""
        self._here += 1
        rate = self._here / max(perf_counter() - self._began, 1e-9)
        self._bar.update(self._task, advance=1, best=_reward_text(best), rate=f"{rate:.1f} trials/s")


def _reward_text(best: float | None) -> str:
    return "–" if best is None else f"{best:.3f}"
