"""A progress bar in a cell of a notebook."""

from __future__ import annotations

import importlib
import io
from time import monotonic
from typing import Any

from rich.console import Console
from rich.progress import Progress, TaskID

_WIDTH = 100  # [characters]
_EVERY_S = 0.2  # minimum time between updates of the bar


class NotebookProgress(Progress):
    """Shows itself below the cell, in one output that it updates. Rich's own bar for notebooks needs ipywidgets."""

    def __init__(self, *columns: Any, **settings: Any) -> None:
        super().__init__(*columns, auto_refresh=False, **settings)
        self._handle: Any = None
        self._shown_s = 0.0

    def start(self) -> None:
        """Show the bar."""
        if not self.disable:
            display: Any = importlib.import_module("IPython.display").display  # there in every notebook
            self._handle = display(self._picture(), raw=True, display_id=True)

    def stop(self) -> None:
        """Show the final state."""
        if self._handle is not None:
            self._handle.update(self._picture(), raw=True)

    def update(self, task_id: TaskID, **fields: Any) -> None:
        """Change the task, and show it unless it was shown just now."""
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
