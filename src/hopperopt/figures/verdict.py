"""The cases simulated anew at one glance: objectives as predicted and as simulated, and the verdicts."""

import os
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hopperopt import files
from hopperopt.figures import style
from hopperopt.surrogate import features

ROW = 8.0  # mm, height of a case
FRAME = style.Frame(left=21, right=28, bottom=9, top=10)
GAP = 30.0  # mm between the panels, for the verdicts of the left one
SIMULATED = {"marker": "D", "markersize": 4, "markerfacecolor": "white", "color": style.INK}
PREDICTED = {"marker": "o", "markersize": 3.5, "color": "#009E73"}
IN_PLAN = {"marker": "s", "markersize": 3.5, "markerfacecolor": "white", "color": "#909090"}
SHIFT = 0.24  # of a row: predicted above, the plan's below what is simulated


def write(
    params: Mapping,
    verdict: str | os.PathLike,
    designs: str | os.PathLike,
    outputs: Sequence[str | os.PathLike],
) -> None:
    """Draw the verdicts; params: `dpi`; verdict, designs: paths of verdict.csv and designs.csv."""
    style.save(draw(files.read_table(verdict), files.read_table(designs)), outputs, params["dpi"])


@style.styled
def draw(verdict: pd.DataFrame, designs: pd.DataFrame) -> Figure:
    """Draw each case's objectives, a panel for each of them, with intervals of 90 % and the verdict.

    verdict: a row per case and objective; designs: the plan's, of which the best is drawn beside the case
    plan_best, whose fresh simulations do not share the luck of having been chosen.
    """
    cases = list(dict.fromkeys(verdict["case"]))
    height = FRAME.bottom + FRAME.top + ROW * len(cases)
    figure = style.page(style.PAGE, height)
    best = designs.loc[designs["rank"].idxmin()]
    for panel, name in zip(style.panels(figure, 1, 2, FRAME, (GAP, 0))[0], features.OUTPUTS, strict=True):
        panel.axvline(0, color=style.FAINT, linewidth=0.5, zorder=0)
        rows = verdict[verdict["objective"] == name].set_index("case").loc[cases]
        for at, (case, row) in enumerate(rows.iterrows()):
            _draw_case(panel, at, row)
            if case == "plan_best":
                _draw_value(panel, at + SHIFT, best[name], best[f"{name}_low"], best[f"{name}_high"], IN_PLAN)
        panel.set(ylim=(len(cases) - 0.5, -0.5), xlabel=style.OBJECTIVES[name])
        panel.set_yticks(range(len(cases)), [case.replace("_", " ") for case in cases])
        panel.tick_params(axis="y", length=0, labelleft=name == features.OUTPUTS[0])
        panel.locator_params(axis="x", nbins=4)
        panel.annotate("against bare", (1, 1), (3, 3), xycoords="axes fraction", textcoords="offset points")
    marks = {"simulated": SIMULATED, "predicted": PREDICTED}
    marks |= {"the same design in the plan": IN_PLAN} if "plan_best" in cases else {}
    style.key(figure, {text: {**look, "linewidth": 0.7} for text, look in marks.items()}, (2, height - 1))
    return figure


def _draw_case(panel, at, row):
    """Draw one case at a height of the panel, and write its verdict at the right."""
    _draw_value(panel, at, row["simulated"], row["low"], row["high"], SIMULATED)
    _draw_value(panel, at - SHIFT, row["predicted"], row["predicted_low"], row["predicted_high"], PREDICTED)
    if isinstance(row["verdict"], str):
        panel.annotate(
            row["verdict"], (1, at), (3, 0), xycoords=("axes fraction", "data"), textcoords="offset points",
            va="center", annotation_clip=False, color="#777777" if " " in row["verdict"] else style.INK,
        )  # fmt: skip


def _draw_value(panel, at, value, low, high, look):
    """Draw a value at a height with its interval, as far as there are any."""
    if np.isfinite([low, high]).all():
        panel.plot([low, high], [at, at], color=look["color"], linewidth=0.7, zorder=2)
    if np.isfinite(value):
        panel.plot(value, at, linestyle="", zorder=3, **look)
