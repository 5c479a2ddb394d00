"""Reader for recordings of ROS 1 (`.bag`) and ROS 2 (`.db3`, `.mcap`, or their folder).

Uses the package rosbags (extra `replay`). Any error in a file becomes an InputError of one line.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, Self

from lme.errors import InputError
from lme.inputs.guarded_file import YAML_BYTES, check_regular, open_bytes
from lme.live import messages
from lme.requirements import install

_STORAGE = re.compile(r"^ *storage_identifier: *['\"]?([\w]*)", re.MULTILINE)
SUFFIXES = (".bag", ".db3", ".mcap")
EPISODE, EPISODE_TYPE = "/lme", "std_msgs/msg/String"  # of recordings by lme
_SECOND = 1_000_000_000
_READ = (  # message types that a replay reads
    messages.LASER_SCAN, messages.POINT_CLOUD, messages.ODOMETRY, messages.POSE, messages.POSE_WITH_COVARIANCE,
    messages.TRANSFORM, messages.TWIST, messages.TWIST_STAMPED, messages.IMU, messages.TF[0],
)  # fmt: skip
_ROS1_MAGIC, _MCAP_MAGIC, _SQLITE_MAGIC = b"#ROSBAG", b"\x89MCAP0\r\n", b"SQLite format 3\x00"
_OLD_MAGIC = (b"#ROSRECORD", b"#ROSBAG V1")
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_COMPRESSED_MESSAGES = "its messages are compressed with zstd, as only its metadata.yaml would say"
_ENDINGS = {  # suffixes of files that are not recordings yet, with what to do about it
    ".active": "its recording was not ended: run `rosbag reindex` on it, and name it .bag",
    ".zstd": "it is compressed: give the folder with its metadata.yaml, or unpack it with `zstd -d`",
    ".zst": "it is compressed: unpack it with `zstd -d`",
    ".gz": "it is compressed: unpack it with `gunzip`",
    **{suffix.upper(): f"its ending must be in lower case: rename it to {suffix}" for suffix in SUFFIXES},
}
_OTHER_SCHEMAS = ("ros1msg", "protobuf", "jsonschema", "flatbuffer")  # that an .mcap file may have
_MAGIC = {".bag": _ROS1_MAGIC, ".mcap": _MCAP_MAGIC, ".db3": _SQLITE_MAGIC}


class Topic(NamedTuple):
    """A topic of a recording. types: message types, usually one. number: of messages. rate: of messages [Hz]."""

    name: str
    types: tuple[str, ...]
    number: int
    rate: float


class Message(NamedTuple):
    """A message. recorded: time of recording [ns]. content: object with the fields of the message type."""

    topic: str
    type: str
    recorded: int
    content: Any


class Bag:
    """An open recording. It reads one message at a time, so a file may be of any size."""

    def __init__(self, path: Path) -> None:
        """Open `path`. Raises InputError if it is not a recording, is damaged or empty, or if rosbags is missing."""
        self.path = path
        self._reader = _open(_to_open(path))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._reader.close()

    @property
    def start(self) -> int:
        """Time of recording of the first message [ns]."""
        return int(self._reader.start_time)

    @property
    def end(self) -> int:
        """Time of recording of the last message [ns]."""
        return int(self._reader.end_time)

    @property
    def duration_s(self) -> float:
        """Time from the first message to the last [s]."""
        return (self.end - self.start) / _SECOND

    @property
    def by_lme(self) -> bool:
        """Return whether lme made the recording; such a recording has a topic that names the evaluated system."""
        return any(topic.name == EPISODE and EPISODE_TYPE in topic.types for topic in self.topics())

    def topics(self) -> list[Topic]:
        """Return all topics, sorted by name."""
        contents: dict[str, tuple[set[str], int]] = {}
        # A topic may have several connections, such as one for each publisher.
        for connection in self._reader.connections:
            types, count = contents.get(connection.topic, (set(), 0))
            if connection.msgcount and not count:
                types = set()  # the types so far were announced, but had no message
            if connection.msgcount or not count:
                types = types | {connection.msgtype}
            contents[connection.topic] = types, count + connection.msgcount
        seconds = max(self.duration_s, 1e-9)
        return [Topic(name, tuple(sorted(t)), n, n / seconds) for name, (t, n) in sorted(contents.items())]

    def messages(
        self, topics: Collection[str], start: int | None = None, stop: int | None = None
    ) -> Iterator[Message]:
        """Yield the messages of these topics in the order of recording, from `start` to just before `stop` [ns].

        Raises InputError if the file is damaged, or if messages of one topic are of several types.
        """
        connections = [c for c in self._reader.connections if c.topic in topics]
        if not connections:
            return
        # A topic of several types cannot be read as one, except tf, whose two types have the same fields.
        for topic in self.topics():
            uniform = len(topic.types) == 1 or {*topic.types} <= {*messages.TF}  # which have the same fields
            if topic.name in topics and not uniform:
                raise InputError(
                    f"bag {self.path}: {topic.name} has several types: {', '.join(topic.types)}: choose another "
                    "topic, or keep one type in a copy of the recording"
                )
        try:
            for connection, recorded, raw in self._reader.messages(connections, start=start, stop=stop):
                if connection.topic not in topics:
                    raise ValueError("its index and its messages name different topics")
                if raw[:4] == _ZSTD_MAGIC:
                    raise ValueError(_COMPRESSED_MESSAGES)
                content = self._reader.deserialize(raw, connection.msgtype)
                yield Message(connection.topic, connection.msgtype, int(recorded), content)
        except Exception as error:  # decoding damaged bytes can raise anything
            raise _unreadable(self.path, error, "damaged") from error


def _open(path: Path) -> Any:
    _check_path(path)
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(f"replay needs the package rosbags: {install('rosbags')}") from error
    try:
        # Before ROS 2 Iron, .db3 files do not contain message definitions.
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except Exception as error:  # rosbags raises AssertionError on some bags of 2010, struct.error on others
        raise _unreadable(path, error, "not readable as a recording") from error
    fault = _find_fault(reader, get_typestore(Stores.ROS2_HUMBLE).fielddefs)
    if fault:
        with suppress(Exception):
            reader.close()
        raise InputError(f"bag {path}: {fault}")
    return reader


def _find_fault(reader: Any, standard: Mapping[str, Any]) -> str:
    """Return why a recording that rosbags can read is unusable; empty if it can be used."""
    if not all(isinstance(name, str) for c in reader.connections for name in (c.topic, c.msgtype)):
        return "damaged (a topic has no name or no type)"
    if not reader.message_count:
        return "has no messages"
    # Only the topics that a replay may read have to be encoded and defined as in ROS.
    connections = (c for c in reader.connections if c.msgtype in (*_READ, *messages.TF))
    encodings = {(c.topic, getattr(c.ext, "serialization_format", "cdr")) for c in connections}
    foreign = next(((topic, encoding) for topic, encoding in sorted(encodings) if encoding != "cdr"), None)
    if foreign is not None:
        return f"{foreign[0]} is encoded as {foreign[1]}: must be cdr, the encoding of ROS 2"
    odd = _find_incompatible_type(reader.typestore.fielddefs, standard)
    return f"defines {odd} differently from ROS, or is damaged" if odd else ""


def _find_incompatible_type(defined: Mapping[str, Any], standard: Mapping[str, Any]) -> str:
    """Return a type, among those read and their parts, that lacks a field of its ROS definition; empty if none does.

    Both arguments map the name of a type to (constants, fields); a field is a name and a type. ROS 1 has more fields.
    """
    remaining, visited = [*_READ], set[str]()
    # Walk from the types that are read to the types of their fields, each once.
    while remaining:
        name = remaining.pop()
        names = messages.TF if name in messages.TF else (name,)
        fields = standard[name][1]
        for kind in names:
            if kind in defined and not {*map(repr, fields)} <= {*map(repr, defined[kind][1])}:
                return kind
        visited.add(name)
        remaining += [field for field in _nested_types(fields) if field in standard and field not in visited]
    return ""


def _nested_types(fields: Any) -> Iterator[str]:
    """Yield every name in a definition; some of them are names of types."""
    for item in fields:
        if isinstance(item, str):
            yield item
        elif isinstance(item, tuple):
            yield from _nested_types(item)


def _to_open(path: Path) -> Path:
    """Return what to open: the path, or the only recording in a folder.

    A folder is opened by its file if its metadata.yaml is missing or names no storage.
    """
    try:
        is_folder = path.is_dir()
    except OSError as error:  # such as a name that is too long
        raise InputError(f"bag {path}: cannot be read ({error.strerror})") from None
    if not is_folder:
        return path
    # rosbags opens a folder by its metadata.yaml, so that has to name the storage.
    metadata, problem = path / "metadata.yaml", "the folder has no metadata.yaml"
    if metadata.is_file():
        storage = _STORAGE.search(metadata.read_text(encoding="utf-8", errors="replace"))
        if storage and storage[1] in ("mcap", "sqlite3"):
            return path
        problem = "its metadata.yaml names no storage that can be read (storage_identifier: mcap or sqlite3)"
    # Without it, a single recording in the folder leaves no doubt.
    files = [file for file in path.iterdir() if file.suffix in (".db3", ".mcap")]
    ros1 = sorted(file.name for file in path.iterdir() if file.suffix == ".bag")
    if ros1 and not files:
        raise InputError(
            f"bag {path}: is a folder of ROS 1 recordings: give one of them, such as {path / ros1[0]}"
        )
    if len(files) != 1:
        raise InputError(
            f"bag {path}: {problem}: make it with `ros2 bag reindex {path}`, or give a file in it, one of "
            f"{', '.join(SUFFIXES)}"
        )
    return files[0]


def _check_path(path: Path) -> None:
    if not path.exists():
        raise InputError(f"bag {path}: no such file")
    if path.is_dir():
        if (path / "metadata.yaml").exists():
            check_regular(path / "metadata.yaml", YAML_BYTES)
        for part in path.iterdir():
            if part.suffix in SUFFIXES:
                check_regular(part)
        return
    # A single file: check its name, then its first bytes.
    if path.suffix in _ENDINGS:
        raise InputError(f"bag {path}: {_ENDINGS[path.suffix]}")
    if path.suffix not in SUFFIXES:
        raise InputError(
            f"bag {path}: must be a ROS recording, one of {', '.join(SUFFIXES)}, or its folder, "
            "or a CARMEN log (.log, .clf, .log.gz, .clf.gz)"
        )
    try:
        with open_bytes(path) as file:
            head = file.read(16)
    except OSError as error:
        raise InputError(f"bag {path}: cannot be opened ({error.strerror})") from error
    if not head:
        raise InputError(f"bag {path}: the file is empty")
    if head.startswith(_OLD_MAGIC):
        raise InputError(
            f"bag {path}: is of a format before 2.0: convert it with `rosbag filter {path.name} NEW.bag True`"
        )
    if not head.startswith(_MAGIC[path.suffix]):
        raise InputError(f"bag {path}: is not a {path.suffix} file, or is damaged")


def _unreadable(path: Path, error: Exception, fault: str) -> InputError:
    reason = (str(error).splitlines() or [""])[0].partition(": (")[0].rstrip(".") or type(error).__name__
    # Say what to do about it, as far as rosbags' message tells the cause.
    hint, lower = "", reason.lower()
    if reason.strip("'") in _OTHER_SCHEMAS:
        reason = f"its messages are defined in {reason}, not in ros2msg or ros2idl"
        fault, hint = "cannot be read", ": convert it to a recording of ROS 2"
    elif any(word in lower for word in ("compress", "encrypt", "serializ")):
        fault = "cannot be read"
        if path.suffix == ".bag":
            hint = f": convert it with `rosbag {'decrypt' if 'encrypt' in lower else 'decompress'}`"
        else:
            hint = ": give the folder with its metadata.yaml, or convert it with `ros2 bag convert`"
    elif "files are missing" in lower:
        hint = ": make its metadata.yaml anew with `ros2 bag reindex`, or give one of its files"
    elif "index" in lower:
        hint = ": the recording was cut off; repair a copy with `rosbag reindex`"
    elif isinstance(error, AssertionError):
        reason = "its structure does not follow the format"
        hint = ": try `rosbag filter` or `rosbags-convert` on it"
    elif any(word in reason for word in ("magic", "footer", "malformed")):
        hint = ": the recording or a copy of it may have been cut off"
        if path.suffix == ".mcap":
            hint += "; repair a copy with `mcap recover`"
    return InputError(f"bag {path}: {fault} ({reason}){hint}")
