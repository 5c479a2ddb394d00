"""A ROS of the tests' own, once per module and version."""

import pytest

from tests.behaviour.ros.ros import Ros, missing, python_of


@pytest.fixture(scope="module", params=[1, 2], ids=["ros1", "ros2"])
def ros(request, tmp_path_factory):
    version = request.param
    python = python_of(version)
    if python is None:
        pytest.skip(missing(version))
    with Ros(version, python, tmp_path_factory.mktemp(f"ros{version}")) as running:
        yield running
