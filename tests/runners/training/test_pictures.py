"""The pictures of a race and of its parameters: whole, the same every time, and of every shape of search."""

import pytest
from matplotlib.image import imread

from runners.config.space import Range
from runners.reports.figures.style import save
from runners.training.pictures import one_drawn_in, parameters_figure, race_figure
from runners.training.race import START, Race, Rung
from tests.made_training import RACE, SPACE, TRIALS

RACED = frozenset(RACE.rungs[1].values)


def test_the_same_race_gives_the_same_bytes(tmp_path):
    paths = [tmp_path / "one.png", tmp_path / "two.png"]
    for path in paths:
        save(race_figure(RACE, "published"), path.with_suffix(""))
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert imread(paths[0]).std() > 0.05


def test_a_race_looks_different_with_another_winner(tmp_path):
    last = RACE.rungs[-1]
    other = Race((*RACE.rungs[:-1], Rung(last.places, {START: 0.65, 3: 0.6}, frozenset())), {})
    save(race_figure(RACE, "published"), tmp_path / "one")
    save(race_figure(other, "published"), tmp_path / "two")
    assert (tmp_path / "one.png").read_bytes() != (tmp_path / "two.png").read_bytes()


def test_a_start_may_have_any_name(tmp_path):
    save(race_figure(RACE, r"$\frac{a}$_{"), tmp_path / "race")
    assert (tmp_path / "race.png").is_file()


@pytest.mark.parametrize("keys", [1, 2])
@pytest.mark.parametrize("raced", [RACED, frozenset()], ids=["race", "no race"])
def test_parameters_are_drawn_for_any_number_of_keys(tmp_path, keys, raced):
    space = dict(list(SPACE.items())[:keys])
    save(parameters_figure(TRIALS, space, 3, {"guide.parameters.c_o": 0.0}, raced), tmp_path / "parameters")
    assert imread(tmp_path / "parameters.png").std() > 0.05


def test_nine_parameters_need_three_rows(tmp_path):
    space = {f"planner.key{number}": Range(0.0, 9.0) for number in range(9)}
    trials = [trial._replace(values=dict.fromkeys(space, float(trial.number))) for trial in TRIALS]
    save(parameters_figure(trials, space, 3, {}, RACED), tmp_path / "nine")
    save(parameters_figure(TRIALS, SPACE, 3, {}, RACED), tmp_path / "two")
    assert imread(tmp_path / "nine.png").shape[0] > 2 * imread(tmp_path / "two.png").shape[0]


def points(figure):
    """The numbers of the points in the panel of the first parameter, by their label."""
    return {line.get_label(): len(line.get_xdata()) for line in figure.axes[0].lines}


def test_of_very_many_trials_a_sample_is_drawn_with_those_that_matter():
    rewards = [0.5 - 1.0 / (1 + number) if number % 700 == 13 else -1.0 for number in range(5000)]
    trials = [
        TRIALS[0]._replace(number=number, reward=reward, values=dict.fromkeys(SPACE, 2.0))
        for number, reward in enumerate(rewards)
    ]
    figure = parameters_figure(trials, SPACE, 4913, {}, frozenset({1, 4}))
    assert one_drawn_in(5000) == 3
    drawn = points(figure)
    assert drawn["raced"] == 2
    # Every third, and of the eight trials that were the best so far those that are not among them.
    assert drawn["trial"] == 1667 + sum(number % 3 > 0 for number in range(13, 5000, 700))


def test_of_very_many_candidates_all_that_raced_are_drawn():
    numbers = {number: -0.001 * number for number in range(5000)}
    search = Rung(RACE.rungs[0].places, {START: 0.1, **numbers}, frozenset())
    rung = Rung(RACE.rungs[1].places, {START: 0.1, 1: 0.0, 4: -0.1}, frozenset())
    figure = race_figure(Race((search, rung), {}), "published")
    lines = [line for line in figure.axes[0].lines if len(line.get_xdata()) == 2]
    assert len(lines) == 3
    assert len(figure.axes[0].lines) < 2 * 1700
    assert "5001 candidates" in figure.axes[0].get_title()
