"""What LME+ remembers lies where it was seen, though nothing but the twist carries its frame."""

import math

import numpy as np
import pytest

from lme.errors import InputError
from lme.geometry.frames import to_robot
from lme.policies.lme_plus.memory import Memory, MemoryConfig
from tests.builders import escape, stage, wander
from tests.tolerances import KERNEL


@pytest.mark.parametrize("seed", range(3))
def test_the_frame_is_carried_with_the_robot(seed):
    memory = Memory(MemoryConfig(), stage())
    seen, poses = wander(seed=seed)
    for view, pose in zip(seen, poses, strict=True):
        memory.see(view)
        assert memory.pose == pytest.approx(pose, abs=0.01)  # arcs are chords here, 5 of them a second


def test_points_of_the_scan_are_known_from_the_first_look_on():
    memory = Memory(MemoryConfig(square=0.1, reach=30.0), stage())
    seen = escape(steps=5)
    for view in seen:
        memory.see(view)
        known = to_robot(memory.points, memory.pose)
        away = np.hypot(*(known[:, None] - memory.seen).transpose(2, 0, 1)).min(axis=0)
        assert away.max() <= 0.1 * math.sqrt(2.0)  # one point per square
    assert memory.seen.shape[1] == 2


def test_without_kept_the_memory_holds_the_last_scan_alone():
    memory = Memory(MemoryConfig(kept=False), stage())
    seen = escape(steps=5)
    for view in seen:
        memory.see(view)
    alone = Memory(MemoryConfig(kept=False), stage())
    alone.see(seen[-1])
    assert (
        abs(len(memory.points) - len(alone.points)) <= 0.1 * len(alone.points) + KERNEL
    )  # squares lie otherwise


@pytest.mark.parametrize("key", ["reach", "square"])
def test_mistakes_are_named(key):
    with pytest.raises(InputError, match=f"guide.memory.{key} is 0"):
        MemoryConfig(**{key: 0})
