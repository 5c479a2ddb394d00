"""What the page draws and computes itself is what was recorded, and everything else is in the file."""

import copy
import math

import numpy as np
import pytest

from lme.guides.lme.criteria import SURMOUNT
from lme.perception.scan_points import obstacle_points
from lme.types import LaserScan
from runners.reports.explainer.drawn import QUANTUM
from runners.reports.explainer.encode import beams_of, encode
from runners.reports.explainer.features import QUANTUM as ROUNDED
from runners.reports.explainer.write import write_page
from runners.workers.trace import rerun
from tests.runners.reports.explainer.conftest import traced
from tests.runners.reports.explainer.test_features import PLUS
from tests.runners.reports.explainer.test_write import array, unpacked

VALUES = """() => ({
    xs: Array.from(explainer.trace.arrays["candidates.x"]),
    ys: Array.from(explainer.trace.arrays["candidates.y"]),
    features: explainer.trace.features.map((feature) => Array.from(feature)),
})"""


@pytest.mark.parametrize("distribution", ["polar", "area"])
@pytest.mark.parametrize("surmount", SURMOUNT)
def test_the_page_computes_what_was_recorded(trace, open_page, tmp_path, surmount, distribution):
    config = copy.deepcopy(trace.config)
    config.map["time_limit"] = 20.0  # until an obstacle blocks the target
    config.guide["surmount"] = surmount
    config.guide["candidates"]["distribution"] = distribution
    short = rerun(config, 1, 0)
    assert set(unpacked(encode(short, []))[0]["computed"].values()) == {"target", "turn", "shown", "b"}
    write_page(short, tmp_path / "page.html")
    values = open_page(tmp_path / "page.html").evaluate(VALUES)
    reasons = [step.explanation for step in short.steps]
    candidates = np.concatenate([reason.candidates for reason in reasons])
    np.testing.assert_allclose(
        values["features"], np.hstack([r.features for r in reasons]), rtol=0, atol=QUANTUM
    )
    np.testing.assert_allclose(
        np.transpose([values["xs"], values["ys"]]) / 1000, candidates, rtol=0, atol=0.00051
    )


@pytest.mark.parametrize("parts", [(), ("guide.parts.random=false",)])
def test_the_page_of_lme_plus_draws_its_candidates(open_page, tmp_path, parts):
    trace = traced(207, *PLUS, *parts)
    head, _ = unpacked(encode(trace, []))
    assert head["drawn"]["number"] == (1 if parts else 100)
    assert head["computed"]["a_reach"] == "way"
    write_page(trace, tmp_path / "page.html")
    values = open_page(tmp_path / "page.html").evaluate(VALUES)
    reasons = [step.explanation for step in trace.steps]
    features = np.hstack([reason.features for reason in reasons])
    np.testing.assert_allclose(values["features"], features, rtol=0, atol=0.501 * ROUNDED)
    candidates = np.concatenate([reason.candidates for reason in reasons])
    np.testing.assert_allclose(
        np.transpose([values["xs"], values["ys"]]) / 1000, candidates, rtol=0, atol=0.00051
    )


LIDARS = [
    ("robot.lidar.x=0.2", "robot.lidar.y=-0.1", "robot.lidar.yaw=0.4"),
    ("robot.lidar.fov=1.6", "robot.lidar.num_beams=91"),
]


@pytest.mark.parametrize("lidar", LIDARS)
def test_the_page_finds_the_scan_points_from_beams_and_ranges(open_page, tmp_path, lidar):
    trace = traced(207, *PLUS, *lidar)
    write_page(trace, tmp_path / "page.html")
    trace_js = "(() => ['scan.x', 'scan.y'].map((name) => Array.from(explainer.trace.arrays[name])))()"
    drawn = np.transpose(open_page(tmp_path / "page.html").evaluate(trace_js)) / 1000
    mount = trace.robot.lidar.mount
    points = np.concatenate([obstacle_points(frame.observation.scan, mount) for frame in trace.frames])
    assert len(points) > 100
    np.testing.assert_allclose(drawn, points, rtol=0, atol=0.0011)


@pytest.mark.parametrize("clockwise", [False, True])
def test_the_beams_of_points_are_those_that_hit_them(clockwise):
    ranges = np.full(12, 2.0)
    sign = -1.0 if clockwise else 1.0
    scan = LaserScan(ranges, sign * -math.pi, sign * math.tau / 12, 0.1, 10.0)
    angles = scan.angle_min + scan.angle_increment * np.arange(12)
    points = np.column_stack((2.0 * np.cos(angles), 2.0 * np.sin(angles)))
    np.testing.assert_array_equal(beams_of(points, scan) % 12, np.arange(12))


def test_other_candidates_are_in_the_file(trace):
    step = trace.steps[0]
    candidates = step.explanation.candidates + 0.001
    moved = step._replace(explanation=step.explanation._replace(candidates=candidates))
    text = encode(trace._replace(steps=(moved, *trace.steps[1:])), [])
    head, _ = unpacked(text)
    assert "drawn" not in head
    np.testing.assert_array_equal(
        array(text, "candidates.x")[: len(candidates)], np.rint(candidates[:, 0] * 1000)
    )
    assert len(array(text, "feature.a_close")) == sum(array(text, "candidates.count"))
