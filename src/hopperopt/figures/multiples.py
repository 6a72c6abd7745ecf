"""A page of small panels, one for each experiment, all with the same axes."""

import math
import re
from collections.abc import Mapping, Sequence

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopperopt.figures import style

COLUMNS = 5
MOST_PANELS = 100
PANEL = (29.0, 23.0)  # mm
FRAME = style.Frame(left=11, right=7, bottom=8.5, top=9)
GAPS = (3.0, 6.0)
KEY = 4.0  # mm, height of the key's row
MOST_FACTORS, LONGEST_NAME = 4, 4  # what fits above a panel


def some(data: xr.Dataset) -> xr.Dataset:
    """Every so manyth experiment of data: as many as a page can show."""
    return data.isel(experiment=slice(None, None, -(-data.sizes["experiment"] // MOST_PANELS)))


def _columns(count: int) -> int:
    return min(COLUMNS, math.ceil(math.sqrt(count)))


def last_column(panels: Sequence[Axes]) -> Sequence[Axes]:
    """Those of a grid's panels that stand at its right edge."""
    columns = _columns(len(panels))
    return panels[columns - 1 :: columns]


def grid(data: xr.Dataset, key: Mapping[str, Mapping] | None = None) -> tuple[Figure, list[Axes]]:
    """Page with a panel for each experiment, headed by its number and the values of its factors.

    data: coordinate experiment and, along it, the factors, which its attribute `factors` names in order;
    key: see style.key. Returns the figure and its panels in the experiments' order; M runs from 0 to 1, the
    limits of y are shared and yet to be set.
    """
    count = data.sizes["experiment"]
    columns = _columns(count)
    rows = math.ceil(count / columns)
    width = FRAME.left + FRAME.right + columns * PANEL[0] + (columns - 1) * GAPS[0]
    frame = FRAME._replace(top=FRAME.top + KEY) if key else FRAME
    height = frame.bottom + frame.top + rows * PANEL[1] + (rows - 1) * GAPS[1]
    figure = style.page(max(width, style.COLUMN), height)
    axes = style.panels(figure, rows, columns, frame, GAPS, sharex=True, sharey=True)
    for panel in axes.flat[count:]:
        panel.remove()
    panels = list(axes.flat[:count])
    panels[0].set_xlim(0, 1)
    panels[0].set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
    for panel in panels[-columns:]:
        panel.tick_params(labelbottom=True)
    _label(figure, panels, data, frame)
    if key:
        style.key(figure, key, (frame.left, height - 1))
    return figure, panels


def _label(figure, panels, data, frame):
    """Write the panels' headings, what stands in them, and the names of the axes."""
    factors = data.attrs["factors"].split()
    names = [re.sub(r"^exp_0*(?=\d)", "", str(name)) for name in data["experiment"].values]
    if len(factors) > MOST_FACTORS or max(map(len, names)) > LONGEST_NAME:
        factors = []
    space = " " if len(factors) == MOST_FACTORS else "  "
    for row, (name, panel) in enumerate(zip(names, panels, strict=True)):
        panel.set_title(name, loc="left", fontweight="bold")
        panel.set_title(space.join(f"{float(data[factor][row]):.3g}" for factor in factors), loc="right")
    width, height = style.size(figure)
    above = height - 1 - (frame.top - FRAME.top)
    style.put(figure, frame.left, above, "experiment", va="top", fontweight="bold")
    symbols = [
        f"{symbol} ({unit.strip()})" if unit else symbol for symbol, unit in map(style.factor_parts, factors)
    ]
    style.put(figure, frame.left + 17, above, ",  ".join(symbols), va="top")
    style.put(figure, (width + frame.left - frame.right) / 2, 1, style.DISCHARGED, ha="center", va="bottom")
    middle = (height + frame.bottom - frame.top) / 2
    style.put(figure, 1, middle, "mass fraction in the outflow", ha="left", va="center", rotation=90)
