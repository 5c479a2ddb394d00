"""Maps as pictures: cells to outlines, plain bitmaps, ROS maps."""

import contextlib
import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from PIL import Image
from scipy import ndimage

from lme.errors import InputError
from lme.types import Pose
from lme.worlds.bitmap import _floor_plan, brightness, read_bitmap, read_ros_map
from lme.worlds.contours import corners, outlines
from lme.worlds.lattice import clearance_field
from lme.worlds.room import read_floor_plan
from tests.places import SHARED
from tests.tolerances import KERNEL

ORIGINALS = SHARED / "maps"
ROS = {
    "image": "map.pgm",
    "resolution": 0.5,
    "origin": [0, 0, 0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}

masks = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.booleans())


def picture(path, rows, mode="L"):
    """Rows as one sees them, the top one first."""
    Image.fromarray(np.array(rows, dtype=np.uint8)).convert(mode).save(path)
    return path


def ros_map(tmp_path, rows, **changes):
    picture(tmp_path / "map.pgm", rows)
    text = "".join(f"{key}: {value}\n" for key, value in {**ROS, **changes}.items() if value is not None)
    (tmp_path / "map.yaml").write_text(text)
    return tmp_path / "map.yaml"


def cells_inside(polygon, shape):
    """Cells whose centre lies in a rectilinear polygon: an odd number of its upright sides to the left."""
    inside = np.zeros(shape, dtype=int)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if x0 == x1:
            inside[int(min(y0, y1)) : int(max(y0, y1)), int(x0) :] += 1
    return inside % 2 == 1


@given(masks)
def test_outlines_cover_the_occupied_cells_exactly_and_once(occupied):
    covered = sum(
        (cells_inside(polygon, occupied.shape) for polygon in outlines(occupied)), np.zeros(occupied.shape)
    )
    assert (covered == occupied).all()


@given(masks)
def test_outlines_have_no_more_corners_than_they_need_and_run_counter_clockwise(occupied):
    for polygon in outlines(occupied):
        steps = np.roll(polygon, -1, axis=0) - polygon
        assert (np.abs(steps).min(axis=1) == 0).all()
        assert ((steps * np.roll(steps, -1, axis=0)).sum(axis=1) == 0).all()  # every corner is a right angle
        (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
        assert (x0 * y1 - x1 * y0).sum() > 0


@given(masks)
def test_lattice_and_outlines_agree_on_what_is_solid(occupied):
    """Cell centres are free or solid as the picture says, wherever the polygons came from."""
    rows, columns = occupied.shape
    plan = floor_plan_of(occupied)
    field = clearance_field(plan, np.arange(columns) + 0.5, np.arange(rows) + 0.5, reach=0.6)
    assert ((field == 0.0) == occupied).all()


def floor_plan_of(occupied):
    """One metre for each cell."""
    return _floor_plan(Path("map.png"), occupied, np.array([1.0, 1.0]), Pose(0.0, 0.0, 0.0))


def test_a_bitmap_lies_with_its_lower_left_corner_at_the_origin(tmp_path):
    path = picture(tmp_path / "map.png", [[255, 255, 255], [0, 255, 255]])
    plan = read_bitmap(path, (6.0, 2.0))
    (polygon,) = plan.world.polygons
    assert {tuple(corner) for corner in polygon} == {(0, 0), (2, 0), (2, 1), (0, 1)}
    assert plan.outline.tolist() == [[0, 0], [6, 0], [6, 2], [0, 2]]


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "1", "P", "LA"])
def test_modes_of_pictures_make_no_difference(tmp_path, mode):
    path = picture(tmp_path / "map.png", [[255, 0], [0, 255]], mode)
    assert brightness(path).tolist() == [[0, 1], [1, 0]]


def test_transparent_pixels_are_white(tmp_path):
    Image.fromarray(np.zeros((2, 2, 4), dtype=np.uint8), "RGBA").save(tmp_path / "map.png")
    assert brightness(tmp_path / "map.png").tolist() == [[1, 1], [1, 1]]


