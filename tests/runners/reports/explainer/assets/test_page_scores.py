"""The page weighs what Python weighed, and comes to the same: scores, candidates, choices, at every step."""

import math

import numpy as np
import pytest

from lme.guides.lme.maintenance import Choice, choose
from lme.guides.lme.score import Parameters, score
from lme.guides.lme_plus.reasons import expected_time
from runners.reports.explainer.features import QUANTUM
from runners.reports.explainer.write import write_page
from tests.builders import PUBLISHED
from tests.runners.reports.explainer.conftest import settle, traced

RELATIVE = 1e-6
SETTINGS = {
    "published": PUBLISHED,
    "no_maintenance": {**PUBLISHED, "d1": math.inf},
    "never_better": {**PUBLISHED, "d1": 0.0, "d2": math.inf},
    "near_only": {**dict.fromkeys(PUBLISHED, 0.0), "a_close": 1.0},
    "ties": {**dict.fromkeys(PUBLISHED, 0.0), "c_o": 1.0},
    "nothing": dict.fromkeys(PUBLISHED, 0.0),
    **{
        f"random_{seed}": dict(
            zip(
                PUBLISHED,
                np.random.default_rng(seed).uniform(0.01, [9, 9, 999, 999, 999, 999, 1, 200]).tolist(),
                strict=True,
            )
        )
        for seed in range(3)
    },
}


def decided(why, parameters):
    """Algorithm 1 in the situation of an explanation, with other parameters: scores, best, choice."""
    scores = score(why.features, parameters.weights)
    best = int(np.argmax(scores))
    if why.old is None:
        return scores, best, Choice.FIRST
    old = float(parameters.weights @ why.old_features)
    choice = choose(math.hypot(*why.old), old, scores[best], parameters.d1, parameters.d2)
    return scores, best, choice


def in_page(page, values):
    """The same of the page, at every step."""
    words = {name: "inf" if value == math.inf else value for name, value in values.items()}
    return page.evaluate(
        """(words) => {
            const { app, trace } = explainer;
            for (const name in words) if (words[name] === "inf") words[name] = Infinity;
            app.panel.set(words);
            const { weights } = app.panel.parameters;
            return app.verdicts.map((verdict, step) => ({ ...verdict, changed: app.changed[step],
                scores: Array.from(explainer.scoresOf(trace, step, weights)) }));
        }""",
        words,
    )


@pytest.mark.parametrize("values", SETTINGS.values(), ids=SETTINGS)
def test_scores_candidates_and_choices_are_pythons_at_every_step(page, trace, values):
    reasons = [step.explanation for step in trace.steps]
    parameters = Parameters.from_mapping(values, reasons[0].names)
    verdicts = in_page(page, values)
    assert len(verdicts) == len(reasons)
    for why, verdict in zip(reasons, verdicts, strict=True):
        scores, best, choice = decided(why, parameters)
        np.testing.assert_allclose(verdict["scores"], scores, rtol=RELATIVE)
        assert (verdict["best"], verdict["choice"]) == (best, str(choice))
        recorded = why.decision.choice is Choice.KEPT
        same = recorded == (choice is Choice.KEPT) and (recorded or best == why.new)
        assert verdict["changed"] is not same


def test_with_the_episodes_own_parameters_nothing_changes(page, trace):
    assert not any(page.evaluate("explainer.app.changed"))
    choices = [str(step.explanation.decision.choice) for step in trace.steps]
    assert page.evaluate("explainer.app.verdicts.map((verdict) => verdict.choice)") == choices
    assert {"first", "reached", "better", "kept"} == set(choices)  # or the episode tests too little


def test_old_scores_are_pythons(page, trace):
    olds = page.evaluate("explainer.app.verdicts.map((verdict) => verdict.oldScore)")
    expected = [step.explanation.old_score for step in trace.steps]
    assert math.isnan(olds[0])
    assert expected[0] is None
    np.testing.assert_allclose(olds[1:], expected[1:], rtol=RELATIVE)


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ("false, NaN, NaN, 5, Infinity, 1", "first"),
        ("true, 0.5, 9, 1, 0.51, 200", "reached"),
        ("true, 0.51, 9, 1, 0.51, 200", "kept"),  # nearer than d1, not as near
        ("true, 1000, 9, 1, Infinity, 200", "reached"),
        ("true, 1, 1, 3, 0, 2", "kept"),  # more than d2, not as much
        ("true, 1, 1, 3.1, 0, 2", "better"),
        ("true, 0, 1, 1e9, 0, Infinity", "kept"),
    ],
)
def test_the_choice_at_its_limits(page, case, expected):
    assert page.evaluate(f"explainer.choose({case})") == expected


def test_moving_a_slider_leads_to_pythons_other_candidate(page, trace):
    values = {**PUBLISHED, "d2": 0.0}
    parameters = Parameters.from_mapping(values, trace.steps[0].explanation.names)
    others = [decided(step.explanation, parameters)[1:] for step in trace.steps]
    step = next(
        i
        for i, ((_, choice), traced) in enumerate(zip(others, trace.steps, strict=True))
        if choice is Choice.BETTER and traced.explanation.decision.choice is Choice.KEPT
    )
    page.evaluate(f"explainer.app.playback.go({step})")
    settle(page)
    before = page.inner_text("#what-if")
    page.focus("#p-d2")
    page.keyboard.press("Home")
    settle(page)
    assert page.input_value("#n-d2") == "0"
    text = page.inner_text("#what-if")
    assert "parameters of the record" in before
    assert f"would choose candidate {others[step][0]} " in text
    count = sum(page.evaluate("explainer.app.changed"))
    assert f"{count} of {len(trace.steps)} decisions" in text
    page.click("#p-d2 ~ .reset")
    settle(page)
    assert page.inner_text("#what-if") == before


