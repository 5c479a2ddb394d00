"""Published files: read, compared, imported; broken ones are one-line errors and never trusted."""

import shutil

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.worlds.barn.files import find_worlds, read_path, read_world
from lme.worlds.barn.layouts import import_worlds, official_layout
from lme.worlds.barn.map_set import Barn

MODEL = """<model name='{name}'><static>1</static><pose frame=''>{x:.6f} {y:.6f} 0 0 0 0</pose>
<link name='link'>
<collision name='collision'>
<geometry><cylinder><radius>{radius:.6f}</radius><length>1</length></cylinder></geometry>
</collision>
<visual name='visual'><geometry><cylinder><radius>9</radius><length>1</length></cylinder></geometry></visual>
</link></model>"""
GROUND = """<model name='ground_plane'><link name='link'>
<collision name='collision'><geometry><plane/></geometry></collision></link></model>"""
STATE = "<state world_name='default'><model name='unit_cylinder_0'><pose>7 7 0 0 0 0</pose></model></state>"


def sdf(cylinders, extra=""):
    models = [
        MODEL.format(name=f"unit_cylinder_{i}", x=x, y=y, radius=r) for i, (x, y, r) in enumerate(cylinders)
    ]
    return f"<sdf version='1.6'><world name='default'>{GROUND}{''.join(models)}{extra}{STATE}</world></sdf>"


def write_world(folder, number, cylinders=None, path=True, extra=""):
    layout = official_layout(number % 300)
    folder.joinpath("path_files").mkdir(parents=True, exist_ok=True)
    file = folder / f"world_{number}.world"
    file.write_text(sdf(layout.cylinders if cylinders is None else cylinders, extra))
    if path:
        np.save(folder / "path_files" / f"path_{number}.npy", layout.path)
    return file


def barn(folder, **keys):
    return Barn(load_settings("map/barn", **{"source": str(folder), "subset": "all", **keys}))


@pytest.mark.parametrize("layout", [".", "BARN", "worlds/BARN", "jackal_helper/worlds/BARN"])
def test_worlds_are_found_in_every_layout(tmp_path, layout):
    for number in (12, 3):
        write_world(tmp_path / layout, number)
    assert list(find_worlds(tmp_path)) == [3, 12]
    (tmp_path / layout / "world_x.world").touch()
    (tmp_path / layout / "world_007.world").touch()
    assert barn(tmp_path).numbers == (3, 12)


@pytest.mark.parametrize("path", [True, False])
def test_a_published_world_is_the_official_one(tmp_path, path):
    write_world(tmp_path, 42, path=path)
    ours, theirs = Barn(load_settings("map/barn", subset="all")), barn(tmp_path)
    one, other = ours.task(42), theirs.task(42)
    np.testing.assert_array_equal(one.world.circles, other.world.circles)
    assert (one.optimal_time, one.measures) == (other.optimal_time, other.measures)
    assert theirs.layout(42).recipe == ours.layout(42).recipe


def test_a_changed_world_is_used_as_it_is(tmp_path):
    cylinders = np.vstack([official_layout(5).cylinders, [-2.4, 4.5, 0.075]])
    write_world(tmp_path, 5, cylinders, path=False)
    layout = barn(tmp_path).layout(5)
    np.testing.assert_array_equal(layout.cylinders, cylinders)
    assert layout.recipe is None
    assert barn(tmp_path).task(5).optimal_time > 5.0


def test_a_world_without_a_way_through_and_without_a_path(tmp_path, says):
    wall = [(-4.425 + 0.15 * i, 7.575, 0.075) for i in range(30)]
    write_world(tmp_path, 5, np.vstack([official_layout(5).cylinders, wall]), path=False)
    with says.raises(InputError):
        barn(tmp_path).task(5)


def test_a_path_of_another_world_is_refused(tmp_path, says):
    write_world(tmp_path, 5)
    np.save(tmp_path / "path_files" / "path_5.npy", official_layout(299).path)
    with says.raises(InputError):
        barn(tmp_path).task(5)


BOMB = b"<!DOCTYPE x [<!ENTITY a 'ha'><!ENTITY b '&a;&a;&a;'>]><sdf><world>&b;</world></sdf>"
CRATE = """<model name='crate'><link><collision>
<geometry><box><size>1 1 1</size></box></geometry></collision></link></model>"""
GHOST = "<model name='ghost'><link><visual><geometry><box/></geometry></visual></link></model>"
CAFE = "<include><uri>model://cafe</uri></include>"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00\xff\x00 nothing",
        b"<sdf><world name='default'>",
        b"<?xml version='1.0' encoding='nonsense'?><sdf/>",
        BOMB,
        b"<html><body/></html>",
        b"<sdf version='1.6'></sdf>",
        b"<sdf><world name='default'></world></sdf>",
        sdf([(0.0, 0.0, 0.075)]).encode(),
        sdf(official_layout(0).cylinders, CRATE).encode(),
        sdf(official_layout(0).cylinders, CAFE).encode(),
        sdf([(0.0, 0.0, -1.0)]).encode(),
        sdf([(float("nan"), 0.0, 1.0)]).encode(),
        b" " * (16 * 2**20 + 1),
    ],
)
def test_broken_worlds_are_one_line_that_names_the_file(tmp_path, content, says):
    file = tmp_path / "world_0.world"
    file.write_bytes(content)
    with says.raises(InputError) as error:
        read_world(file)
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_truncated_published_world_is_an_error(tmp_path):
    file = write_world(tmp_path, 0)
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(InputError, match="truncated"):
        barn(tmp_path).task(0)


