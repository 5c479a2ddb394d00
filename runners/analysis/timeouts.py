"""The section of a results table on episodes that ran out of time: what the robots did in the last minute."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lme.types import Outcome
from runners.analysis.summary import as_text, row_keys
from runners.config.escaping import markdown_text
from runners.config.wording import markdown_table

if TYPE_CHECKING:
    import pandas as pd

EXTENT, LAST_S = "last_minute_m", 60.0
CLASSES = ("stands", "to and fro", "on its way")
UP_TO_M = (
    0.5,
    3.0,
)  # extent of the last minute of all classes but the last. ASSUMED: a robot's size, a room's


def timeouts_section(frame: pd.DataFrame) -> str:
    """The section of table.md; empty unless a robot was driving for longer than a minute when its time was up.

    frame: records of one or more runs.
    """
    if EXTENT not in frame:
        return ""
    late = frame[(frame["outcome"] == Outcome.TIMEOUT) & frame[EXTENT].notna()]
    if not (late["time_s"] > LAST_S).any():
        return ""
    keys = ["system", *row_keys(frame)]
    kinds = np.searchsorted(UP_TO_M, late[EXTENT], side="right")
    counts = late.assign(kind=kinds, **{key: as_text(late[key]) for key in keys}).groupby(keys, sort=False)
    rows = [
        [
            *map(str, values),
            str(len(group)),
            *(str((group["kind"] == kind).sum()) for kind in range(len(CLASSES))),
        ]
        for values, group in counts
    ]
    header = [*(key.capitalize() if key.isidentifier() else key for key in keys), "Time-outs", *CLASSES]
    rule = ["---" if number < len(keys) else "---:" for number in range(len(header))]
    stands, paces = UP_TO_M
    note = f"By the last minute: the robot stayed within {stands:g} m, within {paces:g} m, or went farther."
    return f"\n## Time-outs\n\n{markdown_table([header, rule, *(map(markdown_text, row) for row in rows)])}\n\n{note}\n"
