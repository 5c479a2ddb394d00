"""The ablation study: what each part of the method contributes, and whether that agrees with the paper.

The paper describes its figure in words, without numbers (§IV, Ablation Studies). Its statements are data here. The
rules in `NOTES` decide from our paired differences whether we agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from runners.config.ablations import SEVERAL
from runners.config.escaping import markdown_text
from runners.config.wording import markdown_table
from runners.records.whole_file import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.paired import METRIC, SUCCESS, Block, Difference, interval, signed
from runners.reports.analysis.summary import DASH, Row
from runners.reports.analysis.tables import title

if TYPE_CHECKING:
    import pandas as pd

COLUMN, COMPLETE = "ablation", "none"
NAME = "ablation"
SOURCE = "the LME paper, §IV, Ablation Studies (words without numbers)"
SYSTEMS = ("LME", "LME as printed")  # the paper's statements are about either reading of its method
ABOUT = {"map": "barn", "robot": "jackal", "scale": ""}  # and its benchmark


class Claim(NamedTuple):
    """What the paper says about removing a part. tier: 3 the largest loss, 0 none; None: a loss of unknown size.

    ASSUMED: "noticeable" (2) is more than "moderate" (1), because the paper lists them in this order.
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


@dataclass(frozen=True, slots=True)
class Variant:
    """A line of the table. change: difference from the complete method, by measure; empty for the complete method.

    claim: what the paper says. agrees: "yes", "in part", "no" or "open". words: a sentence with the reason. All three
    are empty if the paper says nothing.
    """

    ablation: str
    row: Row
    change: dict[str, Difference]
    claim: str = ""
    agrees: str = ""
    words: str = ""


@dataclass(frozen=True, slots=True)
class AblationStudy:
    """Variants of one system in one setting, the complete one first. heading: the system. place: the setting."""

    heading: str
    place: str
    variants: tuple[Variant, ...]


def studies(frame: pd.DataFrame) -> list[AblationStudy]:
    """One study for each system and setting with the complete method and an ablation; other records are ignored."""
    return [_study(block) for block in paired.blocks(frame, COLUMN, COMPLETE)]


def variant_label(ablation: str) -> str:
    """ "No a_close" for no_a_close, "No c_o, c_t" for two at once."""
    if ablation == COMPLETE:
        return "Complete"
    return f"No {', '.join(part.removeprefix('no_') for part in ablation.split(SEVERAL))}"


def sentences(found: list[AblationStudy]) -> list[str]:
    """Whether our results agree with the paper: a line for each of its statements."""
    lines = []
    for study in found:
        said = [variant for variant in study.variants if variant.agrees]
        if said:
            lines.append(f"{study.heading}, {study.place}: the paper's ablation and ours.")
        lines += [f"{variant_label(each.ablation)}: {each.words}" for each in said]
    return lines


def write(found: list[AblationStudy], place: Path) -> list[Path]:
    """Write `ablation.md` and `ablation.csv` into `place`; return their paths."""
    markdown, table = place / f"{NAME}.md", place / f"{NAME}.csv"
    write_atomically(markdown, to_markdown(found))
    paired.write_csv([_numbers(study, variant) for study in found for variant in study.variants], table)
    return [markdown, table]


def to_markdown(found: list[AblationStudy]) -> str:
    """The tables, a list of verdicts below each, and notes at the end."""
    parts = [part for study in found for part in (_table(study), _list(study)) if part]
    said = any(variant.agrees for study in found for variant in study.variants)
    notes = [*paired.NOTES, *(NOTES if said else ())]
    return "\n\n".join([*parts, "  \n".join(notes)]) + "\n"


def _study(block: Block) -> AblationStudy:
    changes = {measure: paired.compare(block, measure) for measure in (SUCCESS, METRIC)}
    claims = CLAIMS if _is_the_papers(block) else {}
    names = [
        *(name for name in CLAIMS if name in block.variants),
        *sorted(block.variants.keys() - CLAIMS.keys()),
    ]
    variants = [Variant(COMPLETE, paired.row(block.baseline), {})]
    for name in names:
        change = {measure: found[name] for measure, found in changes.items() if name in found}
        row = paired.row(block.variants[name])
        verdict = _verdict(name, changes[SUCCESS], claims) if name in claims else None
        said = claims[name].words if verdict else ""
        variants.append(Variant(name, row, change, said, *(verdict or ())))
    return AblationStudy(block.heading, title(block.baseline), tuple(variants))


def _is_the_papers(block: Block) -> bool:
    """Whether the paper's statements apply: its method on its benchmark, with some successes."""
    first = block.baseline.iloc[0]
    same = all(str(first.get(key, value)) == value for key, value in ABOUT.items())
    return same and str(first["system"]) in SYSTEMS and bool((block.baseline["outcome"] == SUCCESS).any())


