"""The picture of the method: three panels that say what is true, and can be read."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.text import Text

from lme.geometry.frames import to_world
from lme.guides.lme.maintenance import Choice
from lme.types import Pose
from runners.cli.main import main
from runners.reports.figures import robot_view as view
from runners.reports.figures.driven_runs import telling_step
from runners.reports.figures.method import _free_side, _letters, method_figure
from tests.runners.reports.figures.conftest import shot_of


def captions(figure):
    return {
        text.get_text()[1]: " ".join(text.get_text().split())
        for text in figure.texts
        if text.get_text()[0] == "("
    }


def test_the_captions_say_what_is_shown(shot, says):
    why = shot.why
    written = captions(method_figure(shot))
    assert list(written) == ["a", "b", "c"]
    assert f"{len(why.candidates)} candidates (blue) within 5 m" in written["a"]
    assert "scan points (orange)" in written["a"]
    assert f"{len(why.sectors)} sectors in all" in written["b"]
    assert ("so A is E₁" in written["b"]) == np.array_equal(why.view.blockage.A, why.view.blockage.E1)
    led_back = int((why.features[why.names.index("c_h")] == 0).sum())
    assert led_back > 0
    says(written["c"])


def test_the_angles_are_those_of_the_ends_to_the_target(shot):
    blockage, target = shot.why.view.blockage, shot.why.view.target
    turn = [
        np.degrees(np.arccos(end @ target / np.linalg.norm(end) / np.linalg.norm(target)))
        for end in (blockage.E1, blockage.E2)
    ]
    text = captions(method_figure(shot))["b"]
    assert f"∠E₁OT = {turn[0]:.0f}°, ∠E₂OT = {turn[1]:.0f}°" in text


@pytest.mark.parametrize("step", [0, 7, 13])
def test_the_letter_of_the_robot_is_next_to_it(trace, step):
    figure = method_figure(shot_of(trace, step))
    figure.draw_without_rendering()
    (letter,) = [text for text in figure.findobj(Text) if text.get_text() == "$O$"]
    origin = letter.axes.transData.transform((0.0, 0.0))
    radius = letter.axes.transData.transform((trace.robot.footprint.circumscribed_radius, 0.0))[0] - origin[0]
    box = letter.get_window_extent()
    away = np.maximum(0.0, np.maximum(np.array(box.min) - origin, origin - np.array(box.max)))
    assert 0.5 * radius < np.hypot(*away) < radius + 10 * figure.dpi / 72


@pytest.mark.parametrize(
    ("points", "side"),
    [
        ([(1.0, 0.0)], (0.0, -1.0)),  # ahead is up on the page
        ([(1.0, 0.0), (0.0, 1.0)], (np.sqrt(0.5), -np.sqrt(0.5))),
        ([(1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)], (-1.0, 0.0)),
    ],
)
def test_a_name_stands_in_the_widest_gap(points, side):
    assert _free_side([np.array(point) for point in points]) == pytest.approx(side)


@pytest.mark.parametrize("bearing", [-0.3, 0.3])
def test_the_name_of_b_keeps_away_from_the_target(shot, bearing):
    blockage = shot.why.view.blockage
    target = to_world(blockage.B, Pose(0.0, 0.0, bearing))
    (own,), (usual,) = (names[-1:] for names in (_letters(blockage, target), view.letters(blockage)))
    to_target = view.upwards(target - blockage.B)
    assert own.text == usual.text == "$B$"
    assert own.away @ to_target < usual.away @ to_target


def test_a_decision_without_history_or_sector_in_the_way_says_so(trace, says):
    shot = shot_of(trace, 0)
    bare = shot.why.view._replace(blockage=None)
    written = captions(method_figure(shot._replace(why=shot.why._replace(view=bare))))
    says(written["b"])
    says(written["c"])


@pytest.mark.parametrize("step", [0, 7, 13])
def test_nothing_overlaps_or_leaves_the_page_and_all_can_be_read(trace, step):
    figure = method_figure(shot_of(trace, step))
    figure.draw_without_rendering()
    boxes = [
        *(axes.get_window_extent() for axes in figure.axes),
        *(text.get_window_extent() for text in figure.texts),
    ]
    assert len(figure.axes) == 3
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    page = figure.bbox
    assert all(page.x0 <= b.x0 and b.x1 <= page.x1 and page.y0 <= b.y0 and b.y1 <= page.y1 for b in boxes)
    letters = [text for text in figure.findobj(Text) if text.get_text()]
    assert min(text.get_fontsize() for text in letters) >= 7


def test_the_telling_step_is_a_switch_around_an_obstacle(trace):
    step = telling_step(trace)
    why = trace.steps[step].explanation
    assert why.decision.choice is Choice.BETTER
    assert why.view.blockage is not None
    gain = why.features[:, why.new] - why.old_features
    assert gain[why.names.index("c_t")] > 0
    assert gain[why.names.index("a_mount")] > 0


def test_the_first_of_equally_telling_steps_is_taken(trace):
    step = telling_step(trace)
    twice = trace._replace(steps=(*trace.steps[: step + 1], *trace.steps))
    assert telling_step(twice) == step
    assert telling_step(trace._replace(steps=trace.steps[step:])) == 0


def test_the_command_draws_the_telling_step(lme_run, tmp_path):
    words = ["method", f"run={lme_run}", "formats=[pdf]", f"hydra.run.dir={tmp_path}"]
    assert main(["figure", *words]) == 0
    assert (tmp_path / "method.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("lacking", ["c_t", "a_mount", "history", "blockage", "choice"])
def test_a_step_that_lacks_a_sign_is_less_telling(shot, lacking):
    why = shot.why
    if lacking in why.names:
        row = why.names.index(lacking)
        even = why.old_features.copy()
        even[row] = why.features[row, why.new]
        poorer = why._replace(old_features=even)
    elif lacking == "choice":
        poorer = why._replace(decision=why.decision._replace(choice=Choice.KEPT))
    else:
        nothing = np.empty((0, 2)) if lacking == "history" else None
        poorer = why._replace(view=why.view._replace(**{lacking: nothing}))
    step = shot.trace.steps[shot.step]
    assert telling_step(shot.trace._replace(steps=(step._replace(explanation=poorer), step))) == 1
