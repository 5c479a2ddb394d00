"""Writes ROS 2 messages to an MCAP file, with the package rosbags (extra `replay`)."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from lme.errors import InputError
from lme.requirements import install
from runners.workers.ros_messages import McapMessages

_ROSBAG2_VERSION: Final = 8  # 9 stores QoS profiles as text, which Humble cannot read (ros2/rosbag2#1476)


def check_installed() -> None:
    """Raise InputError unless rosbags, which writes the files, is installed."""
    try:
        import rosbags.rosbag2
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError(f"record=mcap needs the package rosbags: {install('rosbags')}") from error


class McapFile:
    """A recording while it is written; use as a context manager.

    The file gets its name, and replaces an older one, when it is complete. If an exception ends it, no file is left.
    topics: message types by name. latched: topics that late subscribers receive as well. advice: what to do if the
    file cannot be written, for the InputError that is then raised.
    """

    def __init__(self, path: Path, topics: Mapping[str, str], latched: Collection[str], advice: str) -> None:
        self._path = path
        self._partial = path.with_suffix(".partial")
        self._bag = self._partial / path.stem  # rosbags writes a folder, with a file of the same name in it
        self._topics, self._latched, self._advice = topics, latched, advice

    def __enter__(self) -> Self:
        check_installed()
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        self.messages = McapMessages()
        try:
            shutil.rmtree(self._partial, ignore_errors=True)  # a killed run may have left it
            self._writer = Writer(self._bag, version=_ROSBAG2_VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except OSError as error:
            raise self._unwritable(error) from error
        self._connections = {topic: self._connect(topic) for topic in self._topics}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._writer.__exit__(kind, error, trace)
            if kind is None:
                (self._bag / self._path.name).replace(self._path)
        except OSError as failure:
            raise self._unwritable(failure) from failure
        finally:
            shutil.rmtree(self._partial, ignore_errors=True)

    def write(self, topic: str, message: Any, now: int) -> None:
        """Add a message at the time `now` [ns]."""
        data = self.messages.store.serialize_cdr(message, self._topics[topic])
        try:
            self._writer.write(self._connections[topic], now, data)
        except OSError as error:
            raise self._unwritable(error) from error

    def _connect(self, topic: str) -> Any:
        qos = [_latched()] if topic in self._latched else []
        kind, store = self._topics[topic], self.messages.store
        return self._writer.add_connection(topic, kind, typestore=store, offered_qos_profiles=qos)

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(f"{self._path}: cannot be written ({error.strerror or error}): {self._advice}")


def _latched() -> Any:
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    unset = QosTime(0, 0)
    return Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        deadline=unset,
        lifespan=unset,
        liveliness=QosLiveliness.SYSTEM_DEFAULT,
        liveliness_lease_duration=unset,
        avoid_ros_namespace_conventions=False,
    )