def test_the_ringing_of_jpeg_leaves_no_specks(tmp_path):
    grey = np.full((120, 120), 255, dtype=np.uint8)
    grey[20:40, 30:90] = 0
    grey[60:100, 50:55] = 0
    Image.fromarray(grey).save(tmp_path / "map.jpg", quality=40)
    assert ndimage.label(brightness(tmp_path / "map.jpg") < 0.5)[1] == 2


def test_a_ros_map_is_placed_by_resolution_and_origin(tmp_path):
    white = [[255, 255], [0, 255]]
    plan = read_ros_map(ros_map(tmp_path, white, origin=[1, 2, math.pi / 2]), unknown_is_obstacle=True)
    (polygon,) = plan.world.polygons
    expected = {(1.0, 2.0), (1.0, 2.5), (0.5, 2.5), (0.5, 2.0)}
    assert {(x, y) for x, y in polygon.round(9)} == expected
    assert plan.outline[2] == pytest.approx([0.0, 3.0], abs=KERNEL)


def cells(plan):
    return len(plan.world.polygons)


def test_unknown_cells_are_obstacles_only_if_asked(tmp_path):
    path = ros_map(tmp_path, [[254, 205, 254, 0, 254]])
    assert cells(read_ros_map(path, unknown_is_obstacle=True)) == 2
    assert cells(read_ros_map(path, unknown_is_obstacle=False)) == 1


@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_unknown_cells_that_the_thresholds_make_free_are_said(tmp_path, says, mode):
    """Nav2's map_saver writes unknown cells as 205, and free_thresh: 0.25."""
    picture(tmp_path / "map.png", [[254, 205, 254, 0, 254]], mode)
    path = ros_map(tmp_path, [[254]], image="map.png", free_thresh=0.25)
    with says.warns():
        assert cells(read_ros_map(path, unknown_is_obstacle=True)) == 1
    with warnings.catch_warnings(action="error"):
        read_ros_map(path, unknown_is_obstacle=False)
        read_ros_map(ros_map(tmp_path, [[254, 205, 254, 0, 254]]), unknown_is_obstacle=True)


def test_a_size_that_makes_pixels_oblong_is_said(tmp_path, says):
    path = picture(tmp_path / "hall.png", [[255, 255, 0]] * 2)
    with says.warns():
        read_bitmap(path, (2.0, 3.0))
    with warnings.catch_warnings(action="error"):
        read_bitmap(path, (3.0, 2.1))


@pytest.mark.parametrize("mode", ["RGBA", "LA", "PA", "P"])
@pytest.mark.parametrize("colour", [0, 255])
def test_transparent_cells_are_unknown_whatever_their_colour(tmp_path, mode, colour):
    path = ros_map(tmp_path, [[255, 255, 255]], image="map.png")
    grey = Image.fromarray(np.array([[255, colour, 255]], np.uint8))
    opaque = Image.fromarray(np.array([[255, 0, 255]], np.uint8))
    if mode == "P":
        palette = Image.fromarray(np.array([[0, 1, 0]], np.uint8), "P")
        palette.putpalette([255] * 3 + [colour] * 3)
        palette.save(tmp_path / "map.png", transparency=1)
    else:
        Image.merge("LA", (grey, opaque)).convert("RGBA" if mode == "RGBA" else "LA").save(
            tmp_path / "map.png"
        )
    assert cells(read_ros_map(path, unknown_is_obstacle=True)) == 1
    assert cells(read_ros_map(path, unknown_is_obstacle=False)) == 0


@pytest.mark.parametrize("negate", [0, 1])
def test_opaque_cells_of_every_mode_are_what_they_are_in_grey(tmp_path, negate):
    """205 is unknown with the usual thresholds; the brightness must not change in its last bit."""
    rows = [[254, 205, 0, 206, 89, 90, 255]]
    plain = read_ros_map(ros_map(tmp_path, rows, negate=negate), unknown_is_obstacle=False)
    for mode in ("RGB", "RGBA", "LA", "P", "PA"):
        picture(
            tmp_path / "other.png" if mode != "PA" else tmp_path / "other.tiff",
            rows,
            "P" if mode == "PA" else mode,
        )
        name = "other.png" if mode != "PA" else "other.tiff"
        path = ros_map(tmp_path, rows, image=name, negate=negate)
        other = read_ros_map(path, unknown_is_obstacle=False)
        assert [p.tolist() for p in other.world.polygons] == [p.tolist() for p in plain.world.polygons]


