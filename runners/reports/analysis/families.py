"""The section of a results table on the families of worlds, for map sets that draw one for every episode."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lme.metrics import interval_over_worlds
from lme.worlds.cold_trial import STAND_IN
from runners.config.escaping import markdown_text
from runners.config.wording import markdown_table
from runners.reports.analysis.summary import as_text, row_keys

if TYPE_CHECKING:
    import pandas as pd

FAMILY = "world_family"


def families_section(frame: pd.DataFrame) -> str:
    """Return the section of table.md; empty if the records have no families. frame: records of one or more runs."""
    if FAMILY not in frame:
        return ""
    episodes = frame[frame[FAMILY].notna()]
    # A row for each combination of values and family.
    keys = ["system", *row_keys(frame), FAMILY]
    texts = episodes.assign(**{key: as_text(episodes[key]) for key in keys})
    rows = [[*map(str, values), *_figures(group)] for values, group in texts.groupby(keys, sort=False)]
    names = [key.capitalize() if key.isidentifier() else key for key in keys[:-1]]
    header = [*names, "Family", "Success", "95 % CI", "Collision", "Timeout", "n"]
    rule = ["---" if number < len(keys) else "---:" for number in range(len(header))]
    stands_in = (episodes[FAMILY] == STAND_IN).any()
    note = (
        f"\n{STAND_IN} are generated: no maps of real buildings were given (map.paths).\n"
        if stands_in
        else ""
    )
    table = markdown_table([header, rule, *(map(markdown_text, row) for row in rows)])
    return f"\n## Families of worlds\n\n{table}\n{note}"


def _figures(group: pd.DataFrame) -> list[str]:
    low, high = interval_over_worlds(group["outcome"] == "success", group["world"])
    success, collision, timeout = (
        f"{(group['outcome'] == outcome).mean():.3f}" for outcome in ("success", "collision", "timeout")
    )
    return [success, f"{low:.3f}–{high:.3f}", collision, timeout, str(len(group))]
