"""Numbers that records cannot hold are refused before anything is driven."""

from types import SimpleNamespace

import pytest

from lme.errors import InputError
from runners.config.build import check_episodes
from runners.config.command_line import compose


def config_of(*words):
    (job,) = compose("eval", [*words])
    return job.config


@pytest.mark.parametrize(
    "words", [["seed=9223372036854775808"], ["map.subset=fresh", "map.worlds=[2147483648]"]], ids=" ".join
)
def test_too_large_numbers_of_a_command_line_are_refused(words, says):
    with says.raises(InputError):
        check_episodes(config_of(*words))


def test_the_largest_numbers_are_not():
    check_episodes(config_of("seed=9223372036854775807", "map.subset=fresh", "map.worlds=[2147483647]"))


@pytest.mark.parametrize("numbers", [(-1, 0), (0, 0), (0.5,), ("a",), ()], ids=str)
def test_numbers_of_an_own_map_set_are_checked(numbers, says):
    with says.raises(InputError):
        check_episodes(config_of(), maps=SimpleNamespace(numbers=numbers))
