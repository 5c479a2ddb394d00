"""LiCS-KI: what its network sees, its direction, its speeds, a drive, and the import of the authors' file."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.guides.lme.weight_files import find_network
from lme.inputs.onnx_graph import read_weights
from lme.navigation.episode import run_episode
from lme.planners.lics import FRONT, SHAPES, SIGNATURE, Lics, direction_along, import_state, sweep
from lme.types import Guidance, LaserScan, Outcome
from runners.config import build
from tests.builders import observation, shipped
from tests.composing import jobs_of
from tests.lme.planners.drives import plan
from tests.networks import random_lics, refused
from tests.tolerances import KERNEL
from tests.torch_archives import saved, zipped

JACKAL = shipped("jackal")
JACKAL.control_rate = 20.0
AHEAD = np.array([[0.0, 0.0], [3.0, 0.0]])
FOV = math.radians(270.0)
RANGES = np.linspace(0.3, 4.9, 720).astype(np.float32)
SCAN = LaserScan(RANGES, -FOV / 2, FOV / 719, 0.1, 30.0)
REAL = os.environ.get("LICS_STATE")
BIAS = "prediction_head.bias"


def planner(robot=JACKAL, **changes):
    made = Lics(load_settings("planner/lics", **changes), robot)
    made.reset(np.random.default_rng(0))
    return made


def test_in_the_open_it_drives_ahead_fast_and_no_faster_than_its_own_limit():
    command = plan(planner(), observation(robot=JACKAL))
    assert 0.9 <= command.v <= 1.0 + KERNEL  # 20 m/s² from rest in 50 ms
    fast = observation(robot=JACKAL)._replace(twist=command._replace(v=1.4))
    assert 1.0 < plan(planner(), fast).v <= 1.5


def test_an_obstacle_ahead_slows_it_down_in_proportion():
    ranges = np.full(720, 30.0, np.float32)
    ranges[360] = 1.0
    view = observation(robot=JACKAL, ranges=ranges)
    view = view._replace(twist=view.twist._replace(v=0.7))
    fast, slow = (plan(planner(threshold_dist=far), view).v for far in (2.5, 5.0))
    assert 0.3 < slow < 1.0
    assert fast == pytest.approx(2.0 * slow)
    ranges[360], ranges[200] = 30.0, 1.0  # 60° to the right
    assert plan(planner(), view).v > fast


def test_without_a_path_it_keeps_its_direction():
    made = planner()
    view = observation(robot=JACKAL)
    first = made.plan(view, Guidance(AHEAD[-1], AHEAD))
    lost = made.plan(view, Guidance(np.zeros(2), np.zeros((2, 2)), blocked=True))
    assert lost == first
    aside = np.array([[0.0, 0.0], [0.0, 3.0]])
    assert made.plan(view, Guidance(aside[-1], aside)).omega > first.omega + 0.2


def test_the_entry_drives_to_the_goal():
    words = ("system=lics", "sim=fast", "robot.control_rate=20", "map.subset=fresh", "map.count=1")
    with jobs_of("eval", *words) as job:
        config = job().config
        task = build.map_set(config).task(1000)
        navigator, simulator = build.navigator(config), build.simulator(config)
        episode = run_episode(task, navigator, simulator, np.random.default_rng(0))
    assert episode.outcome is Outcome.SUCCESS
    assert episode.trajectory[:, 4].max() <= 1.5 + KERNEL


def test_a_jackal_s_scan_is_the_sweep_itself_clipped():
    np.testing.assert_array_equal(sweep(SCAN, 0.0, 5.0), RANGES)
    assert sweep(SCAN, 0.0, 2.0).max() == 2.0


def test_beams_without_return_and_directions_without_beam_are_free():
    holes = RANGES.copy()
    holes[:5] = [np.nan, np.inf, 0.0, 0.05, 31.0]
    assert (sweep(SCAN._replace(ranges=holes), 0.0, 5.0)[:5] == 5.0).all()
    half = SCAN._replace(ranges=RANGES[:300].copy())
    assert (sweep(half, 0.0, 5.0)[300:] == 5.0).all()
    np.testing.assert_array_equal(sweep(half, 0.0, 5.0)[:300], RANGES[:300])
    assert (sweep(SCAN._replace(ranges=np.empty(0, np.float32)), 0.0, 5.0) == 5.0).all()


@pytest.mark.parametrize("yaw", [0.0, 1.0, math.pi])
def test_a_full_circle_is_read_by_bearing_however_the_lidar_is_turned(yaw):
    bearings = np.arange(1440) * math.tau / 1440 - math.pi
    ahead = np.where(np.abs(np.angle(np.exp(1j * (bearings + yaw)))) < math.radians(40.0), 1.0, 4.0)
    full = LaserScan(ahead.astype(np.float32), -math.pi, math.tau / 1440, 0.1, 30.0)
    seen = sweep(full, yaw, 5.0)
    assert (seen[FRONT] == 1.0).mean() > 0.98
    assert (seen[: FRONT.start - 1] == 4.0).all()
    assert (seen[FRONT.stop + 1 :] == 4.0).all()


def test_the_direction_is_that_of_the_first_point_far_enough_along():
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.9, 0.0], [2.0, 1.0], [9.0, 9.0]])
    assert direction_along(path, 2.0) == pytest.approx(np.array([2.0, 1.0]) / math.sqrt(5.0), abs=KERNEL)
    assert direction_along(path[:3], 2.0) == pytest.approx([1.0, 0.0], abs=KERNEL)
    aside = path + np.array([0.0, 1.0])  # begins a metre beside the robot: counted from there
    assert direction_along(aside, 2.0) == pytest.approx(np.array([2.0, 1.0]) / math.sqrt(5.0), abs=KERNEL)
    assert direction_along(np.zeros((2, 2)), 2.0).tolist() == [0.0, 0.0]


def written(path, weights, **damage):
    path.write_bytes(saved(weights, **damage))
    return path


def test_the_tensors_come_back_and_others_stay_behind(tmp_path):
    weights = random_lics()
    unused = {"decoder.layers.0.self_attn_layer_norm.bias": np.zeros(32, np.float32)}
    found = import_state(written(tmp_path / "a.pth", {**weights, **unused}))
    assert list(found) == list(SHAPES)
    for name, array in found.items():
        np.testing.assert_array_equal(array, weights[name])


def test_what_is_not_such_a_network_is_refused(tmp_path, says):
    weights = random_lics()
    assert "cannot be read" in refused(import_state, tmp_path / "none.pth")
    (tmp_path / "text.pth").write_text("weights")
    says(refused(import_state, tmp_path / "text.pth"))
    (tmp_path / "empty.pth").write_bytes(zipped({"data": b""}))
    assert "PyTorch 1.6 or newer" in refused(import_state, tmp_path / "empty.pth")
    missing = {name: array for name, array in weights.items() if name != BIAS}
    says(refused(import_state, written(tmp_path / "b.pth", missing)))
    other = {**weights, BIAS: np.zeros(3, np.float32)}
    says(refused(import_state, written(tmp_path / "c.pth", other)))
    broken = {**weights, BIAS: np.full(2, np.nan, np.float32)}
    assert "not finite" in refused(import_state, written(tmp_path / "d.pth", broken))


@pytest.mark.skipif(not REAL, reason="LICS_STATE names no transformer_99.pth")
def test_the_shipped_network_is_the_authors():
    shipped, theirs = read_weights(find_network("lics_ki"), SIGNATURE.what), import_state(Path(REAL))
    for name, array in theirs.items():
        np.testing.assert_array_equal(array, shipped[name])
