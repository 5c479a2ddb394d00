"""The picture of features: what its colours stand for, and that it can be read."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.text import Text

from lme.config.presets import load_settings
from lme.errors import InputError
from runners.cli.main import main
from runners.records.launch_record import read_launch
from runners.reports.figures.driven_runs import DrivenRun, read_runs
from runners.reports.figures.features import chosen_criteria, clipped_range, features_figure
from runners.reports.figures.robot_view import upwards
from tests.runners.reports.figures.conftest import shot_of, with_criteria


def panels(figure):
    """Panels by title; bars have none."""
    return {axes.get_title(): axes for axes in figure.axes if axes.get_title()}


def coloured(axes, shot):
    """(N,) what the colours of the candidates stand for, in the order of the candidates, and their ends."""
    places = {tuple(place): row for row, place in enumerate(upwards(shot.why.candidates))}
    values = np.full(len(shot.why.candidates), np.nan)
    ends = set()
    for points in axes.collections:
        if isinstance(points, PathCollection) and points.get_array() is not None:
            rows = [places[tuple(place)] for place in points.get_offsets()]
            values[rows] = points.get_array()
            ends.add(points.get_clim())
    (end,) = ends
    return values, end


def test_a_panel_for_each_criterion_and_the_score_at_the_end(shot):
    titles = list(panels(features_figure(shot, load_settings("figure/features"))))
    assert len(titles) == 7
    assert [title.split("$")[1] for title in titles] == [
        r"a_{\mathrm{close}}",
        r"a_{\mathrm{dev}}",
        r"c_{\mathrm{o}}",
        r"c_{\mathrm{t}}",
        r"a_{\mathrm{mount}}",
        r"c_{\mathrm{h}}",
        "S",
    ]
    assert titles[4] == r"$a_{\mathrm{mount}}$ [m] ($w_5$ = 88.7)"


def test_only_the_criteria_asked_for_in_their_order_and_the_score_last(shot):
    assert chosen_criteria(shot.why, ["S", "a_mount", "c_o"]) == ["a_mount", "c_o"]
    titles = list(
        panels(features_figure(shot, load_settings("figure/features", criteria=["a_mount", "c_o"])))
    )
    assert ["mount" in title for title in titles] == [True, False, False]
    assert titles[-1].startswith("$S$")


def test_colours_are_the_values_clipped_at_the_percentiles(shot):
    *_, axes = panels(features_figure(shot, load_settings("figure/features", percentiles=[10, 80]))).values()
    values, ends = coloured(axes, shot)
    np.testing.assert_array_equal(values, shot.why.scores)
    assert ends == pytest.approx(np.percentile(shot.why.scores, [10, 80]))


def test_colours_reach_to_the_extremes_where_the_percentiles_are_one_value():
    assert clipped_range(np.array([-3.0] + [0.0] * 99), [5, 95]) == (-3.0, 0.0)


@pytest.mark.parametrize(("percentiles", "extended"), [([0, 100], 0), ([0, 90], 1), ([5, 95], 2)])
def test_arrows_on_a_bar_tell_that_values_are_clipped(shot, percentiles, extended):
    figure = features_figure(shot, load_settings("figure/features", criteria=[], percentiles=percentiles))
    *_, bar = figure.axes
    assert (
        len(bar.child_axes) + len([patch for patch in bar.patches if patch.get_path().vertices.size])
        == extended
    )


def test_two_values_get_two_names_with_how_many_there_are(shot):
    figure = features_figure(shot, load_settings("figure/features", criteria=["c_t"]))
    written = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    free = int(shot.why.features[shot.why.names.index("c_t")].sum())
    count = len(shot.why.candidates)
    assert 0 < free < count
    assert f"1: target free ({free})" in written
    assert f"0: target blocked ({count - free})" in written


def test_weighted_terms_add_up_to_the_score(shot):
    # Two values are drawn as no and yes, so they count with the weight that the key gives the yes.
    drawn = panels(features_figure(shot, load_settings("figure/features", values="weighted")))
    *terms, score = (coloured(axes, shot)[0] for axes in drawn.values())
    factors = [
        weight if name.startswith("c_") else 1.0
        for name, weight in zip(shot.why.names, shot.why.parameters.weights, strict=True)
    ]
    np.testing.assert_allclose(
        sum(f * term for f, term in zip(factors, terms, strict=True)), score, rtol=1e-12
    )


def test_a_criterion_of_ones_own_has_its_panel_and_a_constant_one_says_so(shot):
    more = with_criteria(shot, my_c=np.full(len(shot.why.candidates), -2.5))
    figure = features_figure(more, load_settings("figure/features", criteria=["my_c"]))
    assert next(iter(panels(figure))) == "my_c ($w$ = 1)"
    assert any("-2.5 for all candidates" in text.get_text() for text in figure.texts)


@pytest.mark.parametrize("count", [1, 3, 4, 6, 7, 8])
def test_nothing_overlaps_or_leaves_the_page_and_all_can_be_read(shot, count):
    values = np.linspace(-1234.5, 1234.5, len(shot.why.candidates))
    more = with_criteria(shot, clearance=values)
    figure = features_figure(
        more, load_settings("figure/features", criteria=list(more.why.names[: count - 1]))
    )
    figure.draw_without_rendering()
    assert figure.get_figwidth() == 7
    assert figure.get_figheight() < 9.5
    for first, second in combinations(_boxes(figure), 2):
        assert not first.overlaps(second), (first, second)
    page = figure.bbox
    assert all(
        page.x0 <= b.x0 and b.x1 <= page.x1 and page.y0 <= b.y0 and b.y1 <= page.y1 for b in _boxes(figure)
    )
    assert min(text.get_fontsize() for text in figure.findobj(Text) if text.get_text()) >= 7


def _boxes(figure):
    """Extents [px] of panels, titles, ticks of bars, legends and lines of text."""
    titled = list(panels(figure).values())
    bars = [axes for axes in figure.axes if axes not in titled]
    return [
        *(axes.get_window_extent() for axes in titled),
        *(axes.title.get_window_extent() for axes in titled),
        *(axes.get_tightbbox() for axes in bars),
        *(legend.get_window_extent() for legend in figure.legends),
        *(text.get_window_extent() for text in figure.texts),
    ]


def test_a_decision_without_a_sector_in_the_way_can_be_drawn(trace):
    shot = shot_of(trace, 0)
    open_view = shot.why.view._replace(blockage=None)
    figure = features_figure(
        shot._replace(why=shot.why._replace(view=open_view)), load_settings("figure/features")
    )
    assert any("No sector blocks" in text.get_text() for text in figure.texts)
    written = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert "old subgoal, given up" not in written  # the first decision has none
    assert "blocking sector" not in written


def test_the_command_draws_a_step_of_a_run(lme_run, tmp_path, capsys):
    words = [
        "features",
        f"run={lme_run}",
        "world=11",
        "figure.step=7",
        "formats=[png]",
        f"hydra.run.dir={tmp_path}",
    ]
    assert main(["figure", *words]) == 0
    assert [path.name for path in tmp_path.glob("features*")] == ["features.png"]
    assert str(tmp_path / "features.png") in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["figure.step=20"],
        ["figure.criteria=[c_mount]"],
        ["figure.percentiles=[95,5]"],
        ["figure.values=sum"],
        ["figure.step=-1"],
    ],
    ids=" ".join,
)
def test_mistakes_say_what_would_be_right(lme_run, tmp_path, capsys, words, says):
    assert main(["figure", "features", f"run={lme_run}", f"hydra.run.dir={tmp_path}", *words]) == 2
    says(capsys.readouterr().err)


@pytest.fixture
def features():
    from runners.reports.figures.features import Features

    return Features(load_settings("figure/features", criteria=[]))


def test_a_run_without_lme_cannot_be_drawn(target_run, features, tmp_path, says):
    with says.raises(InputError, match=r"guide.*lme\.guides\.target\.Target"):
        features.draw(read_runs([target_run]), [], tmp_path / "features", ["png"])


def test_of_several_jobs_those_that_lme_guides_are_drawn_numbered(lme_run, target_run, features, tmp_path):
    (lme,), (bare,) = read_runs([lme_run]), read_runs([target_run])
    again = DrivenRun(lme.run_dir, read_launch(lme.run_dir), lme.frame)
    paths = features.draw([bare, lme, again], [], tmp_path / "features", ["png"])
    assert [path.name for path in paths] == ["features_1.png", "features_2.png"]
    assert paths[0].read_bytes() == paths[1].read_bytes()
