"""Sobol' indices of the surrogate: what its outputs depend on."""

import os
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hopperopt import files
from hopperopt.figures import style

ROW = 8.0  # mm, height of a factor
FRAME, GAP = style.Frame(left=21, right=3, bottom=9, top=14), 6.0
TITLES = {f"J_{name}": symbol for name, symbol in style.OBJECTIVES.items()} | {
    "discharge_time": "discharge time"
}
LOOKS = {
    "total": {"marker": "D", "markersize": 3.5, "markerfacecolor": "white", "color": style.INK},
    "first": {"marker": "o", "markersize": 3.5, "color": "#009E73"},
}
SHIFT = 0.15  # of a row: the first-order index above, the total one below


def write(params: Mapping, sobol: str | os.PathLike, outputs: Sequence[str | os.PathLike]) -> None:
    """Draw the indices; params: `dpi`; sobol: path of sobol.csv; outputs: paths, PNG or PDF."""
    style.save(draw(files.read_table(sobol)), outputs, params["dpi"])


@style.styled
def draw(sobol: pd.DataFrame) -> Figure:
    """Draw first-order and total indices of each factor, a panel for each output, with intervals of 90 %.

    sobol: a row per output and factor, columns as in sobol.csv.
    """
    factors = list(dict.fromkeys(sobol["factor"]))
    height = FRAME.bottom + FRAME.top + ROW * len(factors)
    figure = style.page(style.PAGE, height)
    axes = style.panels(figure, 1, len(TITLES), FRAME, (GAP, 0), sharex=True, sharey=True)[0]
    for panel, (output, title) in zip(axes, TITLES.items(), strict=True):
        table = sobol[sobol["output"] == output].set_index("factor").loc[factors]
        panel.axvline(0, color=style.FAINT, linewidth=0.5, zorder=0)
        for kind, look in LOOKS.items():
            at = np.arange(len(factors)) + (SHIFT if kind == "total" else -SHIFT)
            panel.hlines(at, table[f"{kind}_low"], table[f"{kind}_high"], color=look["color"], linewidth=0.7)
            panel.plot(table[kind], at, linestyle="", **look)
        panel.set_title(title, loc="left")
        panel.set(ylim=(len(factors) - 0.5, -0.5), xlabel="share of the variance")
        panel.set_yticks(range(len(factors)), [style.factor_parts(name)[0] for name in factors])
        panel.tick_params(axis="y", length=0)
    low, high = axes[0].get_xlim()
    axes[0].set_xlim(min(low, -0.05), max(high, 1.05))
    style.put(figure, 2, height - 1, "Sobol' indices of the surrogate", va="top")
    words = {"alone (first order)": LOOKS["first"], "with the others (total)": LOOKS["total"]}
    style.key(figure, {text: {**look, "linewidth": 0.7} for text, look in words.items()}, (2, height - 5))
    return figure