@pytest.mark.parametrize(
    ("colour", "unknown"),
    [((255, 255, 0), True), ((255, 0, 0), False), ((0, 0, 255), False), ((255, 255, 128), False)],
)
def test_colours_of_a_ros_map_are_averaged(tmp_path, colour, unknown):
    """Yellow is light to the eye, but has two thirds of white. One channel of three is occupied: .667 > .65."""
    path = ros_map(tmp_path, [[255]], image="map.png")
    Image.new("RGB", (1, 1), colour).save(tmp_path / "map.png")
    obstacles = [cells(read_ros_map(path, unknown_is_obstacle=kind)) for kind in (True, False)]
    free = colour == (255, 255, 128)
    assert obstacles == ([0, 0] if free else [1, 0] if unknown else [1, 1])


def test_the_picture_may_be_in_the_home_folder(tmp_path, monkeypatch):
    (tmp_path / "home").mkdir()
    picture(tmp_path / "home" / "map.png", [[255, 0]])
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    path = ros_map(tmp_path, [[255, 255]], image="~/map.png")
    assert cells(read_ros_map(path, unknown_is_obstacle=True)) == 1
    picture(tmp_path / "~backup.png", [[0, 255, 0]])
    path = ros_map(tmp_path, [[255, 255]], image="~backup.png")
    assert cells(read_ros_map(path, unknown_is_obstacle=True)) == 2


def test_keys_of_other_tools_are_named_and_ignored(tmp_path, says):
    path = ros_map(tmp_path, [[255, 0]], map_id="floor1", cost_translation_table=[0, 100])
    with says.warns():
        assert cells(read_ros_map(path, unknown_is_obstacle=True)) == 1
    path = ros_map(tmp_path, [[255, 0]], resolution=None, resolutoin=0.05)
    with (
        pytest.warns(UserWarning, match="resolutoin"),
        pytest.raises(InputError, match="resolution is missing"),
    ):
        read_ros_map(path, unknown_is_obstacle=True)


def test_a_map_of_twenty_million_cells_is_read(tmp_path):
    rows = np.full((4000, 5000), 254, np.uint8)
    rows[1000:1010, 2000:3000] = 0
    plan = read_ros_map(ros_map(tmp_path, rows, resolution=0.05), unknown_is_obstacle=True)
    assert plan.outline[2].tolist() == pytest.approx([250.0, 200.0])
    (wall,) = plan.world.polygons
    assert np.ptp(wall, axis=0) == pytest.approx([50.0, 0.5])


@given(masks)
def test_corners_are_counted_without_the_outlines(occupied):
    drawn = sum(map(len, outlines(occupied)))
    assert corners(occupied) <= drawn
    holes = ndimage.label(~np.pad(occupied, 1), structure=np.ones((3, 3)))[1] - 1
    assert corners(occupied) == drawn or holes


def test_noise_is_refused_before_it_takes_an_hour(tmp_path, monkeypatch, says):
    monkeypatch.setattr("lme.worlds.bitmap.MAX_CORNERS", 1000)
    noise = picture(tmp_path / "noise.png", np.indices((30, 30)).sum(axis=0) % 2 * 255)
    with says.raises(InputError):
        read_bitmap(noise, (1.0, 1.0))


def test_negate_swaps_black_and_white(tmp_path):
    rows = [[255, 255, 255, 0, 255]]
    assert cells(read_ros_map(ros_map(tmp_path, rows), unknown_is_obstacle=True)) == 1
    assert cells(read_ros_map(ros_map(tmp_path, rows, negate="true"), unknown_is_obstacle=True)) == 2


@pytest.mark.parametrize(
    "changes",
    [
        {"image": "gone.pgm"},
        {"image": 3},
        {"image": "''"},
        {"resolution": 0},
        {"resolution": None},
        {"origin": [0, 0]},
        {"negate": 2},
        {"mode": "raw"},
        {"free_thresh": -1},
        {"free_thresh": 0.9},
        {"occupied_thresh": "high"},
        {"resolution": "5000"},
        {"resolution": "0.000001"},
    ],
    ids=str,
)
def test_a_mistake_in_a_ros_map_is_one_line(tmp_path, changes, says):
    path = ros_map(tmp_path, [[255, 0]], **changes)
    with says.raises(InputError):
        read_ros_map(path, unknown_is_obstacle=True)


