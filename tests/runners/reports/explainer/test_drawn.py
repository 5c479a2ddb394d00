"""What the page draws and computes itself is what was recorded, and everything else is in the file."""

import copy

import numpy as np
import pytest

from lme.guides.lme.criteria import SURMOUNT
from runners.reports.explainer.drawn import QUANTUM
from runners.reports.explainer.encode import encode
from runners.reports.explainer.write import write_page
from runners.workers.trace import rerun
from tests.runners.reports.explainer.test_write import array, unpacked

VALUES = """() => ({
    xs: Array.from(explainer.trace.arrays["candidates.x"]),
    ys: Array.from(explainer.trace.arrays["candidates.y"]),
    features: explainer.trace.features.map((feature) => Array.from(feature)),
})"""


@pytest.mark.parametrize("distribution", ["polar", "area"])
@pytest.mark.parametrize("surmount", SURMOUNT)
def test_the_page_computes_what_was_recorded(trace, open_page, tmp_path, surmount, distribution):
    config = copy.deepcopy(trace.config)
    config.map["time_limit"] = 20.0  # until an obstacle blocks the target
    config.guide["surmount"] = surmount
    config.guide["candidates"]["distribution"] = distribution
    short = rerun(config, 1, 0)
    assert set(unpacked(encode(short, []))[0]["computed"].values()) == {"target", "turn", "shown", "b"}
    write_page(short, tmp_path / "page.html")
    values = open_page(tmp_path / "page.html").evaluate(VALUES)
    reasons = [step.explanation for step in short.steps]
    candidates = np.concatenate([reason.candidates for reason in reasons])
    np.testing.assert_allclose(
        values["features"], np.hstack([r.features for r in reasons]), rtol=0, atol=QUANTUM
    )
    np.testing.assert_allclose(
        np.transpose([values["xs"], values["ys"]]) / 1000, candidates, rtol=0, atol=0.00051
    )


def test_other_candidates_are_in_the_file(trace):
    step = trace.steps[0]
    candidates = step.explanation.candidates + 0.001
    moved = step._replace(explanation=step.explanation._replace(candidates=candidates))
    text = encode(trace._replace(steps=(moved, *trace.steps[1:])), [])
    head, _ = unpacked(text)
    assert "drawn" not in head
    np.testing.assert_array_equal(
        array(text, "candidates.x")[: len(candidates)], np.rint(candidates[:, 0] * 1000)
    )
    assert len(array(text, "feature.a_close")) == sum(array(text, "candidates.count"))