def _verdict(
    name: str, found: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str] | None:
    """Whether the change agrees with the claim, and a sentence with the reason; None if nothing was compared."""
    change = found.get(name)
    if change is None:
        return None
    agrees, why = _judge(name, change, found, claims)
    reach = interval(change)
    measured = f"{signed(change.mean)} ({reach})" if reach else signed(change.mean)
    return agrees, f"the paper says {claims[name].words}; ours {measured}. {_ANSWERS[agrees]}: {why}."


def _judge(
    name: str, change: Difference, found: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str]:
    tier = claims[name].tier
    if _is_open(change, tier):
        return "open", "too noisy to tell"
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
    if tier == MOST:
        return _judge_largest_loss(name, change, found, claims)
    above = list(_exceeded_variants(name, change, found, claims))
    if above:
        return "in part", f"a loss beyond the noise, but larger than that of {' and '.join(above)}"
    return "yes", "a loss beyond the noise"


def _is_open(change: Difference, tier: int | None) -> bool:
    """Whether there are too few worlds, or too wide an interval, to show a difference."""
    reach = max(-change.low, change.high) if tier == 0 else -change.low
    return not change.beyond_noise and (change.worlds < FEWEST or reach > MARGIN)


def _judge_largest_loss(
    name: str, change: Difference, found: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str]:
    others = {other: found[other] for other in claims if other in found and other != name}
    larger = [variant_label(other) for other, theirs in others.items() if theirs.high < change.low]
    if larger:
        return "in part", f"a loss beyond the noise, but smaller than that of {' and '.join(larger)}"
    largest = all(theirs.mean > change.mean for theirs in others.values())
    return "yes", "the largest loss of all" if largest else "a loss beyond the noise"


def _exceeded_variants(
    name: str, change: Difference, found: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> Iterator[str]:
    """Variants with a larger loss in the paper that lose less here, with disjoint intervals."""
    tier = claims[name].tier or 0
    for other, claim in claims.items():
        if claim.tier is not None and claim.tier > tier and other in found and change.high < found[other].low:
            yield variant_label(other)


def _table(study: AblationStudy) -> str:
    change = ["Difference", "95 %", "p (Holm)", "Beyond the noise"]
    scored = any(METRIC in variant.row.stats for variant in study.variants)
    measures = {SUCCESS: "Success", METRIC: "BARN metric"} if scored else {SUCCESS: "Success"}
    columns = [column for name in measures.values() for column in (name, *change)]
    header = ["Variant", *columns, "The paper says", "Agrees", "Pairs"]
    lines = [_cells(variant, list(measures)) for variant in study.variants]
    rule = ["---", *["---:"] * (len(header) - 4), "---", "---", "---:"]
    table = markdown_table([header, rule, *(map(markdown_text, line) for line in lines)])
    return f"**{markdown_text(f'{study.heading} · {study.place}')}**\n\n{table}"


def _cells(variant: Variant, measures: Sequence[str]) -> list[str]:
    lacking = f", {variant.row.unfinished}" if variant.row.unfinished else ""
    cells = [variant_label(variant.ablation) + lacking]
    for measure in measures:
        mean, std = variant.row.stats.get(measure, (math.nan, math.nan))
        spread = "" if math.isnan(std) else f" ± {std:.3f}"
        cells.append(DASH if math.isnan(mean) else f"{mean:.3f}{spread}")
        cells += _change(variant.change.get(measure))
    pairs = str(variant.change[SUCCESS].pairs) if variant.change else DASH
    return [*cells, variant.claim or DASH, variant.agrees or DASH, pairs]


def _change(change: Difference | None) -> list[str]:
    if change is None:
        return [DASH] * 4
    if math.isnan(change.adjusted):
        return [signed(change.mean), DASH, DASH, DASH]
    verdict = "yes" if change.beyond_noise else "no"
    return [signed(change.mean), interval(change), paired.p_value(change), verdict]


def _list(study: AblationStudy) -> str:
    return "\n".join(
        f"- {markdown_text(variant_label(v.ablation))}: {v.words}" for v in study.variants if v.agrees
    )


def _numbers(study: AblationStudy, variant: Variant) -> dict[str, object]:
    """A line of the CSV, not rounded."""
    pairs = {"pairs": variant.change[SUCCESS].pairs} if variant.change else {}
    said = {"paper_says": variant.claim, "agrees": variant.agrees}
    known = {"block": study.heading, "place": study.place, "ablation": variant.ablation}
    return {**known, **pairs, **paired.to_mapping(variant.row, variant.change), **said}
