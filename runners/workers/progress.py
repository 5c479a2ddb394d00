"""Progress bars with intermediate results, on the terminal and in notebooks."""

from __future__ import annotations

import importlib
import io
import sys
from collections import Counter
from contextlib import AbstractContextManager, nullcontext
from time import monotonic, perf_counter
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from lme import numba_cache
from runners.config.escaping import counted

_WIDTH = 100  # [characters]
_EVERY_S = 0.2  # minimum time between updates of the bar
_LINE_EVERY_S = 60.0  # without a terminal, where a line is written instead
_STARTING = "workers start"
_COMPILING = "Compiling kernels, once after installation: this takes about half a minute."


def error_console() -> Console:
    """Return a console on standard error behind the guard of `lme`, which makes control codes visible.

    Rich itself finds the stream behind the guard only until it has replaced `sys.stderr`, which it does for a bar.
    """
    stream = sys.stderr
    while hasattr(stream, "rich_proxied_file"):
        stream = stream.rich_proxied_file
    return Console(file=stream)


class NotebookProgress(Progress):
    """Bar below a notebook's cell, in one output that is updated. Rich's own bar for notebooks needs ipywidgets."""

    def __init__(self, *columns: Any, **settings: Any) -> None:
        super().__init__(*columns, auto_refresh=False, **settings)
        self._handle: Any = None
        self._shown_s = 0.0

    def start(self) -> None:
        """Show the bar."""
        if not self.disable:
            display: Any = importlib.import_module("IPython.display").display  # installed with every notebook
            self._handle = display(self._picture(), raw=True, display_id=True)

    def stop(self) -> None:
        """Show the final state."""
        if self._handle is not None:
            self._handle.update(self._picture(), raw=True)

    def update(self, task_id: TaskID, **fields: Any) -> None:
        """Change the task, and redraw it unless it was drawn a moment ago."""
        super().update(task_id, **fields)
        if self._handle is not None and monotonic() - self._shown_s > _EVERY_S:
            self._shown_s = monotonic()
            self._handle.update(self._picture(), raw=True)

    def refresh(self) -> None:
        """Do nothing: `update` shows the changes."""

    def _picture(self) -> dict[str, str]:
        text = io.StringIO()
        Console(file=text, width=_WIDTH, color_system=None, force_jupyter=False).print(self.get_renderable())
        return {"text/plain": text.getvalue().rstrip()}


class _Bar:
    """Bar on standard error: label, progress, `columns`, time elapsed and time left.

    Without a terminal, as in a log, its line is written once a minute and at the end.
    """

    def __init__(self, label: str, total: int, *columns: str, shown: bool = True, **fields: Any) -> None:
        console = error_console()
        kind = NotebookProgress if console.is_jupyter else Progress
        self._bar = kind(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            *map(TextColumn, columns),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not shown,
        )
        self._task = self._bar.add_task(label, start=False, total=total, **fields)
        self._is_live = self._bar.disable or console.is_terminal or console.is_jupyter
        self._written_s = monotonic()

    def _update(self, **fields: Any) -> None:
        """Change the task."""
        self._bar.update(self._task, **fields)
        if not self._is_live and monotonic() - self._written_s > _LINE_EVERY_S:
            self._written_s = monotonic()
            self._bar.console.print(self._bar.get_renderable())

    def __enter__(self) -> Self:
        if not (self._bar.disable or numba_cache.compiled()):
            self._bar.console.print(_COMPILING)
        self._bar.start()
        self._bar.start_task(self._task)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()


def activity(label: str) -> AbstractContextManager[object]:
    """Show what takes seconds and cannot be counted, while the block runs; on a terminal only."""
    console = error_console()
    return nullcontext() if console.is_jupyter else console.status(label)


class EpisodeProgress(_Bar):
    """Bar of finished episodes, their outcomes and the time left."""

    def __init__(self, label: str, total: int, shown: bool = True) -> None:
        super().__init__(label, total, "{task.fields[outcomes]}", shown=shown, outcomes=_STARTING)
        self._outcomes: Counter[str] = Counter()

    def skip(self, done: int) -> None:
        """Count the episodes that an earlier run finished."""
        is_complete = done == self._bar.tasks[self._task].total
        self._update(completed=done, outcomes="" if is_complete else _STARTING)

    def add(self, outcome: str) -> None:
        """Count one more episode."""
        self._outcomes[outcome] += 1
        text = ", ".join(f"{count} {name}" for name, count in self._outcomes.most_common())
        self._update(advance=1, outcomes=text)


class TrialProgress(_Bar):
    """Bar of finished trials, the best reward so far, trials per second, episodes driven and the time left."""

    def __init__(self, label: str, total: int) -> None:
        best, rate = "best reward {task.fields[best]}", "{task.fields[rate]}"
        super().__init__(
            label, total, best, rate, "{task.fields[driven]}", best="–", rate="", driven=_STARTING
        )
        self._num_episodes = 0
        self._finished_before = 0  # trials that were finished when this process began

    def __enter__(self) -> Self:
        self._began = perf_counter()
        return super().__enter__()

    def skip(self, done: int, best: float | None) -> None:
        """Count the trials that an earlier run or another machine finished."""
        self._finished_before = done
        self._update(completed=done, best=_reward_text(best))

    def add_episode(self) -> None:
        """Count one more episode of this process: trials finish batch by batch, which takes longer."""
        self._num_episodes += 1
        self._update(driven=counted(self._num_episodes, "episode"))

    def set_done(self, done: int, best: float | None) -> None:
        """Set the number of finished trials on all machines, and the best reward."""
        rate = (done - self._finished_before) / max(perf_counter() - self._began, 1e-9)
        self._update(completed=done, best=_reward_text(best), rate=f"{rate:.1f} trials/s")


class RaceProgress(_Bar):
    """A bar for each rung below those before: its finished episodes and candidates, and the time that it took.

    Without a terminal, also a line when a rung starts.
    """

    def __init__(self) -> None:
        super().__init__("race", 0, "{task.fields[field]}", field="")
        self._has_begun = False

    def begin(self, episodes: int, candidates: int) -> None:
        """Start a rung, or the missing episodes of the search's worlds."""
        field = counted(candidates, "candidate")
        if not self._is_live:
            self._bar.console.print(f"race: {field}, {counted(episodes, 'episode')}")
        if self._has_begun:
            self._task = self._bar.add_task("race", total=episodes, field=field)
        else:
            self._bar.reset(self._task, total=episodes, field=field)
        self._has_begun = True

    def add(self) -> None:
        """Count one more episode."""
        self._update(advance=1)


class LearnProgress(_Bar):
    """Bar of a learner's finished rounds or steps, its current activity, and the best success in validation."""

    def __init__(self, label: str, total: int) -> None:
        best, doing = "best success {task.fields[best]}", "{task.fields[doing]}"
        super().__init__(label, total, best, doing, best="–", doing="")

    def set_done(self, done: int, best: float | None) -> None:
        """Set the number of finished rounds or steps, including those of an earlier run, and the best success."""
        self._update(completed=done, best=_reward_text(best), doing="")

    def describe(self, doing: str) -> None:
        """Show what the learner is doing."""
        self._update(doing=doing)


class ScanProgress(_Bar):
    """Bar of the scans of a log that have been read."""

    def __enter__(self) -> Self:
        # No note on compiling here: the few kernels of a map compile within seconds.
        self._bar.start()
        self._bar.start_task(self._task)
        return self

    def add(self) -> None:
        """Count one more scan."""
        self._update(advance=1)


def _reward_text(best: float | None) -> str:
    return "–" if best is None else f"{best:.3f}"
