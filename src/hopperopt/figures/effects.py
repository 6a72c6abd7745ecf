"""Main effects of the factors on the objectives."""

import os
from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.figure import Figure

from hopperopt import files
from hopperopt.figures import style

COLUMNS, PANEL, ROW = 4, 35.0, 30.0  # panels beside each other; their width and height, mm
FRAME, GAPS = style.Frame(left=14, right=3, bottom=9, top=3), (5.0, 9.0)
MEAN = {"marker": "o", "markersize": 3}


def write(params: Mapping, effects: str | os.PathLike, outputs: Sequence[str | os.PathLike]) -> None:
    """Draw the effects; params: `dpi`; effects: path of effects.csv; outputs: paths, PNG or PDF."""
    style.save(draw(files.read_table(effects)), outputs, params["dpi"])


@style.styled
def draw(effects: pd.DataFrame) -> Figure:
    """Draw J over the levels of each factor, a row of panels for each objective, with bands of 90 %.

    effects: a row per factor, level and objective, columns as in effects.csv. More factors than fit beside
    each other go on below.
    """
    factors = list(dict.fromkeys(effects["factor"]))
    parts = [factors[first : first + COLUMNS] for first in range(0, len(factors), COLUMNS)]
    rows, columns = len(parts) * len(style.OBJECTIVES), len(parts[0])
    width = FRAME.left + FRAME.right + columns * PANEL + (columns - 1) * GAPS[0]
    figure = style.page(width, FRAME.bottom + FRAME.top + rows * ROW + (rows - 1) * GAPS[1])
    axes = style.panels(figure, rows, columns, FRAME, GAPS)
    for panel in axes.flat:
        panel.set_visible(False)
    for part, names in enumerate(parts):
        for row, objective in enumerate(style.OBJECTIVES, start=part * len(style.OBJECTIVES)):
            table = effects[effects["objective"] == objective]
            for panel, name in zip(axes[row], names, strict=False):
                panel.set_visible(True)
                _draw_levels(panel, table[table["factor"] == name], style.COLOURS[objective])
                panel.set_ylim(_limits(table))
                symbol, unit = style.factor_parts(name)
                panel.set_xlabel(f"{symbol} ({unit.strip()})" if unit else symbol)
            axes[row, 0].set_ylabel(style.OBJECTIVES[objective])
            for panel in axes[row, 1:]:
                panel.tick_params(labelleft=False)
    return figure


def _draw_levels(panel, levels, colour):
    """Draw the means of a factor's levels and their band."""
    panel.fill_between(
        levels["level"], levels["J_low"], levels["J_high"], color=colour, alpha=0.2, linewidth=0
    )
    panel.plot(levels["level"], levels["J"], color=colour, **MEAN)
    panel.locator_params(nbins=5)


def _limits(table):
    """Limits of J for all factors."""
    low, high = table["J_low"].min(), table["J_high"].max()
    return min(low, 0) * 1.05, max(high, 0) * 1.05 or 1
