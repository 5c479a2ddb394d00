"""The short form of `python -m tests.torture readers`: some damaged inputs for the readers that need few imports."""

import pytest

from tests.torture import fuzz
from tests.torture.readers import READERS

INPUTS = 10  # of each reader
LIGHT = {
    "BARN worlds and paths", "pictures", "ROS maps", "shape files", "scenes", "weight files", "robots", "networks",
    "TensorFlow checkpoints", "Stable-Baselines3 archives", "recordings .bag", "recordings .db3", "recordings .mcap",
    "CARMEN logs", "append logs", "scores of trials", "Gazebo logs",
}  # fmt: skip


@pytest.mark.parametrize("mutator", fuzz.MUTATORS)
def test_damaged_inputs_are_refused_in_one_line(mutator):
    pytest.importorskip("rosbags")
    light = [reader for reader in READERS if reader.name in LIGHT]
    assert len(light) == len(LIGHT)
    found = fuzz.tried(light, INPUTS, 0, mutator)
    assert found.faults == {}
    assert found.read > 0
    assert found.read + found.refused == found.inputs == INPUTS * len(LIGHT)
