"""Readers of maps given as pictures: plain bitmaps with a size, and ROS map_server maps."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from lme.errors import InputError, config_key
from lme.inputs import plausibility
from lme.inputs.guarded_file import expanded, open_bytes, read_yaml
from lme.inputs.yaml_entry import Entry
from lme.types import Bools, Floats, Pose
from lme.worlds.contours import corners, outlines
from lme.worlds.world import FloorPlan, enclosed

MAX_PIXELS = 100_000_000  # a larger picture is refused before it is decoded
MAX_CORNERS = 1_000_000  # of obstacles, which take some 20 s
DARK = 0.5  # of white; darker pixels of a plain bitmap are obstacles. JPEG artefacts stay far from it

_PICTURE_BYTES = 2**30
_SQUARE = 1.1  # the sides of a pixel usually differ by less than this factor
_SAVED_UNKNOWN = 205 / 255  # of white: the grey with which map_saver writes unknown cells
_MOST_STRAY = 0.01  # share of the pixels that may have this grey by chance
_OPAQUE = 128  # alpha from which a pixel of a ROS map has its colour; one below is unknown
_EIGHT_BIT = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "CMYK", "YCbCr")
# Errors that Pillow raises for a damaged picture.
_DAMAGED = (OSError, SyntaxError, ValueError, EOFError, IndexError, TypeError, OverflowError, MemoryError)
_ROS_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


def read_bitmap(path: Path, size: tuple[float, float]) -> FloorPlan:
    """A plain picture as a map of `size` (width, height) [m], with its lower left corner at the origin.

    Pixels darker than half of white are obstacles; transparent ones are white; the picture's border is a
    closed wall. Raises InputError for a file that is not a picture, is truncated, or is too large.
    """
    occupied = brightness(path) < DARK
    rows, columns = occupied.shape
    pixel = np.array(size) / (columns, rows)
    if max(pixel) > _SQUARE * min(pixel):
        warnings.warn(
            f"{config_key('size')} is {list(size)} m for {path} of {columns} by {rows} pixels: a pixel is "
            f"{pixel[0]:.3g} by {pixel[1]:.3g} m; is it [width, height] of the whole picture?",
            stacklevel=2,
        )
    return _floor_plan(path, occupied, pixel, Pose(0.0, 0.0, 0.0))


def read_ros_map(path: Path, unknown_is_obstacle: bool) -> FloorPlan:
    """A map_server map (http://wiki.ros.org/map_server) of mode trinary.

    Cells whose occupancy is above `occupied_thresh` are obstacles, below `free_thresh` free, the rest and transparent
    ones unknown. The map's border is a closed wall. Warns of keys that are not map_server's, and ignores them. Raises
    InputError for wrong keys or values, and as `read_bitmap` does.
    """
    entry = _ros_entry(path)
    image = entry.value("image")
    if not isinstance(image, str) or not image or not image.isprintable():
        raise entry.mistake("image", "the name of a picture next to this file, or its path")
    resolution = entry.number("resolution", above=0.0)
    origin = Pose(*entry.numbers("origin", "x, y, yaw", 3))
    plausibility.check(f"{path}: resolution", resolution)
    plausibility.check(f"{path}: origin.yaw", origin.yaw)
    if str(entry.value("mode", "trinary")).lower() != "trinary":
        raise entry.mistake("mode", "trinary, the only mode that is supported")
    try:
        in_home = image.startswith("~/")
        picture = path.parent / (expanded(image) if in_home else image)
        levels, white, transparent = _levels(picture)
    except InputError as error:
        raise InputError(f"{path}: image is {image}: {error}") from error
    # The shade of each level: a picture of floats would take eight times the memory.
    shades = np.arange(white + 1) / white
    negate = entry.value("negate")
    if negate not in (0, 1):
        raise entry.mistake("negate", "0 or 1")
    occupancy = shades if negate else 1.0 - shades
    occupied_above, free_below = entry.number("occupied_thresh"), entry.number("free_thresh")
    if not 0.0 <= free_below <= 1.0:
        raise entry.mistake("free_thresh", "from 0 to 1")
    if not free_below <= occupied_above <= 1.0:
        raise entry.mistake("occupied_thresh", f"from free_thresh, {free_below:g}, to 1")
    saved_unknown = round(_SAVED_UNKNOWN * white)
    if (
        unknown_is_obstacle
        and occupancy[saved_unknown] < free_below
        and (levels == saved_unknown).mean() > _MOST_STRAY
    ):
        warnings.warn(
            f"{path}: free_thresh is {free_below:g}, so the grey 205 of unknown cells counts as free: make it 0.196 to "
            "keep unknown cells unknown",
            stacklevel=2,
        )
    occupied = (occupancy >= free_below if unknown_is_obstacle else occupancy > occupied_above)[levels]
    if transparent is not None:
        occupied[transparent] = unknown_is_obstacle
    return _floor_plan(path, occupied, np.array([resolution, resolution]), origin)


def is_picture(path: Path) -> bool:
    """Return whether a file begins like a picture of a known format; it may still be damaged."""
    try:
        with warnings.catch_warnings(), open_bytes(path) as file:
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            Image.open(file).close()
    except UnidentifiedImageError:
        return False
    except InputError:
        raise
    except (*_DAMAGED, Image.DecompressionBombError):
        pass  # brightness() says what is wrong
    return True


def brightness(path: Path) -> Floats:
    """(rows, columns) brightness from 0 (black) to 1 (white); row 0 is the bottom of the picture.

    A photo is turned upright, as a viewer shows it. Colours have the brightness that they have to the eye (ITU-R
    601-2); transparent pixels are white.
    """
    with _opened(path) as opened:
        image = ImageOps.exif_transpose(opened)
        if _may_be_transparent(image):
            picture = image.convert("RGBA")
            image = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture)
        return np.asarray(image.convert("L"), dtype=np.float64)[::-1] / 255.0


def _levels(path: Path) -> tuple[NDArray[np.uint8] | NDArray[np.uint16], int, Bools | None]:
    """Read a picture as sums of its colours, as map_server takes them.

    Returns the sums (rows, columns), with row 0 at the bottom; the sum of white; and which pixels (rows, columns) are
    transparent, None if the picture has no transparency.
    """
    with _opened(path) as image:
        if _may_be_transparent(image):
            pixels = np.asarray(image.convert("RGBA"))[::-1]
            return pixels[..., :3].sum(axis=-1, dtype=np.uint16), 3 * 255, pixels[..., 3] < _OPAQUE
        if image.mode in ("1", "L"):
            return np.asarray(image.convert("L"))[::-1], 255, None
        return np.asarray(image.convert("RGB"))[::-1].sum(axis=-1, dtype=np.uint16), 3 * 255, None


@contextmanager
def _opened(path: Path) -> Iterator[Image.Image]:
    """Open a picture of a valid size and type of pixels; any damage found while it is decoded raises InputError."""
    try:
        with warnings.catch_warnings(), open_bytes(path, _PICTURE_BYTES) as file:
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # MAX_PIXELS is the limit
            with Image.open(file) as image:
                _check_picture(path, image)
                yield image
    except Image.DecompressionBombError as error:
        raise InputError(f"{path}: {error}: must have at most {MAX_PIXELS} pixels") from error
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such picture") from error
    except _DAMAGED as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split()) or "it needs too much memory"
        if isinstance(error, UnidentifiedImageError):
            reason = "its format is not known"
        raise InputError(f"{path}: must be a complete picture (PNG, PGM, JPEG, …): {reason}") from error


def _check_picture(path: Path, image: Image.Image) -> None:
    width, height = image.size
    if width * height > MAX_PIXELS:
        raise InputError(f"{path}: {width} by {height} pixels: must have at most {MAX_PIXELS}")
    if image.mode not in _EIGHT_BIT:
        raise InputError(
            f"{path}: pixels are of mode {image.mode}: must be black and white, grey or colour, 8 bit"
        )


def _may_be_transparent(image: Image.Image) -> bool:
    return image.mode in ("LA", "PA", "RGBA") or "transparency" in image.info


def _ros_entry(path: Path) -> Entry:
    """Read the keys of map_server in a ROS map. Warns of others."""
    content = read_yaml(path)
    if isinstance(content, dict):
        foreign = [key for key in content if key not in (*_ROS_KEYS, "mode")]
        content = {key: value for key, value in content.items() if key not in foreign}
        if foreign:
            names = ", ".join(f"{key!s:.40}" for key in foreign[:8])
            warnings.warn(f"{path}: ignoring keys that map_server does not have: {names}", stacklevel=2)
    return Entry(str(path), content, _ROS_KEYS, ["mode"])


def _floor_plan(path: Path, occupied: Bools, pixel: Floats, origin: Pose) -> FloorPlan:
    """The plan of a grid of cells of size `pixel` (2,) [m], with its lower left corner at `origin`."""
    count = corners(occupied)
    if count > MAX_CORNERS:
        raise InputError(
            f"{path}: its obstacles have {count} corners: must have at most {MAX_CORNERS}; is it a photo, or noise?"
        )
    rows, columns = occupied.shape
    frame = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], dtype=np.float64)
    cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)

    def placed(cells: Floats) -> Floats:
        return np.asarray((cells * pixel) @ np.array([[cos, sin], [-sin, cos]]) + np.array(origin[:2]))

    polygons = tuple(placed(outline) for outline in outlines(occupied))
    return enclosed(placed(frame), np.empty((0, 3)), np.empty((0, 4)), polygons)