def test_the_bars_show_pythons_terms(page, trace):
    step = next(i for i, m in enumerate(trace.steps) if m.explanation.decision.choice is Choice.BETTER)
    why = trace.steps[step].explanation
    page.evaluate(f"explainer.app.playback.go({step})")
    settle(page)
    x, y, index = page.evaluate(
        """() => {
            const { spots, camera } = explainer.app.scene;
            const apart = (one) => Math.min(...spots.filter((other) => other !== one)
                .map((other) => Math.hypot(other[0] - one[0], other[1] - one[1])));
            const inside = ([x, y]) => x > 20 && y > 60 && x < camera.width - 20 && y < camera.height - 20;
            const at = spots.findIndex((spot) => inside(spot) && apart(spot) > 15);
            const box = document.getElementById("scene").getBoundingClientRect();
            return [box.x + spots[at][0], box.y + spots[at][1], at];
        }"""
    )
    page.mouse.move(x + 1, y)
    settle(page)
    weights = why.parameters.weights
    assert page.inner_text("#candidate").startswith(f"Candidate {index}: ")
    for side, features in (
        ("picked", why.features[:, index]),
        ("chosen", why.features[:, why.new]),
        ("old", why.old_features),
    ):
        shown = page.eval_on_selector_all(
            f"#terms tbody td.{side}", "(cells) => cells.map((cell) => Number(cell.dataset.value))"
        )
        np.testing.assert_allclose(shown[:-1], weights * features, rtol=RELATIVE)
        assert shown[-1] == pytest.approx(weights @ features, rel=RELATIVE)


def test_typed_values_count_and_invalid_ones_are_refused(page):
    for text, shown, value in (("inf", "∞", math.inf), ("0,25", "0.25", 0.25)):
        page.fill("#n-d1", text)
        page.press("#n-d1", "Enter")
        assert page.input_value("#n-d1") == shown
        assert page.evaluate("explainer.app.panel.values.d1") == value
    page.fill("#n-a_close", "inf")  # of a weight
    page.press("#n-a_close", "Enter")
    assert page.get_attribute("#n-a_close", "aria-invalid") == "true"
    assert page.evaluate("explainer.app.panel.values.a_close") == PUBLISHED["a_close"]


PLUS = ("system=lme_plus", "map=barn", "robot=jackal", "sim=fast", "map.time_limit=1.5")


def test_the_page_of_lme_plus_decides_as_it_did_and_shows_what_it_has(open_page, tmp_path):
    trace = traced(207, *PLUS, "map.worlds=[207]")
    write_page(trace, tmp_path / "plus.html")
    page = open_page(tmp_path / "plus.html")
    choices = [str(step.explanation.decision.choice) for step in trace.steps]
    assert page.evaluate("explainer.app.verdicts.map((verdict) => verdict.choice)") == choices
    assert not any(page.evaluate("explainer.app.changed"))
    sliders = page.evaluate(
        "Array.from(document.querySelectorAll('#parameters input[type=range]'), (one) => one.id)"
    )
    assert sliders == [f"p-{name}" for name in ("a_reach", "a_dev", "a_rest", "c_o", "d1", "d2")]
    assert not page.is_visible("#key-blocking")
    assert not page.is_visible("#key-history")
    # Its scores are times: the chart and the texts show seconds.
    whys = [step.explanation for step in trace.steps]
    expected = [expected_time(why, why.features[:, why.new]) for why in whys]
    times = page.evaluate("explainer.app.timeline.data[1].slice(0, -1)")
    assert times == pytest.approx(expected, abs=3 * QUANTUM)
    assert page.text_content("#key-best").startswith("expected time")
    assert page.input_value("#colour") == "free"
    assert f"{expected[0]:.1f} s to the target" in page.text_content("#candidate")
    assert page.text_content("#story").startswith("It was still on its way, ")
    assert page.watch.said == []


@pytest.mark.parametrize(
    ("chosen", "shares"), [([-2.0, 0.0, 9.0], [0.5, 1.0, 0.0]), ([-1.0, 0.0, 9.0], [0.1, 0.1, 0.9])]
)
def test_terms_equal_on_all_sides_do_not_set_the_scale_of_the_bars(page, chosen, shares):
    widths = page.evaluate(
        """(chosen) => {
            const { bars } = explainer.app;
            const rest = [0, 0, 0];
            bars.show({ picked: [-1, 0, 9, ...rest], chosen: [...chosen, ...rest], old: null });
            const [first, , third] = bars.rows;
            const all = [first.bars.picked, first.bars.chosen, third.bars.picked];
            const wide = (element) => element.getBoundingClientRect().width;
            return all.map((bar) => wide(bar) / wide(bar.parentElement));
        }""",
        chosen,
    )
    assert widths == pytest.approx(shares, abs=0.05)
