"""The short form of `python -m tests.torture observations`."""

import pytest

from tests.torture.observations import drive

DRIVES = 10


@pytest.mark.parametrize("system", ["lme", "lme_plus", "dwa", "vfh_plus", "s3_fisvfh", "eband", "kul_fm"])
def test_absurd_observations_lead_to_a_command_or_one_line(system):
    assert drive([f"system={system}"], DRIVES) == []
