"""Reader for logs of CARMEN (http://carmen.sourceforge.net/logger_playback.html) as recordings.

A line FLASER or ROBOTLASER1 holds a scan and the pose of the laser. It becomes two messages, a pose and a scan, as if
ROS had recorded them. Lines ODOM are ignored: in a corrected log, their poses are not the corrected ones.
"""

from __future__ import annotations

import gzip
import math
import warnings
import zlib
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.geometry.frames import compose, relative
from lme.inputs.guarded_file import LOG_BYTES, open_bytes
from lme.live.messages import LASER_SCAN, POSE, SECOND, TF
from lme.types import Pose
from runners.recordings.bags import Bag, Message, Topic

ENDINGS = (".log", ".clf", ".log.gz", ".clf.gz")
SCAN, POSES, MOUNT = "/scan", "/pose", "/tf_static"
FLASER, ROBOTLASER = "FLASER", "ROBOTLASER1"
RANGE_MAX = 80.0  # [m] for FLASER, which has none: a SICK LMS reports errors as 81 m and more

_TYPES = {MOUNT: TF[0], POSES: POSE, SCAN: LASER_SCAN}  # in the order in which they are read
_ODOM, _BASE, _LASER = "odom", "base_link", "laser"
_LINE_BYTES = 2**20  # of a scan; one of 1,081 beams has about 10 kB
_FARTHEST_MOUNT = 2.0  # [m] from the middle of the robot to its laser
_FLASER_FOV = {  # [deg] by the number of beams, where it is not half a turn; the middle points ahead
    **dict.fromkeys((101, 201, 401), 100.0),  # SICK LMS2xx in its mode of 100°, as in CARMEN's own table
    **dict.fromkeys((270, 271, 540, 541, 1080, 1081), 270.0),  # SICK LMS1xx, Hokuyo UTM-30LX
}
_URG_BEAMS = (681, 682, 683, 769)  # of a Hokuyo URG-04LX, over 240° or its whole 270°
_URG_INCREMENT = 360.0 / 1024.0  # [deg]
_FINEST = 0.25  # [deg] increments over half a turn are multiples of this
_RESOLUTION = "laser_front_laser_resolution"  # the parameter of CARMEN with the increment [deg]
_JITTER = SECOND // 10  # [ns] by which a time may lie before that of the line above
_SAME_M, _SAME_RAD = 0.02, 0.02  # tolerance for the laser's pose on the robot
_STEP_M = 0.05  # between two scans, in which a robot drives
_FEWEST_STEPS = 10  # that tell whether it drives where it points


class _Scan(NamedTuple):
    """A line with a scan. stamp [ns]. geometry: angle_min, angle_increment [rad], range_max [m]. ranges [m]."""

    stamp: int
    geometry: tuple[float, float, float]
    ranges: NDArray[np.float32]
    laser: Pose
    robot: Pose


class CarmenLog(Bag):
    """An open CARMEN log, plain or compressed by gzip. The whole log is read at once."""

    def __init__(self, path: Path) -> None:
        """Read `path`. Raises InputError if it cannot be read, is damaged, holds no scans, or has yaw in degrees."""
        self.path = path
        scans = _scans(path)
        if _turns_in_degrees(scans):
            raise InputError(
                f"log {path}: the yaw of the poses is in degrees, because only then does the robot drive where it "
                "points; must be in radians"
            )
        self._scans = _stamped(scans)
        late = sum(
            stamped.stamp - scan.stamp > _JITTER for stamped, scan in zip(self._scans, scans, strict=True)
        )
        if late:
            warnings.warn(
                f"log {path}: the time goes backwards: {late} of its {len(scans)} scans count as taken with the one "
                "before; the times must rise",
                stacklevel=2,
            )
        self._mount = _mount(self._scans)

    def __exit__(self, *error: object) -> None:
        pass

    @property
    def start(self) -> int:
        """Time of the first scan [ns]."""
        return self._scans[0].stamp

    @property
    def end(self) -> int:
        """Time of the last scan [ns]."""
        return self._scans[-1].stamp

    def topics(self) -> list[Topic]:
        """Return the topics that the log corresponds to, sorted by name."""
        number, seconds = len(self._scans), max(self.duration_s, 1e-9)
        counts = {name: 1 if name == MOUNT else number for name in _TYPES}
        return [Topic(name, (_TYPES[name],), counts[name], counts[name] / seconds) for name in sorted(counts)]

    def messages(
        self, topics: Collection[str], start: int | None = None, stop: int | None = None
    ) -> Iterator[Message]:
        """Yield the messages of these topics in order of time, from `start` to just before `stop` [ns]."""
        for index, scan in enumerate(self._scans):
            if (start is not None and scan.stamp < start) or (stop is not None and scan.stamp >= stop):
                continue
            for name in _TYPES:
                if name in topics and (name != MOUNT or index == 0):
                    yield Message(name, _TYPES[name], scan.stamp, self._content(name, scan))

    def _content(self, name: str, scan: _Scan) -> SimpleNamespace:
        if name == MOUNT:
            return SimpleNamespace(transforms=[_transform(scan.stamp, self._mount)])
        if name == SCAN:
            start_angle, increment, farthest = scan.geometry
            return SimpleNamespace(
                header=_header(scan.stamp, _LASER),
                ranges=scan.ranges,
                angle_min=start_angle,
                angle_increment=increment,
                range_min=0.0,
                range_max=farthest,
            )
        # The pose of the laser is the one that programs correct, so the robot is where its laser says.
        pose = compose(scan.laser, relative(Pose(0.0, 0.0, 0.0), self._mount))
        position, orientation = _position_and_orientation(pose)
        return SimpleNamespace(
            header=_header(scan.stamp, _ODOM),
            pose=SimpleNamespace(position=position, orientation=orientation),
        )


