"""A live driver for each test."""

import pytest


@pytest.fixture
def rig():
    from tests.lme.live.rig import Rig  # needs rosbags

    return Rig()
