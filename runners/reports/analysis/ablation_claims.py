"""The paper's statements about its ablation, and whether paired differences agree with them.

The paper describes its figure in words, without numbers (§IV, Ablation Studies). Its statements are data here. The
rules in `NOTES` decide from our paired differences whether we agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from runners.config.systems import SEVERAL
from runners.reports.analysis.paired import SUCCESS, Block, Difference, interval, signed

COMPLETE = "none"  # of the option ablation
SOURCE = "the LME paper, §IV, Ablation Studies (words without numbers)"
# the paper's statements are about either reading of its method
SYSTEMS = ("LME", "LME (as run)", "LME as printed")
ABOUT = {"map": "barn", "robot": "jackal", "scale": ""}  # and its benchmark


class Claim(NamedTuple):
    """The paper's statement about removing a part. tier: from 3, the largest loss, to 0, no loss.

    tier is None for a loss of unknown size. ASSUMED: "noticeable" (2) is more than "moderate" (1), because the paper
    lists them in this order.
    """

    tier: int | None
    words: str


CLAIMS = {  # in the order of the paper's figure
    "no_a_close": Claim(1, "moderate degradation"),
    "no_a_dev": Claim(0, "almost no effect"),
    "no_c_o": Claim(3, "the most significant, a substantial decrease"),
    "no_c_t": Claim(2, "noticeable degradation"),
    "no_a_mount": Claim(2, "noticeable degradation"),
    "no_c_h": Claim(1, "moderate degradation"),
    "no_maintenance": Claim(None, "an important role, a lower success rate"),
}
MOST = 3
ALMOST = 0.02  # of success rate: "almost no effect". ASSUMED: two deviations of the published rate over runs (.009)
_ANSWERS = {"yes": "Agrees", "in part": "Agrees in part", "no": "Does not agree", "open": "Open"}
FEWEST = 20  # worlds needed for a verdict if no difference is beyond the noise
MARGIN = 0.1  # of success rate: an interval that reaches farther may contain the loss that the paper states
NOTES = (
    f"The paper's statements: {SOURCE}. Ours is a 2D simulator, not Gazebo, and the paper does not list its hundred "
    "worlds.",
    "Agrees, if the paper states a loss: yes for a loss beyond the noise; in part if another variant, with a larger "
    "stated loss, loses less, and the two intervals do not overlap; no otherwise. "
    'The order of the stated losses is "most significant", "noticeable", "moderate".',
    f'Agrees, if the paper states "almost no effect": yes unless a change beyond the noise exceeds {ALMOST:g}.',
    f"Open: nothing is beyond the noise, and there are fewer than {FEWEST} worlds or an interval reaches farther "
    f"than {MARGIN:g}.",
)


def variant_label(ablation: str, ablated: str = "") -> str:
    """Return a label such as "No a_close" for no_a_close, and "No c_o, c_t" for two parts at once.

    ablated: the ablation in words, for one that is not named for what it removes.
    """
    if ablation == COMPLETE:
        return "Complete"
    removed = removed_parts(ablation)
    return f"No {', '.join(removed)}" if removed else (ablated[:1].upper() + ablated[1:] or ablation)


def removed_parts(ablation: str) -> list[str]:
    """Return ["c_o", "c_t"] for "no_c_o+no_c_t"; empty if one of several has another name."""
    names = ablation.split(SEVERAL)
    return (
        [name.removeprefix("no_") for name in names] if all(name.startswith("no_") for name in names) else []
    )


def is_the_papers(block: Block) -> bool:
    """Return whether the paper's statements apply: its method on its benchmark, with some successes."""
    baseline = block.baseline.iloc[0]
    matches = all(str(baseline.get(key, value)) == value for key, value in ABOUT.items())
    return (
        matches and str(baseline["system"]) in SYSTEMS and bool((block.baseline["outcome"] == SUCCESS).any())
    )


def verdict_on(
    name: str, differences: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str] | None:
    """Return whether the change agrees with the claim, and a sentence with the reason; None without a comparison."""
    change = differences.get(name)
    if change is None:
        return None
    agrees, reason = _judge(name, change, differences, claims)
    interval_text = interval(change)
    result = f"{signed(change.mean)} ({interval_text})" if interval_text else signed(change.mean)
    return agrees, f"the paper says {claims[name].words}; ours {result}. {_ANSWERS[agrees]}: {reason}."


def _judge(
    name: str, change: Difference, differences: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str]:
    tier = claims[name].tier
    if _is_open(change, tier):
        return "open", "too noisy to tell"
    # The paper states no effect: only a change beyond the noise and beyond ALMOST contradicts it.
    if tier == 0:
        if not change.beyond_noise:
            return "yes", "no change beyond the noise"
        if abs(change.mean) <= ALMOST:
            return "yes", f"a change beyond the noise, but not beyond {ALMOST:g}"
        return "no", f"a {'gain' if change.mean > 0 else 'loss'} beyond the noise"
    if not change.beyond_noise:
        return "no", "no loss beyond the noise"
    if change.mean > 0:
        return "no", "on the contrary, a gain beyond the noise"
    if tier is None:
        return "yes", "a loss beyond the noise"
    # Of two losses, one is larger if their intervals are disjoint.
    rivals = {rival: differences[rival] for rival in claims if rival in differences and rival != name}
    if tier == MOST:
        larger = [
            variant_label(rival) for rival, difference in rivals.items() if difference.high < change.low
        ]
        if larger:
            return "in part", f"a loss beyond the noise, but smaller than that of {' and '.join(larger)}"
        is_largest = all(difference.mean > change.mean for difference in rivals.values())
        return "yes", "the largest loss of all" if is_largest else "a loss beyond the noise"
    smaller = [
        variant_label(rival)
        for rival, difference in rivals.items()
        if (claims[rival].tier or 0) > tier and change.high < difference.low
    ]
    if smaller:
        return "in part", f"a loss beyond the noise, but larger than that of {' and '.join(smaller)}"
    return "yes", "a loss beyond the noise"


def _is_open(change: Difference, tier: int | None) -> bool:
    """Return whether there are too few worlds, or too wide an interval, to show a difference."""
    largest_loss = max(-change.low, change.high) if tier == 0 else -change.low
    return not change.beyond_noise and (change.worlds < FEWEST or largest_loss > MARGIN)
