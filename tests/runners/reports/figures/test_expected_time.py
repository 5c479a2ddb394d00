"""The picture of LME+'s expected times: the field it decided on, whose points are whose, and what is reachable."""

import math

import numpy as np
import pytest
from matplotlib.collections import PathCollection, QuadMesh

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.guides.lme.maintenance import Choice
from lme.guides.lme_plus.travel import BEYOND
from lme.guides.lme_plus.travel_grid import cost_to_go_at
from runners.cli.main import main
from runners.reports.figures.driven_runs import read_runs
from runners.reports.figures.expected_time import ExpectedTime, expected_time_figure, sights, telling_step
from runners.reports.figures.style import BLUE, VERMILION
from tests.runners.reports.figures.conftest import shot_of
from tests.tolerances import KERNEL

STEP = 12


@pytest.fixture(scope="module")
def plus_trace(plus_run):
    (job,) = read_runs([plus_run])
    return job.trace(11, 0)


@pytest.fixture(scope="module")
def seen(plus_trace):
    return sights(plus_trace, len(plus_trace.steps) - 1)


@pytest.fixture(scope="module")
def figure(plus_trace):
    return expected_time_figure(shot_of(plus_trace, STEP))


def test_the_field_is_the_one_that_was_decided_on(plus_trace, seen):
    for step, sight in zip(plus_trace.steps, seen, strict=True):
        why, row = step.explanation, step.explanation.names.index("a_rest")
        field = sight.field
        ends = field.robot_time, BEYOND, field.here, field.target, field.v_max
        again = -cost_to_go_at(field.times, why.candidates, (*sight.pose,), (*field.grid,), *ends)
        assert again == pytest.approx(why.features[row], abs=KERNEL)


def test_every_point_is_of_the_scan_or_remembered(figure, plus_trace, seen):
    drawn = {line.get_color(): line.get_xydata() for line in figure.axes[0].lines if line.get_marker() == "o"}
    scan, known = plus_trace.steps[STEP].explanation.view.points, seen[STEP].points
    assert len(drawn[VERMILION]) == len(scan)
    assert 0 < len(drawn[BLUE]) < len(known)
    page = np.column_stack((-known[:, 1], known[:, 0]))
    for point in page:
        nearest = min(np.hypot(*(points - point).T).min() for points in drawn.values())
        assert nearest == pytest.approx(0.0, abs=1e-6)


def test_reachable_candidates_are_filled_and_coloured_by_score(figure, plus_trace):
    why = plus_trace.steps[STEP].explanation
    rings, filled = (each for each in figure.axes[0].collections if type(each) is PathCollection)
    reachable = why.features[why.names.index("c_o")] > 0
    assert 0 < reachable.sum() < len(reachable)
    assert len(rings.get_offsets()) == (~reachable).sum()
    assert np.asarray(filled.get_array()) == pytest.approx(why.scores[reachable] - why.scores.max())


def test_colours_end_at_the_times_in_view(figure, seen):
    (mesh,) = (each for each in figure.axes[0].collections if isinstance(each, QuadMesh))
    low, high = mesh.get_clim()
    times = seen[STEP].field.times
    assert 0.0 <= low < high <= times[np.isfinite(times)].max()
    assert low < seen[STEP].field.robot_time <= high + KERNEL


def test_the_telling_step_is_the_switch_with_the_longest_detour(plus_trace, seen):
    def detour(step):
        field = seen[step].field
        return field.robot_time - math.dist(field.here, field.target) / field.v_max

    assert telling_step(plus_trace) == max(range(len(seen)), key=detour)  # it never switched
    better = (2, 9, STEP)
    assert telling_step(_switched(plus_trace, *better)) == max(better, key=detour)


def _switched(trace, *better):
    """The same with a better subgoal at these steps."""
    steps = list(trace.steps)
    for step in better:
        why = steps[step].explanation
        decision = why.decision._replace(choice=Choice.BETTER)
        steps[step] = steps[step]._replace(explanation=why._replace(decision=decision))
    return trace._replace(steps=tuple(steps))


def test_the_command_draws_it(plus_run, tmp_path):
    words = ["expected_time", f"run={plus_run}", f"hydra.run.dir={tmp_path}", "formats=[png]"]
    assert main(["figure", *words]) == 0
    assert (tmp_path / "expected_time.png").read_bytes().startswith(b"\x89PNG")


def test_mistakes_are_named(lme_run, tmp_path, says):
    kind = ExpectedTime(load_settings("figure/method"))
    with says.raises(InputError):
        kind.draw(read_runs([lme_run]), [], tmp_path / "expected_time", ["png"])
    with pytest.raises(InputError, match=r"figure\.step is -1"):
        load_settings("figure/method", step=-1)
