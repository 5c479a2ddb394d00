"""The curves of `lme learn`: validation results and losses over the training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from runners.reports.figures.style import (
    BLUE,
    GREEN,
    INK,
    LEGEND_ORDER,
    ORANGE,
    PURPLE,
    STYLES,
    new_figure,
    save,
)

_WIDTH_IN, _PANEL_IN = 7.0, 2.3
_COLOURS = (BLUE, ORANGE, PURPLE, GREEN)


def curves_figure(rows: Sequence[Mapping[str, float]], path: Path) -> Path:
    """Save `path` as PNG: the outcomes in validation, and panels of the losses and of the return, if there are any.

    rows: of the curves in their order. The first key is the axis; a name with `loss` is a loss.
    """
    # Choose the panels: validation always, losses and return where the rows have them.
    axis, *names = rows[0]
    losses = [name for name in names if "loss" in name]
    panels = [losses] if losses else []
    if "return" in names:
        panels.append(["return"])
    figure = new_figure(_WIDTH_IN, _PANEL_IN * (1 + len(panels)))
    outcome_panel, *further_panels = figure.subplots(1 + len(panels), 1, sharex=True, squeeze=False)[:, 0]
    x_values = [row[axis] for row in rows]
    for outcome in LEGEND_ORDER:
        style = STYLES[outcome]
        shares = [row[outcome] for row in rows]
        outcome_panel.plot(x_values, shares, style.line, color=style.colour, marker=".", label=outcome)
    outcome_panel.set(ylim=(0.0, 1.0), ylabel="share in validation")
    outcome_panel.set_title(f"best success {rows[-1]['best_success']:.3f}", fontsize=10)
    for panel, columns in zip(further_panels, panels, strict=True):
        for name, colour in zip(columns, _COLOURS, strict=False):
            panel.plot(
                x_values, [row[name] for row in rows], color=colour, marker=".", label=name.replace("_", " ")
            )
        panel.set_ylabel("loss" if columns is losses else columns[0])
    for panel in (outcome_panel, *further_panels):
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=8.5, colors=INK)
        panel.legend(frameon=False, fontsize=8.5, ncols=4)
    (further_panels or [outcome_panel])[-1].set_xlabel(axis)
    return save(figure, path.with_suffix(""))[0]
