"""Ranges of worlds: written out in the config, wherever a map set has `worlds`."""

import pytest

from lme.errors import InputError
from runners.config.build import map_set
from runners.config.catalogue import shipped
from runners.config.map_sets import parse_worlds
from runners.records.launch_record import fingerprint, identity
from tests.composing import jobs_of


@pytest.mark.parametrize(
    ("given", "numbers"),
    [
        ("0-3", [0, 1, 2, 3]),
        ("7", [7]),
        ("4-4", [4]),
        (7, [7]),
        (["8-9", 3, "5"], [8, 9, 3, 5]),
        ([3, 1], [3, 1]),
        ([], []),
        (None, None),
        (0.5, 0.5),
        (True, True),
    ],
)
def test_ranges_are_written_out(given, numbers):
    assert parse_worlds(given, "map.worlds") == numbers


@pytest.mark.parametrize("given", ["3-1", "a", "1-", "-1-4", ["0-4", 2], ["0-4", "x"], "0-1000000", ""])
def test_invalid_ranges_of_worlds_are_refused(given):
    with pytest.raises(InputError, match=r"^held_out\.env1\.worlds (has|is) "):
        parse_worlds(given, "held_out.env1.worlds")


def test_a_range_is_the_same_config_as_its_numbers():
    with jobs_of("eval") as job:
        configs = [
            identity(job(f"map.worlds={words}").config) for words in ("0-4", "[0,1,2,3,4]", "[0-2,3,4]")
        ]
    assert configs[0]["map"]["worlds"] == [0, 1, 2, 3, 4]
    assert len({fingerprint([config], False) for config in configs}) == 1


@pytest.mark.parametrize(
    "name", sorted(set(shipped().options("map")) - {"building", "empty", "file", "tracks"})
)
def test_every_map_set_takes_a_range(name):
    with jobs_of("eval", f"map={name}", "map.worlds=1-2") as job:
        assert map_set(job().config).numbers == (1, 2)


def test_a_range_beyond_the_set(says):
    with jobs_of("eval", "map.worlds=298-301") as job, pytest.raises(InputError) as caught:
        map_set(job().config)
    says(caught.value)


def test_a_range_in_files_of_the_users_own(tmp_path):
    (tmp_path / "map").mkdir()
    (tmp_path / "map" / "few.yaml").write_text(
        "# A few\ndefaults:\n  - barn\n  - _self_\n\nworlds: [0-2, 9]\n"
    )
    with jobs_of("eval", "map=few", config_dir=tmp_path) as job:
        assert job().config.map["worlds"] == [0, 1, 2, 9]
    with jobs_of("train", "experiment=table1", "held_out.env1.worlds=0-2") as job:
        assert job().config.held_out["env1"]["worlds"] == [0, 1, 2]
