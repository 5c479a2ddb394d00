"""Rounded features change no choice: steps that would choose otherwise are in the page in full."""

import numpy as np

from runners.reports.explainer.encode import encode
from runners.reports.explainer.features import QUANTUM
from tests.runners.reports.explainer.conftest import traced
from tests.runners.reports.explainer.test_write import array, unpacked

PLUS = ("system=lme_plus", "map=barn", "robot=jackal", "sim=fast", "map.time_limit=1.5", "map.worlds=[207]")


def test_a_step_that_would_choose_otherwise_is_exact():
    trace = traced(207, *PLUS)
    reasons = [step.explanation for step in trace.steps]
    at = next(i for i, reason in enumerate(reasons) if reason.new > 0)
    # The first candidate is worse than the best by less than the quantum.
    features = reasons[at].features.copy()
    features[:, 0] = features[:, reasons[at].new]
    features[reasons[at].names.index("a_reach"), 0] -= QUANTUM / 1000
    steps = list(trace.steps)
    steps[at] = steps[at]._replace(explanation=reasons[at]._replace(features=features))
    text = encode(trace._replace(steps=tuple(steps)), [])
    head, _ = unpacked(text)
    assert head["quantum"] == QUANTUM
    exact = array(text, "exact.steps").tolist()
    assert at in exact
    counts = array(text, "candidates.count").astype(int)
    before = sum(counts[step] for step in exact[: exact.index(at)])
    for row, name in enumerate(reasons[at].names):
        np.testing.assert_array_equal(
            array(text, f"exact.{name}")[before : before + counts[at]], features[row]
        )
        # Of features that the page computes, only those of candidates that it does not draw are in the file.
        first = head["drawn"]["number"] if name in head["computed"] else 0
        others = np.concatenate([r.features[row, first:] for i, r in enumerate(reasons) if i != at])
        start = sum(counts[:at] - first)
        written = array(text, f"feature.{name}") * QUANTUM
        rounded = np.delete(written, np.s_[start : start + counts[at] - first])
        np.testing.assert_allclose(rounded, others, rtol=0, atol=0.501 * QUANTUM)
