"""The words that the comparison with logs gives to `lme eval`."""

from benchmarks.gazebo import WORDS, with_defaults


def test_given_words_take_the_place_of_the_default_s():
    assert with_defaults(["runs=2", "sim=skid"]) == [*WORDS, "runs=2", "sim=skid"]
    words = with_defaults(["system=lics", "map.subset=lab100"])
    assert words == ["map=barn", "system=lics", "map.subset=lab100"]