def test_a_missing_file_or_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_world(tmp_path / "world_0.world")
    with pytest.raises(InputError, match="not a regular file"):
        read_world(tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        find_worlds(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"holds no world_N\.world"):
        find_worlds(tmp_path)


def test_only_collision_bodies_and_the_first_pose_count(tmp_path):
    """The state repeats the models, visuals have radius 9: neither is read."""
    cylinders = official_layout(0).cylinders
    np.testing.assert_array_equal(read_world(write_world(tmp_path, 0, extra=GHOST)), cylinders)


class _Evil:
    def __reduce__(self):
        return (exec, ("raise SystemExit('a pickle was loaded')",))


@pytest.mark.parametrize(
    "array",
    [
        np.array([_Evil()], dtype=object),
        np.zeros((5, 2)),
        np.zeros((5, 3), dtype=int),
        np.zeros(4, dtype=int),
        np.zeros((5, 2), dtype=bool),
        np.zeros((0, 2), dtype=int),
        np.zeros((5, 2), dtype=int),
        np.array([(0, 0), (0, 30)]),
        np.array([(0, 0), (-1, 0)]),
        np.array([(0, 0), (5, 5)]),
        np.array([(0, 0), (0, 1)], dtype="datetime64[s]"),
    ],
    ids=lambda array: f"{array.dtype}{array.shape}",
)
def test_invalid_path_arrays_are_refused(tmp_path, array):
    file = tmp_path / "path_0.npy"
    np.save(file, array, allow_pickle=True)
    with pytest.raises(InputError, match=r"path_0\.npy"):
        read_path(file)


@pytest.mark.parametrize(
    "shape", [b"(10**9, 2)", b"(9**99, 2", b"(900000000000, 2)", b"(-1, 2)", b"[3, 2)", b"x"]
)
def test_headers_that_promise_another_array(tmp_path, shape):
    file = tmp_path / "path_0.npy"
    np.save(file, np.zeros((10, 2), dtype=np.int64))
    old = b"(10, 2), }" + b" " * 10
    assert old in file.read_bytes()
    file.write_bytes(file.read_bytes().replace(old, (shape + b", }").ljust(len(old))))
    with pytest.raises(InputError, match=r"path_0\.npy") as error:
        read_path(file)
    assert "\n" not in str(error.value)


def test_an_archive_is_not_a_path(tmp_path, says):
    np.savez(tmp_path / "path_0.npz", np.zeros((10, 2), dtype=np.int64))
    with says.raises(InputError):
        read_path(tmp_path / "path_0.npz")


def _read(file):
    """The path, or the message that refuses it."""
    try:
        return read_path(file)
    except InputError as error:
        return str(error)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)
@given(st.data())
def test_damaged_paths_are_read_or_refused(tmp_path, data):
    file = tmp_path / "path_0.npy"
    np.save(file, official_layout(0).path)
    content = bytearray(file.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, 140))] = data.draw(st.integers(0, 255))
    file.write_bytes(bytes(content[: data.draw(st.integers(0, len(content)))]))
    result = _read(file)
    assert "\n" not in result if isinstance(result, str) else result.shape[1] == 2


def test_import_copies_and_compares(tmp_path):
    write_world(tmp_path / "from", 1)
    write_world(tmp_path / "from", 2, path=False)
    write_world(tmp_path / "from", 3, np.vstack([official_layout(3).cylinders, [-2.4, 4.5, 0.075]]))
    write_world(tmp_path / "from", 300)
    report = import_worlds(tmp_path / "from", tmp_path / "deep" / "to")
    assert [(world.number, world.cylinders, world.path) for world in report] == [
        (1, "equal", "equal"),
        (2, "equal", "missing"),
        (3, "different", "equal"),
        (300, "not official", "not official"),
    ]
    assert barn(tmp_path / "deep" / "to").numbers == (1, 2, 3, 300)
    for file in (tmp_path / "from").rglob("*.*"):
        assert (
            tmp_path / "deep" / "to" / file.relative_to(tmp_path / "from")
        ).read_bytes() == file.read_bytes()
    assert [folder.name for folder in (tmp_path / "deep").iterdir()] == ["to"]


def test_import_overwrites_nothing(tmp_path):
    write_world(tmp_path / "from", 1)
    target = tmp_path / "to"
    target.mkdir()
    (target / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="already exists"):
        import_worlds(tmp_path / "from", target)
    assert [file.name for file in target.iterdir()] == ["mine.txt"]


def test_import_leaves_nothing_half_written(tmp_path, monkeypatch, says):
    write_world(tmp_path / "from", 1)
    write_world(tmp_path / "from", 2).write_text("<sdf>")
    with pytest.raises(InputError, match=r"world_2\.world"):
        import_worlds(tmp_path / "from", tmp_path / "to")
    write_world(tmp_path / "from", 2)
    copies, copyfile = [], shutil.copyfile

    def full_disk(source, target):
        copies.append(target)
        if len(copies) == 3:
            raise OSError(28, "No space left on device")
        copyfile(source, target)

    monkeypatch.setattr(shutil, "copyfile", full_disk)
    with says.raises(InputError):
        import_worlds(tmp_path / "from", tmp_path / "to")
    assert [folder.name for folder in tmp_path.iterdir()] == ["from"]
