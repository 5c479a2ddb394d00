"""The paper's real-world scenes, redrawn: what they are, and that they trap a plain local planner but not LME."""

import functools
import itertools
import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.guides.lme.guide import Lme
from lme.guides.target import Target, TargetConfig
from lme.inputs.resources import resource_dir
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.dwa import Dwa
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.types import Outcome
from lme.worlds.check import check_task, point_clearance
from lme.worlds.scene import Scene, read_scene
from lme.worlds.world import World
from runners.config import catalogue
from runners.config.instantiate import build
from tests.builders import PUBLISHED, SHIPPED, shipped

STATIC = ("real1", "real2", "real3", "real4")
DYNAMIC = "real1_dynamic"
QUADRUPED = ("go2_a", "go2_b")
ALL = (*STATIC, DYNAMIC, *QUADRUPED)
STANDING = [name for name in ALL if name != DYNAMIC]
TRAPPED_SHARE = 0.8  # of the starts, at least, that plain DWA does not arrive from
ARRIVED_SHARE = 0.7  # of the starts, at least, that LME arrives from; it clips a corner now and then
STARTS = 8  # of the 20, for time
GAP_1 = (5.47, 3.0)  # [m] in the middle of the second gap of Real1
OPENING_1 = (2.2, 3.0)  # [m] in the middle of the first


def machine(name):
    return shipped("go2" if name in QUADRUPED else "turtlebot2")


def scene(name, **keys):
    return Scene(
        load_settings("map/_scene", name=name, radius=machine(name).footprint.circumscribed_radius, **keys)
    )


def lme(robot):
    return Navigator(
        Lme(load_settings("guide/lme", parameters=PUBLISHED), robot),
        Simple(load_settings("planner/simple"), robot),
    )


def dwa(robot):
    return Navigator(Target(TargetConfig(), robot), Dwa(load_settings("planner/dwa"), robot))


@functools.cache
def episodes(name, make):
    robot, chosen = machine(name), scene(name)
    driver, simulator = make(robot), FastSimulator(load_settings("sim/fast"), robot)
    return [
        run_episode(chosen.task(number), driver, simulator, np.random.default_rng(number))
        for number in range(STARTS)
    ]


def arrived(name, make):
    outcomes = [episode.outcome for episode in episodes(name, make)]
    return outcomes.count(Outcome.SUCCESS) / len(outcomes)


# What they are


@pytest.mark.parametrize("name", ALL)
def test_the_robot_can_begin_everywhere_and_a_way_exists(name):
    chosen = scene(name)
    assert chosen.numbers == tuple(range(20))
    for number in chosen.numbers:
        task = chosen.task(number)
        check_task(task, machine(name))
        assert task.map_name == name
        assert 1.02 < task.measures["detour"] < 2.0


@pytest.mark.parametrize("name", ALL)
def test_the_place_is_as_large_as_the_laboratory(name):
    outline = read_scene(resource_dir("maps") / "scenes" / f"{name}.yaml").plan.outline
    assert np.ptp(outline, axis=0).tolist() == [8.0, 6.0]


@pytest.mark.parametrize("name", ALL)
def test_starts_lie_about_the_drawn_one_and_face_the_goal(name):
    drawing = read_scene(resource_dir("maps") / "scenes" / f"{name}.yaml")
    chosen = scene(name)
    starts = np.array([chosen.task(number).start for number in chosen.numbers])
    ahead = math.atan2(*(drawing.goal - drawing.start)[::-1])
    away = starts[:, :2] - drawing.start
    aside = -math.sin(ahead) * away[:, 0] + math.cos(ahead) * away[:, 1]
    assert np.hypot(*away.T) == pytest.approx(np.abs(aside))
    assert 0.1 < np.abs(aside).max() <= 0.3
    assert 0.1 < np.abs(starts[:, 2] - ahead).max() <= 0.3
    assert len({tuple(start) for start in starts}) == len(starts)


def test_a_number_means_the_same_whatever_else_is_chosen():
    assert scene("real2", worlds=[3, 900]).task(3).start == scene("real2").task(3).start
    assert scene("real2", start_seed=1).task(3).start != scene("real2").task(3).start


