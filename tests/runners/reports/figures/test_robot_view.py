"""What the robot sees, on the page: which way is up, and what can be distinguished."""

import math

import numpy as np
import pytest

from lme.guides.lme.surmount import Blockage
from lme.robots import Footprint
from runners.reports.figures import robot_view as view
from runners.reports.figures.robot_view import key
from runners.reports.figures.scene import Box, outline
from runners.reports.figures.style import new_figure


@pytest.fixture
def axes():
    figure = new_figure(2, 2, layout=None)
    made = figure.add_axes((0, 0, 1, 1))
    made.set(xlim=(-5, 5), ylim=(-5, 5), aspect="equal")
    return made


def test_ahead_is_up_and_left_is_left():
    np.testing.assert_array_equal(view.upwards(np.array([[1.0, 0.0], [0.0, 1.0]])), [[0, 1], [-1, 0]])


@pytest.mark.parametrize("count", range(2, 20))
def test_neighbouring_sectors_differ_all_round(count):
    styles = view.sector_styles(count)
    assert len(styles) == count
    assert all(styles[index][0] != styles[index - 1][0] for index in range(count))


def test_history_darkens_towards_now():
    lightness = view.greens(8).sum(axis=1)
    assert (np.diff(lightness) < 0).all()
    np.testing.assert_array_equal(view.greens(1)[0], view.YOUNG)


def test_a_footprint_keeps_its_size():
    box = outline(Footprint(length=0.42, width=0.31))
    np.testing.assert_allclose([np.ptp(box[:, 0]), np.ptp(box[:, 1])], [0.42, 0.31])
    disc = outline(Footprint(radius=0.2))
    np.testing.assert_allclose(np.hypot(*disc.T), 0.2)


def test_the_page_holds_the_range_and_no_more_behind_than_there_are_candidates():
    around = np.array([[5.0, 0.0], [0.0, 5.0], [-3.0, 0.0]])
    box = view.reach_box(around, 5.0)
    assert -4.0 < box.y0 < -3.0
    assert box.x0 < -5 < 5 < box.y1
    assert view.reach_box(np.array([[-5.0, 0.0], [5.0, 0.0]]), 5.0).y0 == box.x0  # all round


def test_the_contour_is_at_the_radius(axes):
    view.draw_contour(axes, np.array([[1.0, 2.0]]), 0.5, "k")
    (drawn,) = axes.collections
    vertices = np.vstack([path.vertices for path in drawn.get_paths()])
    np.testing.assert_allclose(np.hypot(*(vertices - [-2.0, 1.0]).T), 0.5, atol=0.01)


@pytest.mark.parametrize("target", [[9.0, 3.0], [-2.0, -30.0], [0.0, 7.0]])
def test_a_target_beyond_the_page_is_pointed_at(axes, target):
    view.draw_target(axes, np.array(target))
    (arrow,) = axes.texts
    x, y = arrow.xy
    assert max(abs(x), abs(y)) == pytest.approx(4.9)
    assert math.atan2(y, x) == pytest.approx(math.atan2(*[target[0], -target[1]]))


def test_a_target_on_the_page_is_crossed(axes):
    view.draw_target(axes, np.array([2.0, 1.0]))
    assert not axes.texts
    assert any(
        line.get_marker() == "x" and line.get_xydata().tolist() == [[-1.0, 2.0]] for line in axes.lines
    )


def test_the_nearer_end_is_named_twice_and_names_stand_away_from_the_sector():
    E1, E2 = np.array([2.0, -1.0]), np.array([2.0, 1.5])
    blockage = Blockage(np.array([E1, E2]), E1, E2, E2, E2 * 1.1)
    named = {letter.text: letter for letter in view.letters(blockage)}
    assert list(named) == ["$E_1$", "$A$ = $E_2$", "$B$"]
    assert named["$E_1$"].away @ view.upwards(E2 - E1) < 0  # names stand away from the sector
    assert named["$A$ = $E_2$"].away @ view.upwards(E1 - E2) < 0
    assert [letter.text for letter in view.letters(blockage, brief=True)] == ["$E_1$", "$A$", "$B$"]


def test_names_stay_on_their_panel(axes):
    view.write(axes, view.Letter("$T$", np.array([4.99, 4.99]), np.array([1.0, 0.0])), 20)
    (text,) = axes.texts
    box, page = text.get_window_extent(), axes.bbox
    assert page.x0 <= box.x0
    assert box.x1 <= page.x1
    assert box.y1 <= page.y1


def test_names_hide_no_subgoal(axes):
    name = view.Letter("$E_1$", np.array([1.0, 0.0]), np.array([1.0, 0.0]))
    view.draw_letters(axes, [name], 4.0, written=True)
    place = axes.texts[0].get_window_extent()
    x, y = axes.transData.inverted().transform((place.x0 + place.width / 2, place.y0 + place.height / 2))
    view.draw_letters(axes, [name], 4.0, written=True, clear_of=[np.array([y, -x])])
    assert not axes.texts[1].get_window_extent().overlaps(place)


def test_a_sector_off_the_page_is_not_in_the_key(shot):
    far = shot.why.view.blockage._replace(points=np.array([[60.0, 0.0]]))
    why = shot.why._replace(view=shot.why.view._replace(blockage=far))
    labels = [entry[0] if isinstance(entry, tuple) else entry for entry in key(why, 5.0, Box(-5, -5, 5, 5))]
    assert "blocking sector" not in [entry.get_label() for entry in labels]
