"""The map of a place where a real robot drove, built from the log of its drive."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lme.types import Floats
from runners.play.saving import FOLDER
from runners.records.launch_record import LAUNCH

_RECORDINGS = (".bag", ".db3")


def is_log(path: Path) -> bool:
    """Return whether a path is the log of a drive, not a run or an episode of `lme eval`. Raises InputError."""
    from runners.recordings.bags import Bag
    from runners.recordings.carmen import is_carmen
    from runners.recordings.recorded import episode_of

    if path.suffix == ".mcap":
        with Bag(path) as bag:
            episode = episode_of(bag)
        return episode is None or episode.live
    if path.is_dir():
        return not (path / LAUNCH).exists() and any(path.glob("*.db3"))
    return path.suffix in _RECORDINGS or is_carmen(path)


def words_of_log(log: Path, root: Path = Path()) -> tuple[str, ...]:
    """Return words that open the map of a log, from where the robot started to the farthest place on its way.

    The map is written below `root`, as by `lme maps build`. Raises InputError.
    """
    from runners.recordings.map_build import BuildConfig, build_map, write_map

    built = build_map([log], BuildConfig())
    target = root / FOLDER / f"{log.resolve().name.partition('.')[0]}_map.yaml"
    write_map(built, target)
    print(f"map: {target}", flush=True)
    start = built.way[0]
    goal = built.way[np.argmax(np.hypot(*(built.way - start).T))]
    return (
        "map=file",
        f"map.path={target}",
        f"map.start={_point_text(start)}",
        f"map.goal={_point_text(goal)}",
    )


def _point_text(point: Floats) -> str:
    return f"[{point[0]:.3f},{point[1]:.3f}]"