def test_no_robot_fits_through_the_second_gap_of_real1_and_the_turtlebot_through_the_first():
    world = scene("real1").task(0).world
    assert point_clearance(world, np.array(GAP_1)) < min(
        shipped(name).footprint.inscribed_radius for name in SHIPPED
    )
    assert point_clearance(world, np.array(OPENING_1)) > machine("real1").footprint.circumscribed_radius


def test_the_dynamic_scene_is_real1_and_a_pedestrian():
    still, moving = scene("real1").task(0), scene(DYNAMIC).task(0)
    np.testing.assert_array_equal(moving.world.edges, still.world.edges)
    np.testing.assert_array_equal(moving.world.circles, still.world.circles)
    assert (moving.start, moving.goal.tolist()) == (still.start, still.goal.tolist())
    assert (len(still.world.movers), len(moving.world.movers)) == (0, 1)


def test_the_pedestrian_closes_the_passage_and_another_way_is_left(tmp_path):
    """With him as a pillar where he stops, the shortest way becomes a longer one."""
    (pedestrian,) = scene(DYNAMIC).task(0).world.movers
    x, y, _ = pedestrian.path[-1].tolist()
    text = (resource_dir("maps") / "scenes" / "real1.yaml").read_text("utf-8")
    pillar = tmp_path / "pillar.yaml"
    circles = f"circles:\n  - {{centre: [{x}, {y}], radius: {pedestrian.radius}}}"
    pillar.write_text(text.replace("circles:", circles), "utf-8")
    radius = machine("real1").footprint.circumscribed_radius
    blocked = Scene(load_settings("map/_scene", path=str(pillar), radius=radius)).task(0)
    assert blocked.shortest_path_length > scene("real1").task(0).shortest_path_length + 0.1
    assert blocked.map_name == "pillar"


def test_the_pedestrian_waits_clear_of_everything():
    world = scene(DYNAMIC).task(0).world
    (pedestrian,) = world.movers
    for one, two in itertools.pairwise(pedestrian.path[:, :2]):
        for share in np.linspace(0.0, 1.0, 21):
            assert point_clearance(world, one + share * (two - one)) > pedestrian.radius


# What they do


@pytest.mark.parametrize("name", STANDING)
def test_plain_dwa_is_trapped_in_the_papers_scenes(name):
    assert arrived(name, dwa) <= 1.0 - TRAPPED_SHARE


@pytest.mark.parametrize("name", STANDING)
def test_lme_arrives_in_the_papers_scenes(name):
    assert arrived(name, lme) >= ARRIVED_SHARE


def test_in_real1_dwa_passes_the_first_opening_and_is_trapped_at_the_second_gap():
    ends = np.array([episode.trajectory[-1, 1:3] for episode in episodes("real1", dwa)])
    at_gap = np.hypot(*(ends - GAP_1).T) < 0.6
    assert at_gap.mean() >= 0.5


def test_lme_meets_the_pedestrian_and_takes_another_way():
    """He sets out in most episodes; LME gets round him, while what it drove without him leads through him."""
    (pedestrian,) = scene(DYNAMIC).task(0).world.movers
    place, reach = (
        pedestrian.path[-1, :2],
        pedestrian.radius + machine(DYNAMIC).footprint.circumscribed_radius,
    )
    met = [
        number
        for number, episode in enumerate(episodes("real1", lme))
        if np.hypot(*(episode.trajectory[:, 1:3] - place).T).min() < reach
    ]
    assert len(met) >= STARTS / 2
    ended = episodes(DYNAMIC, lme)
    assert np.mean([ended[number].outcome is Outcome.SUCCESS for number in met]) >= 0.8


# Files


@pytest.mark.parametrize("name", ALL)
def test_the_yaml_builds_what_ships(name):
    written = catalogue.shipped().values(f"map/{name}")
    assert build(written, "map").config == load_settings("map/_scene", name=name)


DOOR = """
bounds: [0, 0, 4, 4]
start: [1, 1]
goal: [3, 3]
movers:
  - {outline: [[0, 0], [1, 0], [1, 0.1]], path: [[2, 2, 0], [2, 2, 90]], turn_rate_deg: 45, start_after: 2,
     repeat: back_and_forth}
"""


