"""Readers of maps given as pictures: plain bitmaps with a size, and ROS map_server maps."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from lme import plausibility
from lme.errors import InputError
from lme.types import Bools, Floats, Pose
from lme.worlds.contours import outlines
from lme.worlds.floor_plan import FloorPlan, enclosed
from lme.yaml_entry import Entry, read_yaml

MAX_PIXELS = 4096 * 4096  # a larger picture is refused before it is decoded
DARK = 0.5  # of white; darker pixels of a plain bitmap are obstacles. JPEG artefacts stay far from it

_EIGHT_BIT = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "CMYK", "YCbCr")
# What Pillow raises for a damaged picture.
_DAMAGED = (OSError, SyntaxError, ValueError, EOFError, IndexError, TypeError, OverflowError, MemoryError)
_ROS_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


def read_bitmap(path: Path, size: tuple[float, float]) -> FloorPlan:
    """A plain picture as a map of `size` (width, height) [m], with its lower left corner at the origin.

    Pixels darker than half of white are obstacles; transparent ones are white; the picture's border is a
    closed wall. Raises InputError for a file that is not a picture, is truncated, or is too large.
    """
    occupied = brightness(path) < DARK
    pixel = np.array(size) / occupied.shape[::-1]
    return _floor_plan(occupied, pixel, Pose(0.0, 0.0, 0.0))


def read_ros_map(path: Path, unknown_is_obstacle: bool) -> FloorPlan:
    """A map_server map (http://wiki.ros.org/map_server) of mode trinary.

    Cells whose occupancy is above `occupied_thresh` are obstacles, below `free_thresh` free, the rest unknown.
    The map's border is a closed wall. Raises InputError for wrong keys or values, and as `read_bitmap` does.
    """
    entry = Entry(str(path), read_yaml(path), _ROS_KEYS, ["mode"])
    image = entry.value("image")
    if not isinstance(image, str) or not image or not image.isprintable():
        raise entry.mistake("image", "the name of a picture next to this file, or its path")
    resolution = entry.number("resolution", above=0.0)
    origin = Pose(*entry.numbers("origin", "x, y, yaw", 3))
    plausibility.check(f"{path}: resolution", resolution)
    plausibility.check(f"{path}: origin.yaw", origin.yaw)
    if entry.value("mode", "trinary") != "trinary":
        raise entry.mistake("mode", "trinary, the only mode that is supported")
    try:
        white = brightness(path.parent / image)
    except InputError as error:
        raise InputError(f"{path}: image is {image}: {error}") from error
    occupancy = white if _negated(entry) else 1.0 - white
    occupied_above, free_below = _thresholds(entry)
    occupied = occupancy >= free_below if unknown_is_obstacle else occupancy > occupied_above
    return _floor_plan(occupied, np.array([resolution, resolution]), origin)


def is_picture(path: Path) -> bool:
    """Whether a file begins like a picture of a known format; it may still be damaged."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            Image.open(path).close()
    except UnidentifiedImageError:
        return False
    except (*_DAMAGED, Image.DecompressionBombError):
        pass  # brightness() says what is wrong
    return True


def brightness(path: Path) -> Floats:
    """(rows, columns) brightness from 0 (black) to 1 (white); row 0 is the bottom of the picture."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                _check_picture(path, image)
                grey = _grey(image)
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise InputError(f"{path}: {error}: must have at most {MAX_PIXELS} pixels") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such picture") from error
    except _DAMAGED as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split()) or "it needs too much memory"
        raise InputError(f"{path}: must be a complete picture (PNG, PGM, JPEG, …): {reason}") from error
    return np.asarray(grey, dtype=np.float64)[::-1] / 255.0


def _check_picture(path: Path, image: Image.Image) -> None:
    width, height = image.size
    if width * height > MAX_PIXELS:
        raise InputError(f"{path}: {width} by {height} pixels: must have at most {MAX_PIXELS}")
    if image.mode not in _EIGHT_BIT:
        raise InputError(
            f"{path}: pixels are of mode {image.mode}: must be black and white, grey or colour, 8 bit"
        )


def _grey(image: Image.Image) -> Image.Image:
    """The picture in 8-bit grey, on a white background."""
    if image.mode in ("LA", "PA", "RGBA") or "transparency" in image.info:
        picture = image.convert("RGBA")
        image = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture)
    return image.convert("L")


def _negated(entry: Entry) -> bool:
    negate = entry.value("negate")
    if negate not in (0, 1):
        raise entry.mistake("negate", "0 or 1")
    return bool(negate)


def _thresholds(entry: Entry) -> tuple[float, float]:
    occupied_above, free_below = entry.number("occupied_thresh"), entry.number("free_thresh")
    if not 0.0 <= free_below <= 1.0:
        raise entry.mistake("free_thresh", "from 0 to 1")
    if not free_below <= occupied_above <= 1.0:
        raise entry.mistake("occupied_thresh", f"from free_thresh, {free_below:g}, to 1")
    return occupied_above, free_below


def _floor_plan(occupied: Bools, pixel: Floats, origin: Pose) -> FloorPlan:
    """The plan of a grid of cells of size `pixel` (2,) [m], with its lower left corner at `origin`."""
    rows, columns = occupied.shape
    corners = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], dtype=np.float64)
    cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)

    def placed(cells: Floats) -> Floats:
        return np.asarray((cells * pixel) @ np.array([[cos, sin], [-sin, cos]]) + np.array(origin[:2]))

    polygons = tuple(placed(outline) for outline in outlines(occupied))
    return enclosed(placed(corners), np.empty((0, 3)), np.empty((0, 4)), polygons)
