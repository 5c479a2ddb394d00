"""Printed output with visible control codes instead of active ones, since a run may be somebody else's."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import Any, TextIO

from runners.config.escaping import visible

_KEPT = "\n\t"


@contextlib.contextmanager
def plain_output() -> Iterator[None]:
    """Make control codes visible in what the block prints on standard output and standard error."""
    original_streams = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (_Plain(stream) if stream is not None else stream for stream in original_streams)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = original_streams


class _Plain:
    """A text stream that shows control codes.

    Rich gets clean text, colours it, and writes to the stream behind this one.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        self._stream.write(visible(text, _KEPT))
        return len(text)

    def writelines(self, lines: Any) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