def is_carmen(path: Path) -> bool:
    """Return whether a file has the name of a CARMEN log."""
    return path.name.lower().endswith(ENDINGS)


def _scans(path: Path) -> list[_Scan]:
    """Return all scans of the kind of line that is most frequent in the log."""
    scans_by_kind: dict[str, list[_Scan]] = {ROBOTLASER: [], FLASER: []}
    resolution: float | None = None  # [deg] by the parameters of the log
    readers: dict[str, Callable[[Sequence[str]], _Scan]] = {
        ROBOTLASER: _robotlaser,
        FLASER: lambda fields: _flaser(fields, resolution),
    }
    mistake: InputError | None = None
    # Read the scans of both kinds, since a log may hold both.
    for number, line in enumerate(_lines(path), start=1):
        if mistake is not None:  # only the last line may be incomplete: the log was cut off
            raise mistake
        kind, *fields = line.split()
        if kind == "PARAM" and fields[:1] == [_RESOLUTION]:
            with suppress(ValueError, IndexError):
                resolution = float(fields[1])
        if kind in readers:
            try:
                scans_by_kind[kind].append(readers[kind](fields))
            except InputError as error:
                raise InputError(f"log {path}, line {number}: {error}") from error
            except (ValueError, IndexError, OverflowError):
                mistake = InputError(
                    f"log {path}, line {number}: {kind}: must hold a scan, a pose and a time, all of them numbers"
                )
    # Keep the kind that occurs most.
    largest = max(scans_by_kind.values(), key=len)
    if not largest:
        raise mistake or InputError(
            f"log {path}: no scans: a CARMEN log has lines {FLASER} or {ROBOTLASER} with scans and poses"
        )
    return largest


def _lines(path: Path) -> Iterator[str]:
    """Yield the non-empty lines of a log. Raises InputError if it cannot be read or is empty."""
    if not path.exists():
        raise InputError(f"log {path}: no such file")
    if path.is_dir():
        raise InputError(f"log {path}: is a directory; must be a CARMEN log ({', '.join(ENDINGS)})")
    is_empty, packed = True, path.suffix.lower() == ".gz"
    try:
        # What is packed ends with any number of zeros, which gzip would all read.
        with (
            open_bytes(path, LOG_BYTES if packed else None) as raw,
            gzip.open(raw) if packed else raw as file,
        ):
            for line in iter(partial(file.readline, _LINE_BYTES), b""):
                if len(line) == _LINE_BYTES:
                    raise InputError(
                        f"log {path}: is not a CARMEN log: a line has {_LINE_BYTES} bytes or more"
                    )
                text = line.decode("ascii", errors="replace").strip()
                if text:
                    is_empty = False
                    yield text
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(f"log {path}: not a complete gzip file ({error})") from error
    except OSError as error:
        raise InputError(f"log {path}: cannot be read ({error.strerror})") from error
    if is_empty:
        raise InputError(f"log {path}: the file is empty")


def _flaser(fields: Sequence[str], resolution: float | None) -> _Scan:
    """Parse FLASER n ranges, pose of the laser, pose of the robot, time. The first beam is the rightmost.

    resolution [deg]: from the log's parameters, if it has one. Raises InputError if the field of view is unknown.
    """
    count = _count(fields[0])
    geometry = (*_flaser_angles(count, resolution), RANGE_MAX)
    return _scan(geometry, fields[1 : 1 + count], fields[1 + count :], time_at=6)


