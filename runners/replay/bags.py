"""Recordings of ROS 1 (`.bag`) and ROS 2 (`.db3`, `.mcap`, or their folder), read as a stream.

The library is rosbags (extra `replay`). Whatever is wrong with a file, the user reads one line about it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from lme.errors import InputError
from runners.config.extras import install

SUFFIXES = (".bag", ".db3", ".mcap")
_SECOND = 1_000_000_000
_ROS1_MAGIC, _MCAP_MAGIC, _SQLITE_MAGIC = b"#ROSBAG", b"\x89MCAP0\r\n", b"SQLite format 3\x00"
_MAGIC = {".bag": _ROS1_MAGIC, ".mcap": _MCAP_MAGIC, ".db3": _SQLITE_MAGIC}


class Topic(NamedTuple):
    """One topic of a recording. types: of its messages, most have one. number: of messages. rate: of them [Hz]."""

    name: str
    types: tuple[str, ...]
    number: int
    rate: float


class Message(NamedTuple):
    """One message. recorded: when it was written to the file [ns]. content: fields as in its definition."""

    topic: str
    type: str
    recorded: int
    content: Any


class Bag:
    """An open recording. Messages come one at a time, whatever the size of the file."""

    def __init__(self, path: Path) -> None:
        """Raises InputError for what is no recording, is cut off or holds nothing, and without rosbags."""
        self.path = path
        self._reader = _opened(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._reader.close()

    @property
    def start(self) -> int:
        """When the first message was recorded [ns]."""
        return int(self._reader.start_time)

    @property
    def end(self) -> int:
        """When the last message was recorded [ns]."""
        return int(self._reader.end_time)

    @property
    def duration_s(self) -> float:
        """From the first message to the last [s]."""
        return (self.end - self.start) / _SECOND

    def topics(self) -> list[Topic]:
        """All topics by name."""
        found: dict[str, tuple[set[str], int]] = {}
        for connection in self._reader.connections:
            types, count = found.get(connection.topic, (set(), 0))
            found[connection.topic] = types | {connection.msgtype}, count + connection.msgcount
        seconds = max(self.duration_s, 1e-9)
        return [Topic(name, tuple(sorted(t)), n, n / seconds) for name, (t, n) in sorted(found.items())]

    def messages(
        self, topics: Collection[str], start: int | None = None, stop: int | None = None
    ) -> Iterator[Message]:
        """Messages of these topics in the order of recording, from `start` to before `stop` [ns].

        Raises InputError where the file turns out to be damaged.
        """
        wanted = [c for c in self._reader.connections if c.topic in topics]
        if not wanted:
            return
        try:
            for connection, recorded, raw in self._reader.messages(wanted, start=start, stop=stop):
                content = self._reader.deserialize(raw, connection.msgtype)
                yield Message(connection.topic, connection.msgtype, recorded, content)
        except Exception as error:  # rosbags lets through whatever decoding damaged bytes raises
            raise _unreadable(self.path, error, "damaged") from error


def _opened(path: Path) -> Any:
    _check_path(path)
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(f"replay needs the package rosbags: {install('rosbags')}") from error
    try:
        # ROS 2 files of SQLite carry no message definitions before Iron.
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except Exception as error:  # rosbags raises AssertionError on some bags of 2010, struct.error on others
        raise _unreadable(path, error, "not readable as a recording") from error
    if not reader.message_count:
        with suppress(Exception):
            reader.close()
        raise InputError(f"bag {path}: holds no messages")
    return reader


def _check_path(path: Path) -> None:
    if not path.exists():
        raise InputError(f"bag {path}: no such file")
    if path.is_dir():
        if not (path / "metadata.yaml").is_file():
            raise InputError(
                f"bag {path}: a folder without metadata.yaml; give the {', '.join(SUFFIXES)} in it"
            )
        return
    if path.suffix not in SUFFIXES:
        raise InputError(f"bag {path}: must be a ROS recording, one of {', '.join(SUFFIXES)}, or its folder")
    try:
        with path.open("rb") as file:
            head = file.read(16)
    except OSError as error:
        raise InputError(f"bag {path}: cannot be opened ({error.strerror})") from error
    if not head:
        raise InputError(f"bag {path}: the file is empty")
    if not head.startswith(_MAGIC[path.suffix]):
        raise InputError(f"bag {path}: does not begin like a {path.suffix} file: not one, or damaged")


def _unreadable(path: Path, error: Exception, what: str) -> InputError:
    reason = (str(error).splitlines() or [""])[0].partition(": (")[0].rstrip(".") or type(error).__name__
    hint = ""
    if "index" in reason.lower():
        hint = ": it was cut off while recording; repair a copy with `rosbag reindex`"
    elif isinstance(error, AssertionError):
        reason = "its structure is not what the format says"
        hint = ": try `rosbag filter` or `rosbags-convert` on it"
    elif any(word in reason for word in ("magic", "footer", "malformed")):
        hint = ": it may have been cut off while recording or copying"
    return InputError(f"bag {path}: {what} ({reason}){hint}")