def test_a_door_is_a_mover_with_angles_in_degrees(tmp_path):
    file = tmp_path / "door.yaml"
    file.write_text(DOOR, "utf-8")
    (door,) = read_scene(file).plan.world.movers
    assert door.path[:, 2].tolist() == pytest.approx([0.0, math.pi / 2])
    assert door.turn_rate == pytest.approx(math.pi / 4)
    assert (door.start_after, door.repeat, door.radius) == (2.0, "back_and_forth", None)
    assert door.outline.tolist() == [[0, 0], [1, 0], [1, 0.1]]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("start: [1, 1]\n", ""),
        ("goal: [3, 3]", "goal: [3]"),
        ("goal:", "gaol:"),
        ("turn_rate_deg", "turn_rate"),
        ("turn_rate_deg: 45", "turn_rate_deg: fast"),
        ("[2, 2, 90]", "[2]"),
        ("path: [[2, 2, 0], [2, 2, 90]]", "path: 3"),
        ("path: [[2, 2, 0], [2, 2, 90]]", "path: []"),
        ("outline:", "radius: 0.2, outline:"),
        ("start_after: 2", "start_after: -2"),
        ("back_and_forth", "once, motion: fly"),
        ("back_and_forth", "once, sees_robot: 2"),
        ("back_and_forth", "once, motion: orca"),
        ("back_and_forth", "[often]"),
        ("bounds: [0, 0, 4, 4]", "bounds: [0, 0, 4, 4]\nboxes: {}\ncircles: [1]"),
    ],
)
def test_a_mistake_in_a_scene_file_is_one_line_that_names_its_place(tmp_path, old, new, says):
    file = tmp_path / "scene.yaml"
    assert old in DOOR
    file.write_text(DOOR.replace(old, new), "utf-8")
    with pytest.raises(InputError) as error:
        read_scene(file)
    assert str(error.value).startswith(str(file))
    says(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "keys",
    [
        {"name": "real5"},
        {},
        {"path": "."},
        {"path": "nowhere.yaml"},
        {"name": "real1", "starts": 0},
        {"name": "real1", "worlds": [2, 2]},
    ],
    ids=str,
)
def test_a_mistake_in_a_key_is_one_line(keys, says):
    with says.raises(InputError):
        Scene(load_settings("map/_scene", **keys))


def test_a_robot_that_is_too_wide_for_the_only_way_is_refused(says):
    with says.raises(InputError):
        Scene(load_settings("map/_scene", name="real1", radius=0.45)).task(0)


@pytest.mark.parametrize("start", ["[9, 3]", "[4, 3.6]"])
def test_a_start_that_is_not_free_says_so(tmp_path, start, says):
    path = tmp_path / "blocked.yaml"
    path.write_text(
        f"bounds: [0, 0, 8, 6]\nstart: {start}\ngoal: [7, 3]\ncircles: [{{centre: [4, 3], radius: 0.5}}]\n"
    )
    with says.raises(InputError):
        Scene(load_settings("map/_scene", path=str(path), radius=0.2, lateral=0.0)).task(0)


@pytest.mark.parametrize("shape", ["radius: 0.25", "outline: [[0.25, 1], [0.25, -1], [-1, 0]]"])
@pytest.mark.parametrize(("x", "refused"), [(1.44, True), (1.46, False)])
def test_a_start_where_a_mover_stands_is_refused(tmp_path, shape, x, refused, says):
    # Turned to face the start, either shape begins 0.25 m nearer than its origin.
    path = tmp_path / "met.yaml"
    path.write_text(
        f"bounds: [0, 0, 8, 6]\nstart: [1, 3]\ngoal: [7, 3]\nmovers: [{{{shape}, path: [[{x}, 3, 180]]}}]\n"
    )
    met = Scene(load_settings("map/_scene", path=str(path), radius=0.2, lateral=0.0))
    if not refused:
        assert met.task(0).number == 0
        return
    with says.raises(InputError):
        met.task(0)


def test_an_edited_file_is_read_again(tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(DOOR, "utf-8")
    chosen = load_settings("map/_scene", path=str(file), worlds=[0])
    assert Scene(chosen).task(0).world.polygons == World().polygons
    file.write_text(DOOR + "boxes:\n  - {centre: [2, 3], size: [0.2, 0.2]}\n", "utf-8")
    assert len(Scene(chosen).task(0).world.polygons) == 1
