"""The surrogates compared at experiments that they have not seen."""

import os
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hopperopt import files
from hopperopt.figures import style
from hopperopt.surrogate import features

# Rows of validation.csv from the top, in words.
WORDS = {
    "noise_floor": "perfect prediction",
    "gaussian": "Gaussian processes",
    "ensemble": "ensemble",
    "ensemble_clipped": "ensemble, clipped",
    "network": "network",
    "network_clipped": "network, clipped",
    "quadratic": "quadratic surface",
    "mean_objective": "mean objective",
    "mean_curve": "mean curve",
    "random_points": "random points",
}
DOTS = {"linestyle": "", "marker": "o", "markersize": 3.5, "clip_on": False}


def write(
    params: Mapping,
    validation: str | os.PathLike,
    surrogate: str | os.PathLike,
    outputs: Sequence[str | os.PathLike],
) -> None:
    """Draw the comparison; params: `dpi`; validation, surrogate: paths of validation.csv and model.nc;
    outputs: paths, PNG or PDF.
    """
    chosen = files.read_netcdf(surrogate).attrs["surrogate"]
    style.save(draw(files.read_table(validation), chosen), outputs, params["dpi"])


@style.styled
def draw(validation: pd.DataFrame, chosen: str) -> Figure:
    """Draw errors of the curves, errors of J and the coverage, a line for each method.

    validation: a row per method, columns as in validation.csv; chosen: the surrogate that is used, in bold.
    Dashed lines are the errors of the mean curve and of the mean objective, and the coverage that is right.
    """
    table = validation.set_index("method")
    table = table.loc[[name for name in WORDS if name in table.index]]
    height = 24 + 4.5 * len(table)
    figure = style.page(style.PAGE, height)
    curves, objectives, coverage = style.panels(figure, 1, 3, style.Frame(33, 5, 5, 10), (7, 0), sharey=True)[
        0
    ]
    _draw_errors(curves, table, "curve_rmse_{}", "mean_curve")
    _draw_errors(objectives, table, "objective_{}_rmse", "mean_objective")
    at = -np.arange(len(table))
    coverage.plot(table["coverage_90"], at, color=style.INK, **DOTS)
    coverage.axvline(0.9, color=style.FAINT, linewidth=0.7, linestyle="--", zorder=0)
    coverage.set_xlim(0, 1)
    coverage.set_xticks([0, 0.5, 0.9], ["0", "0.5", "0.9"])
    titles = "rms error of the curves", "rms error of $J$", "coverage of the curves"
    for panel, title in zip((curves, objectives, coverage), titles, strict=True):
        panel.set_title(title, loc="left")
        panel.set_yticks(at, [WORDS[name] for name in table.index])
        panel.tick_params(axis="y", length=0)
        panel.set_ylim(at[-1] - 0.6, 0.6)
        panel.grid(axis="y", color="#EEEEEE", linewidth=0.5)
        panel.set_axisbelow(True)
    for label, name in zip(curves.get_yticklabels(), table.index, strict=True):
        label.set_fontweight("bold" if name == chosen else "normal")
    looks = {name: {**DOTS, "color": style.COLOURS[name]} for name in features.OUTPUTS}
    style.key(figure, looks, (33, height - 1))
    return figure


def _draw_errors(panel, table, column, baseline):
    """Dots of both outputs in the rows of a table, dashed lines at the baseline's."""
    for name, short in zip(features.OUTPUTS, "fi", strict=True):
        values = table[column.format(short)]
        panel.plot(values, -np.arange(len(table)), color=style.COLOURS[name], **DOTS)
        panel.axvline(values[baseline], color=style.COLOURS[name], linewidth=0.6, linestyle="--", zorder=0)
    panel.set_xlim(0)
    panel.locator_params(axis="x", nbins=3)