@pytest.mark.parametrize(
    "changes",
    [
        {"origin": [0, 0, 30]},
        {"origin": [0, 0, -90]},
        {"resolution": 50},
        {"resolution": "0.0005"},
    ],
    ids=str,
)
def test_a_value_in_another_unit_gets_a_warning(tmp_path, changes, says):
    path = ros_map(tmp_path, [[255, 0]], **changes)
    with says.warns():
        read_ros_map(path, unknown_is_obstacle=True)


def broken_pictures(tmp_path):
    whole = picture(tmp_path / "whole.png", np.random.default_rng(0).integers(0, 255, (64, 64))).read_bytes()
    yield "truncated.png", whole[: len(whole) // 2]
    yield "header.png", whole[:20]
    yield "text.png", b"no picture"
    yield "empty.png", b""
    yield "short.pgm", b"P5 100 100 255\n123"
    yield "letters.pgm", b"P2 2 2 255\na b c d"
    yield "endless.pgm", b"P5 1000000 1000000 255\n"
    yield "large.pgm", b"P5 10001 10000 255\n"
    yield "deep.pgm", b"P5 2 1 65535\n\x00\x00\xff\xff"


def test_broken_and_enormous_pictures_are_one_line(tmp_path):
    for name, content in broken_pictures(tmp_path):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError) as error:
            read_bitmap(tmp_path / name, (10.0, 10.0))
        assert str(tmp_path / name) in str(error.value)
        assert "must" in str(error.value)
        assert "\n" not in str(error.value)


def test_a_picture_that_asks_for_too_much_memory_is_one_line(tmp_path, monkeypatch, says):
    path = picture(tmp_path / "map.png", [[255, 0]])

    def no_memory(*_):
        raise MemoryError

    monkeypatch.setattr(Image.Image, "convert", no_memory)
    with says.raises(InputError):
        read_bitmap(path, (1.0, 1.0))


@given(st.data())
def test_a_picture_with_damaged_bytes_is_read_or_refused(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damaged") / "map.png"
    content = bytearray(picture(path, np.eye(9) * 255).read_bytes())
    for _ in range(3):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    with contextlib.suppress(InputError):
        read_bitmap(path, (1.0, 1.0))


def test_the_kind_of_file_follows_from_name_and_content(tmp_path, says):
    image = picture(tmp_path / "map.png", [[255, 0]])
    assert len(read_floor_plan(image, (2.0, 1.0)).world.polygons) == 1
    with says.raises(InputError, match="size.*null"):
        read_floor_plan(image)
    path = ros_map(tmp_path, [[255, 0]])
    assert read_floor_plan(path).outline[2].tolist() == [1.0, 0.5]
    with says.raises(InputError):
        read_floor_plan(path, (2.0, 1.0))


@pytest.mark.skipif(not ORIGINALS.is_dir(), reason="the original maps are not here")
@pytest.mark.parametrize(
    ("name", "obstacles", "fill"),
    [("d6.jpg", 41, 0.042), ("d1.jpg", 53, 0.055), ("pfeiffer_3.png", 10, None)],
)
def test_originals_are_read_as_they_look(name, obstacles, fill):
    dark = brightness(ORIGINALS / name) < 0.5
    labels, count = ndimage.label(dark, structure=np.ones((3, 3)))
    frame = labels == labels[0, 0]
    assert abs(count - 1 - obstacles) <= 1
    if fill is not None:
        assert (dark & ~frame).mean() == pytest.approx(fill, abs=0.004)
    assert len(read_bitmap(ORIGINALS / name, (10.0, 10.0)).world.edges) < 1200


def test_a_photo_is_turned_as_a_viewer_shows_it(tmp_path):
    """Exif orientation 6: the camera was held upright, and its rows are the columns of the photo."""
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(np.array([[0, 255, 255]], dtype=np.uint8)).save(tmp_path / "photo.png", exif=exif)
    np.testing.assert_array_equal(brightness(tmp_path / "photo.png"), [[1.0], [1.0], [0.0]])
