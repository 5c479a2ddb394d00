"""Shape files: what they draw, and what is said of those that are wrong."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from lme.errors import InputError
from lme.inputs.resources import resource_dir
from lme.worlds.room import read_floor_plan
from lme.worlds.sampling import FreeSpace
from lme.worlds.shapes import _crosses_itself, _side, floor_plan
from tests.tolerances import KERNEL

BOUNDS = "bounds: [0, 0, 10, 10]\n"


def area(polygon):
    (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    return float((x0 * y1 - x1 * y0).sum() / 2)


def written(tmp_path, text):
    path = tmp_path / "place.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_kind_of_shape_is_drawn_where_it_says(tmp_path):
    text = """
bounds: [-1, -2, 9, 8]
boxes:
  - {centre: [2, 3], size: [0.4, 0.2], yaw_deg: 90}
polygons:
  - {points: [[5, 5], [5.5, 5], [5.2, 5.6]]}
ellipses:
  - {centre: [7, 4], size: [0.4, 0.8]}
circles:
  - {centre: [7, 2], radius: 0.1}
walls:
  - {points: [[0, 7], [3, 7], [3, 8]]}
  - {points: [[6, 0], [6, 1]], thickness: 0.1}
"""
    plan = read_floor_plan(written(tmp_path, text))
    box, triangle, ellipse, bar = plan.world.polygons
    assert {tuple(corner) for corner in box.round(9)} == {(1.9, 2.8), (2.1, 2.8), (2.1, 3.2), (1.9, 3.2)}
    assert triangle.tolist() == [[5, 5], [5.5, 5], [5.2, 5.6]]
    assert np.ptp(ellipse, axis=0) == pytest.approx([0.4, 0.8], abs=KERNEL)
    assert {tuple(corner) for corner in bar.round(9)} == {
        (5.95, -0.05),
        (6.05, -0.05),
        (6.05, 1.05),
        (5.95, 1.05),
    }
    assert plan.world.circles.tolist() == [[7, 2, 0.1]]
    assert plan.world.segments[4:].tolist() == [[0, 7, 3, 7], [3, 7, 3, 8]]


def test_the_bounds_are_a_closed_outer_wall():
    plan = floor_plan("place", {"bounds": [-1, -2, 9, 8]})
    assert plan.outline.tolist() == [[-1, -2], [9, -2], [9, 8], [-1, 8]]
    starts, ends = plan.world.segments[:, :2], plan.world.segments[:, 2:]
    assert starts.tolist() == plan.outline.tolist()
    assert ends.tolist() == np.roll(starts, -1, axis=0).tolist()


@given(
    st.sampled_from(["boxes", "ellipses"]),
    st.tuples(st.floats(0.01, 2), st.floats(0.01, 2)),
    st.floats(-720, 720),
)
def test_turning_keeps_area_and_centre(kind, size, yaw_deg):
    item = {"centre": [5.0, 4.0], "size": list(size)}
    turned = floor_plan("p", {"bounds": [0, 0, 10, 10], kind: [{**item, "yaw_deg": yaw_deg}]}).world.polygons[
        0
    ]
    upright = floor_plan("p", {"bounds": [0, 0, 10, 10], kind: [item]}).world.polygons[0]
    assert area(turned) == pytest.approx(area(upright), rel=KERNEL)
    assert turned.mean(axis=0) == pytest.approx([5.0, 4.0], abs=KERNEL)
    full = size[0] * size[1] * (1 if kind == "boxes" else math.pi / 4)
    assert area(upright) == pytest.approx(full, rel=0.01)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[1, 2]",
        "boxes: []",
        "bounds: [0, 0, 10]",
        "bounds: [0, 0, 1e9, 1e9]",
        "bounds: [-1.5E3, 0, 1, 1]",
        "bounds: [0, 0, 1.e2, 1]",
        BOUNDS + "walls: [{points: [[1, 1], [2, 1e-1]]}]",
        BOUNDS + "circles: [{centre: [1, 2], radius: 2e0}]",
        "bounds: [10, 0, 0, 10]",
        "bounds: [0, 0, .inf, 10]",
        BOUNDS + "boxs: []",
        BOUNDS + "boxes: 3",
        BOUNDS + "boxes: [5]",
        BOUNDS + "boxes: [{centre: [1, 2], sise: [1, 1]}]",
        BOUNDS + "boxes: [{centre: [1, 2]}]",
        BOUNDS + "boxes: [{centre: [1, 2, 3], size: [1, 1]}]",
        BOUNDS + "boxes: [{centre: [1, 2], size: [1, 0]}]",
        BOUNDS + "boxes: [{centre: [1, 2], size: [1, -1]}]",
        BOUNDS + "boxes: [{centre: [1, two], size: [1, 1]}]",
        BOUNDS + "boxes: [{centre: [1, true], size: [1, 1]}]",
        BOUNDS + "boxes: [{centre: [1, .nan], size: [1, 1]}]",
        BOUNDS + f"boxes: [{{centre: [1, {10**400}], size: [1, 1]}}]",
        BOUNDS + "boxes: [{centre: [1, 2], size: [1, 1], yaw_deg: left}]",
        BOUNDS + "boxes: [{centre: [9.9, 2], size: [1, 1]}]",
        BOUNDS + "circles: [{centre: [1, 2], radius: 0}]",
        BOUNDS + "circles: [{centre: [1, 2], radius: 1.5}]",
        BOUNDS + "polygons: [{points: [[1, 1], [2, 2]]}]",
        BOUNDS + "polygons: [{points: [[1, 1], [2, 2], [3]]}]",
        BOUNDS + "polygons: [{points: [[1, 1], [2, 2], [3, 3]]}]",
        BOUNDS + "polygons: [{points: [[1, 1], [2, 2], [2, 1], [1, 3]]}]",
        BOUNDS + "polygons: [{points: [[1, 1], [2, 2], [2, 1], [1, 1]]}]",
        BOUNDS + "walls: [{points: [[1, 1]]}]",
        BOUNDS + "walls: [{points: [[1, 1], [1, 1]]}]",
        BOUNDS + "walls: [{points: [[1, 1], [1, 2]], thickness: -0.1}]",
        BOUNDS + "walls: [{points: [[1, 1], [1, 12]]}]",
        BOUNDS + "boxes: []\nboxes: []",
        BOUNDS + "boxes: [",
        BOUNDS + "circles: " + "[" * 5000,
        BOUNDS + "circles: !!python/object:os.system {}",
        BOUNDS + "? [a, b]\n: 3",
        BOUNDS + "3: []",
    ],
)
def test_a_mistake_is_one_line_that_names_file_and_remedy(tmp_path, text, says):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as error:
        read_floor_plan(path)
    message = str(error.value)
    assert message.startswith(str(path))
    says(message)
    assert "\n" not in message
    assert len(message) < len(str(path)) + 300


def test_files_that_cannot_be_read_are_named(tmp_path, says):
    with says.raises(InputError):
        read_floor_plan(tmp_path / "absent.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"bounds: \xff\xfe")
    with says.raises(InputError):
        read_floor_plan(tmp_path / "binary.yaml")


@pytest.mark.parametrize(
    ("name", "shapes", "fill"), [("env1", 41, (0.04, 0.044)), ("env2", 14, (0.005, 0.015))]
)
def test_shipped_drawings_are_as_described(name, shapes, fill):
    plan = read_floor_plan(resource_dir("maps") / name / "shapes.yaml")
    assert len(plan.world.polygons) == shapes
    assert np.ptp(plan.outline, axis=0).tolist() == [10, 10]
    assert fill[0] < sum(abs(area(polygon)) for polygon in plan.world.polygons) / 100 < fill[1]


@pytest.mark.parametrize("name", ["env1", "env2"])
def test_a_disc_of_30_cm_gets_everywhere_in_shipped_drawings(name):
    plan = read_floor_plan(resource_dir("maps") / name / "shapes.yaml")
    space = FreeSpace(plan, step=0.02, radius=0.3, margin=0.0)
    _, regions = ndimage.label(space.clearance >= 0.3)
    assert regions == 1


def polygon(points):
    return {"bounds": [-10, -10, 10, 10], "polygons": [{"points": np.asarray(points).tolist()}]}


def star(count, swing=0.01):
    """A closed line around the origin, whose radius goes up and down."""
    angles = np.arange(count) * (2 * math.pi / count)
    radii = 5.0 + swing * (np.arange(count) % 2)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def test_a_long_outline_is_checked_side_by_side(says):
    points = star(10_000)
    assert len(floor_plan("p", polygon(points)).world.polygons[0]) == 10_000
    points[[7000, 7003]] = points[[7003, 7000]]
    with says.raises(InputError):
        floor_plan("p", polygon(points))


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=3, max_size=9))
def test_sides_cross_if_and_only_if_any_two_of_them_do(places):
    points = np.array(places, dtype=float)
    start, end = points, np.roll(points, -1, axis=0)
    assert _crosses_itself(start, end) == any(
        _side(start[i], end[i], start[j]) * _side(start[i], end[i], end[j]) < 0
        and _side(start[j], end[j], start[i]) * _side(start[j], end[j], end[i]) < 0
        for i in range(len(points))
        for j in range(i)
    )


def test_an_outline_whose_sides_all_overlap_is_refused_where_it_would_take_minutes(monkeypatch, says):
    monkeypatch.setattr("lme.worlds.shapes._MAX_PAIRS", 1000)
    comb = [
        [0.0, 0.0],
        *([k * 0.01 + 5 * (k % 2), k * 0.01 + 5 * (k % 2)] for k in range(1, 200)),
        [0.0, 9.0],
    ]
    with says.raises(InputError):
        floor_plan("p", polygon(comb))


def test_more_sides_than_anyone_draws_are_refused(monkeypatch, says):
    monkeypatch.setattr("lme.worlds.shapes.MAX_SIDES", 99)
    floor_plan("p", polygon(star(99)))
    with says.raises(InputError):
        floor_plan("p", {**polygon(star(99)), "circles": [{"centre": [0, 0], "radius": 1}]})
