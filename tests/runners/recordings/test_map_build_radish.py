"""The ten buildings: only the published logs count, and the maps are those of the reference."""

import hashlib

import numpy as np
import pytest
import yaml
from PIL import Image

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.worlds.building import Buildings
from runners.recordings import map_build
from runners.recordings.map_build import DIGESTS, build_all
from tests.made_logs import flaser_lines, write
from tests.places import SHARED

REFERENCE = SHARED / "maps" / "buildings"


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout with logs of our own for two of the buildings, whose digests are the known ones."""
    folder = tmp_path / "ple" / "data" / "carmen"
    logs = {name: write(folder / f"{name}-corrected.log.gz", flaser_lines()) for name in ("intel", "seattle")}
    write(folder / "infinite-corridor-corrected.log.gz", ["not read"])
    digests = {name: hashlib.sha256(log.read_bytes()).hexdigest() for name, log in logs.items()}
    monkeypatch.setattr(map_build, "DIGESTS", {**DIGESTS, **digests})
    return tmp_path / "ple"


def test_the_maps_of_a_checkout_are_built_and_driven(checkout, tmp_path, capsys):
    build_all(checkout, tmp_path / "maps", overwrite=False)
    assert sorted(path.name for path in (tmp_path / "maps").glob("*.yaml")) == ["intel.yaml", "seattle.yaml"]
    out = capsys.readouterr().out
    assert "left out, without a log: acapulco, aces, belgioioso, csail, edmonton, freiburg-079" in out
    config = load_settings(
        "map/building", paths=[str(tmp_path / "maps")], configurations=2, min_distance=3.0, radius=0.25
    )
    maps = Buildings(config)
    assert [maps.task(n).measures["building"] for n in maps.numbers] == [0.0, 0.0, 1.0, 1.0]


def test_the_folder_of_the_logs_will_do(checkout, tmp_path):
    build_all(checkout / "data" / "carmen", tmp_path / "maps", overwrite=False)
    assert (tmp_path / "maps" / "seattle.yaml").is_file()


def test_another_log_is_refused_before_any_map_is_built(checkout, tmp_path):
    write(checkout / "data" / "carmen" / "seattle-corrected.log.gz", flaser_lines()[:-1])
    with pytest.raises(InputError, match=r"seattle-corrected.log.gz: its SHA-256 is \w{64}: must be \w{64}"):
        build_all(checkout, tmp_path / "maps", overwrite=False)
    assert not (tmp_path / "maps").exists()


def test_maps_are_not_replaced_by_mistake(checkout, tmp_path):
    build_all(checkout, tmp_path / "maps", overwrite=False)
    with pytest.raises(InputError, match="exists; add --overwrite"):
        build_all(checkout, tmp_path / "maps", overwrite=False)
    build_all(checkout, tmp_path / "maps", overwrite=True)


def test_a_folder_without_logs_is_one_line(tmp_path, says):
    with says.raises(InputError):
        build_all(tmp_path, tmp_path / "maps", overwrite=False)
    with pytest.raises(InputError, match="no such folder"):
        build_all(tmp_path / "none", tmp_path / "maps", overwrite=False)


def free_cells(path):
    about = yaml.safe_load(path.read_text())
    cells = np.array(Image.open(path.parent / about["image"]))[::-1]
    return cells > 250, np.array(about["origin"][:2]), about["resolution"]


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="the shared maps are not here")
def test_the_maps_agree_with_the_reference(tmp_path):
    """The same cells are free in 95 % and more, and in 97 % of those that are not on a border of the reference."""
    from scipy import ndimage

    build_all(REFERENCE / "logs", tmp_path, overwrite=False)
    for name in ("freiburg-079", "intel", "seattle"):
        reference, corner, side = free_cells(REFERENCE / f"{name}.yaml")
        built, own_corner, _ = free_cells(tmp_path / f"{name}.yaml")
        rows, columns = np.indices(reference.shape)
        places = corner + (np.stack((columns, rows), axis=-1) + 0.5) * side
        column, row = np.moveaxis(np.floor((places - own_corner) / side).astype(int), -1, 0)
        there = (column >= 0) & (row >= 0) & (column < built.shape[1]) & (row < built.shape[0])
        same = np.zeros_like(reference)
        same[there] = built[row[there], column[there]]
        around = np.ones((3, 3), bool)
        border = ndimage.binary_dilation(reference, around) & ~ndimage.binary_erosion(reference, around)
        assert (same == reference).mean() > 0.95, name
        assert (same == reference)[~border].mean() > 0.97, name
