"""Real buildings: several maps, each with pairs of start and goal, and measures of the way between them."""

import numpy as np
import pytest
import yaml
from PIL import Image
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from lme.config.presets import load_map_set, load_settings
from lme.errors import InputError
from lme.worlds import building
from lme.worlds.building import Buildings
from lme.worlds.room import MapFile

RADIUS = 0.2
KEYS = {"configurations": 4, "min_distance": 3.0, "radius": RADIUS}


def two_rooms(path, door):
    """A ROS map, cells of 10 cm: rooms of 4 × 4 m next to each other, with a door of this many cells between them."""
    free = np.zeros((44, 84), np.uint8)
    free[2:42, 2:41] = free[2:42, 42:82] = 254
    free[20 : 20 + door, 41] = 254
    Image.fromarray(free).save(path.with_suffix(".png"))
    about = {"image": path.with_suffix(".png").name, "resolution": 0.1, "origin": [0.0, 0.0, 0.0]}
    path.write_text(yaml.safe_dump({**about, "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196}))
    return path


@pytest.fixture
def folder(tmp_path):
    """Three buildings, whose doors have widths of 0.6, 0.8 and 1 m."""
    for name, door in (("a", 6), ("b", 8), ("c", 10)):
        two_rooms(tmp_path / f"{name}.yaml", door)
    return tmp_path


def make(paths, **keys):
    return Buildings(load_settings("map/building", paths=[str(path) for path in paths], **{**KEYS, **keys}))


def test_numbers_go_through_the_buildings_in_order(folder):
    maps = make([folder])
    assert maps.numbers == tuple(range(12))
    assert [maps.task(n).measures["building"] for n in (0, 3, 4, 11)] == [0.0, 0.0, 1.0, 2.0]
    assert maps.task(5).number == 5


def test_a_pair_is_that_of_map_file(folder):
    """The same start, goal and shortest path as with map=file, with the same keys."""
    maps = make([folder / "b.yaml", folder])
    room = MapFile(load_settings("map/file", path=str(folder / "b.yaml"), grid=0.1, **KEYS))
    for k in range(4):
        for number in (k, 8 + k):  # b itself, and b in the folder
            task, same = maps.task(number), room.task(k)
            assert task.start == same.start
            assert task.goal.tolist() == same.goal.tolist()
            assert task.shortest_path_length == same.shortest_path_length
            assert task.world is same.world  # read once
            assert (task.goal_tolerance, task.time_limit) == (same.goal_tolerance, same.time_limit)
            assert {key: task.measures[key] for key in same.measures} == same.measures
            assert maps.way(number).tolist() == room.way(k).tolist()


def test_only_the_buildings_of_the_chosen_numbers_are_read(folder, says):
    (folder / "a.png").write_text("no picture")
    maps = make([folder], worlds=[4, 9])
    assert maps.numbers == (4, 9)
    assert maps.task(9).measures["building"] == 2.0
    with says.raises(InputError):
        maps.task(5)
    with pytest.raises(InputError, match=r"a\.png"):
        make([folder]).task(0)


def test_a_pair_does_not_depend_on_the_others(folder):
    assert make([folder], worlds=[6]).task(6).start == make([folder]).task(6).start


def test_the_width_of_the_way_is_that_of_the_door(folder):
    """Of pairs in different rooms: a door of 60 cm lets a disc of at most 30 cm pass."""
    for first, door in ((0, 0.6), (20, 0.8), (40, 1.0)):
        maps = make([folder], configurations=20, min_distance=4.5)
        apart = [
            task
            for task in (maps.task(number) for number in range(first, first + 20))
            if (task.start.x < 4.0) != (task.goal[0] < 4.0)
        ]
        widths = np.array([task.measures["passage_m"] for task in apart])
        assert len(apart) > 5
        assert (widths < door + 0.11).all()
        assert widths.max() > door - 0.11


def test_the_widest_path_is_the_path_in_the_maximum_spanning_tree():
    """Against scipy: the least clearance on the tree's path between two points."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        field = rng.uniform(0.0, 1.0, (7, 9))
        start, goal = (0, 0), (6, 8)
        assert building._widest_path(field, start, goal) == pytest.approx(widest(field, start, goal))


def widest(field, start, goal):
    rows, columns = field.shape
    index = np.arange(rows * columns).reshape(rows, columns)
    one, other = [], []
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = index[: rows - dr, max(-dc, 0) : columns - max(dc, 0)]
        b = index[dr:, max(dc, 0) : columns - max(-dc, 0)]
        one, other = [*one, *a.ravel()], [*other, *b.ravel()]
    least = np.minimum(field.ravel()[one], field.ravel()[other])
    links = coo_array((2.0 - least, (one, other)), shape=(field.size, field.size))
    tree = minimum_spanning_tree(links.tocsr()).tocoo()
    neighbours = {int(k): [] for k in index.ravel()}
    for a, b, weight in zip(tree.row.tolist(), tree.col.tolist(), tree.data.tolist(), strict=True):
        neighbours[a].append((b, 2.0 - weight))
        neighbours[b].append((a, 2.0 - weight))
    reached = {int(index[start]): 9.0}
    todo = [int(index[start])]
    while todo:
        here = todo.pop()
        for there, width in neighbours[here]:
            if there not in reached:
                reached[there] = min(reached[here], width)
                todo.append(there)
    return reached[int(index[goal])]


def test_clearance_continues_beyond_the_limit_of_the_space(folder):
    maps = make([folder], worlds=[0])
    maps.task(0)
    space = maps._rooms[0]._space
    field = building._clearance(space, 0.1)
    near = space.clearance < RADIUS + 0.1
    assert (field[near] == space.clearance[near]).all()
    assert field[21, 20] == pytest.approx(2.0, abs=0.15)  # the middle of a room of 4 m


def test_names(folder):
    assert make([folder]).name == "building"
    assert make([folder / "a.yaml"]).name == "a"
    assert make([folder], name="offices").name == "offices"
    assert make([folder], name="offices").task(0).map_name == "offices"


def test_the_preset_by_name(folder):
    maps = load_map_set("building", {"paths": [str(folder)], "radius": 0.2, "min_distance": 3.0})
    assert maps.numbers == tuple(range(120))
    with pytest.raises(InputError, match="paths"):
        load_map_set("building", {"paths": 3, "radius": 0.2})


@pytest.mark.parametrize("paths", [None, []])
def test_without_maps(paths, says):
    with says.raises(InputError):
        Buildings(load_settings("map/building", paths=paths))


def test_what_is_wrong_with_paths_and_numbers_is_one_line(folder, tmp_path, says):
    (tmp_path / "empty").mkdir()
    with says.raises(InputError):
        make([tmp_path / "empty"])
    with says.raises(InputError):
        make([tmp_path / "none.yaml"])
    with says.raises(InputError):
        make([folder], worlds=[3, 12])
    with pytest.raises(InputError, match=r"map\.configurations is 0"):
        make([folder], configurations=0)
