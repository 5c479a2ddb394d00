"""Import of published BARN worlds: check them, compare them with the regenerated ones, copy them."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lme.errors import InputError
from lme.worlds.barn.files import find_worlds, path_file
from lme.worlds.barn.generator import official_recipes
from lme.worlds.barn.layouts import official_layout, published_layout


@dataclass(frozen=True, slots=True)
class ImportedWorld:
    """Comparison of an imported world with the regenerated one of the same number."""

    number: int
    cylinders: str  # "equal" | "different" | "not official"
    path: str  # "equal" | "different" | "missing" | "not official"


def import_worlds(source: Path, destination: Path) -> list[ImportedWorld]:
    """Check every world in `source`, compare it with the regenerated one, and copy worlds and paths.

    The copy in `destination` is complete or absent, and can serve as `map.source`. Raises InputError for a
    broken file, or for a destination that is not empty or cannot be written.
    """
    files = find_worlds(source)
    if destination.exists() and not (destination.is_dir() and not any(destination.iterdir())):
        raise InputError(
            f"{destination} already exists: must be a new or empty folder; nothing is overwritten"
        )
    report = [_compare(number, file) for number, file in files.items()]
    try:
        _copy_whole(list(files.values()), destination)
    except OSError as error:
        raise InputError(f"{destination} cannot be written: {error.strerror or error}") from None
    return report


def _compare(number: int, file: Path) -> ImportedWorld:
    published = published_layout(number, file)
    has_path = path_file(file).exists()
    if number not in official_recipes():
        return ImportedWorld(number, "not official", "not official" if has_path else "missing")
    same_path = np.array_equal(published.path, official_layout(number).path)
    return ImportedWorld(
        number,
        "different" if published.recipe is None else "equal",
        ("equal" if same_path else "different") if has_path else "missing",
    )


def _copy_whole(files: list[Path], destination: Path) -> None:
    """Fill a hidden folder next to the destination, then rename it."""
    destination.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=destination.parent, prefix=f".{destination.name}-") as hidden:
        filled = Path(hidden) / "worlds"
        (filled / "path_files").mkdir(parents=True)
        for file in files:
            shutil.copyfile(file, filled / file.name)
            if path_file(file).exists():
                shutil.copyfile(path_file(file), filled / "path_files" / path_file(file).name)
        if destination.exists():
            destination.rmdir()
        filled.rename(destination)