def _flaser_angles(count: int, resolution: float | None) -> tuple[float, float]:
    """Return the first beam's bearing and the increment [rad] of a FLASER line.

    The line contains only the number of beams.
    """
    steps = count if count % 2 == 0 else count - 1  # 180 beams are the first of 181 over half a turn
    # Known lidars first; then half a turn, if its increment is usual; then what the log itself says.
    if count in _FLASER_FOV:
        fov = _FLASER_FOV[count]
        increment = fov / steps
    elif count in _URG_BEAMS:
        increment, fov = _URG_INCREMENT, (count - 1) * _URG_INCREMENT
    elif (180.0 / steps / _FINEST).is_integer():
        return -math.pi / 2.0, math.pi / steps
    elif resolution is not None and 0.0 < resolution * count <= 360.0:
        increment, fov = resolution, (count - 1) * resolution
    else:
        raise InputError(
            f"{FLASER} has {count} beams, and its field of view is not known: must be a usual number (181 or 361 over "
            f"180°, 401 over 100°, 541 or 1081 over 270°, 682 over 240°), or be preceded by a line such as "
            f"'PARAM {_RESOLUTION} 0.5' with the degrees between its beams; lines {ROBOTLASER} say their own"
        )
    return -math.radians(fov) / 2.0, math.radians(increment)


def _robotlaser(fields: Sequence[str]) -> _Scan:
    """Parse ROBOTLASER1 type, start, field of view, increment, farthest, accuracy, mode, n ranges, m remissions, …

    The poses of laser and robot, speed and safety, and the time follow the remissions.
    """
    start_angle, increment, farthest = float(fields[1]), float(fields[3]), float(fields[4])
    count = _count(fields[7])
    remissions = int(fields[8 + count])
    if remissions < 0 or not (math.isfinite(start_angle) and increment > 0.0):
        raise ValueError(fields[:8])
    farthest = farthest if 0.0 < farthest < math.inf else RANGE_MAX
    # Five numbers on speed and safety follow the two poses.
    tail = fields[9 + count + remissions :]
    return _scan((start_angle, increment, farthest), fields[8 : 8 + count], tail, time_at=11)


def _count(field: str) -> int:
    count = int(field)
    if count < 2:
        raise ValueError(field)
    return count


def _scan(
    geometry: tuple[float, float, float], ranges: Sequence[str], tail: Sequence[str], time_at: int
) -> _Scan:
    """Return a scan. tail: the poses of laser and robot, then other fields, with the time at index `time_at`."""
    poses = np.array(tail[:6], dtype=np.float64)
    if len(poses) < 6 or not np.isfinite(poses).all():
        raise ValueError(tail[:6])
    laser, robot = Pose(*poses[:3].tolist()), Pose(*poses[3:].tolist())
    return _Scan(round(float(tail[time_at]) * SECOND), geometry, np.array(ranges, np.float32), laser, robot)


def _stamped(scans: list[_Scan]) -> list[_Scan]:
    """Return the scans in the log's order, each later than the previous one: some logs give one time to all scans."""
    stamped = scans[:1]
    for scan in scans[1:]:
        stamped.append(scan._replace(stamp=max(scan.stamp, stamped[-1].stamp + 1)))
    return stamped


def _turns_in_degrees(scans: Sequence[_Scan]) -> bool:
    """Return whether the robot drives along its yaw, forwards or backwards, only if that is read as degrees."""
    x, y, yaw = np.array([scan.robot for scan in scans]).T
    steps = np.diff(x) + 1j * np.diff(y)
    drives = np.abs(steps) > _STEP_M
    if np.count_nonzero(drives) < _FEWEST_STEPS:
        return False
    directions, yaw = np.angle(steps[drives]), yaw[:-1][drives]
    in_radians, in_degrees = (np.abs(np.cos(directions - angle)).mean() for angle in (yaw, np.radians(yaw)))
    return bool(in_degrees > 0.95 and in_radians < 0.85)  # 0.64 on average for any direction


def _mount(scans: Sequence[_Scan]) -> Pose:
    """Return the laser's pose on the robot; its middle if the two poses of a line do not belong together."""
    start_mount, end_mount = (relative(scan.laser, scan.robot) for scan in (scans[0], scans[-1]))
    # The mount of a rigid laser is the same in the first and in the last scan.
    steady = math.dist(start_mount[:2], end_mount[:2]) < _SAME_M
    steady = steady and abs(math.remainder(start_mount.yaw - end_mount.yaw, math.tau)) < _SAME_RAD
    is_near = math.hypot(*start_mount[:2]) < _FARTHEST_MOUNT
    return start_mount if is_near and steady else Pose(0.0, 0.0, 0.0)


def _header(stamp: int, frame: str) -> SimpleNamespace:
    sec, nanosec = divmod(stamp, SECOND)
    return SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec), frame_id=frame)


def _transform(stamp: int, mount: Pose) -> SimpleNamespace:
    position, orientation = _position_and_orientation(mount)
    motion = SimpleNamespace(translation=position, rotation=orientation)
    return SimpleNamespace(header=_header(stamp, _BASE), child_frame_id=_LASER, transform=motion)


def _position_and_orientation(pose: Pose) -> tuple[SimpleNamespace, SimpleNamespace]:
    """Return position and orientation of a pose."""
    half = pose.yaw / 2.0
    return (
        SimpleNamespace(x=pose.x, y=pose.y, z=0.0),
        SimpleNamespace(x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)),
    )
