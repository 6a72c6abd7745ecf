"""Indices of segregation and of the flow, of all designs of the plan by their rank."""

import os
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from hopperopt import files, outflow
from hopperopt import indices as definitions
from hopperopt.dataset import ranked_designs
from hopperopt.figures import style

# Panels: variable of the data set and title; those of sizes first.
PANELS = {
    "U": "$J$",
    "U_without_end": "$J$ without $M = 1$",
    "U_by_mass": "$J$ weighted by mass",
    "relative_deviation": "relative standard deviation",
    "lacey_index": "Lacey index",
    "largest_deviation": "largest deviation",
    "discharge_rate": "discharge rate (kg/s)",
    "mass_flow_index": "mass-flow index",
    definitions.ORDER: "residence order",
}
MOST_DESIGNS = 100
COLUMNS, FRAME, GAPS = 3, style.Frame(left=12, right=2, bottom=9, top=10), (13.0, 8.0)
DOTS = {"linestyle": "", "marker": "o", "markersize": 2.5}
RANDOM = {"linewidth": 0.6, "linestyle": "--"}


def write(params: Mapping, dataset: str | os.PathLike, outputs: Sequence[str | os.PathLike]) -> None:
    """Draw the indices; params: `dpi`; dataset: path of dataset.nc; outputs: paths, PNG or PDF."""
    style.save(draw(files.read_netcdf(dataset)), outputs, params["dpi"])


@style.styled
def draw(dataset: xr.Dataset) -> Figure:
    """Draw each index over the designs' rank: the mean of a design's runs, and a line from least to largest.

    dataset: the plan's data set, of which at most 100 designs are shown, every so manyth rank. Objectives are
    sign(U) sqrt|U|, the mean that of U. Dashed: what a random mixture has.
    """
    figure = style.page(style.PAGE, 110)
    names = ranked_designs(dataset)["experiment"].to_numpy()
    every = -(-len(names) // MOST_DESIGNS)
    ranked, ranks = dataset.sel(experiment=names[::every]), np.arange(1, len(names) + 1, every)
    axes = style.panels(figure, len(PANELS) // COLUMNS, COLUMNS, FRAME, GAPS, sharex=True)
    for panel, (name, title) in zip(axes.flat, PANELS.items(), strict=True):
        values = ranked[name]
        sizes = outflow.SIZE_CLASSES if "size_class" in values.dims else (None,)
        shifts = 0.25 * every * np.arange(-(len(sizes) // 2), len(sizes) / 2)
        for shift, size in zip(shifts, sizes, strict=True):
            of_size = values if size is None else values.sel(size_class=size)
            colour = style.INK if size is None else style.COLOURS[size]
            runs = of_size.transpose("experiment", "replicate").values
            _draw_runs(panel, ranks + shift, runs, colour, name)
            if name == "relative_deviation":
                random = float(dataset["random_deviation"].sel(size_class=size).mean())
                panel.axhline(random, color=colour, zorder=0, **RANDOM)
        if not np.isfinite(values).any():
            panel.text(0.5, 0.5, "not measured", transform=panel.transAxes, ha="center", color=style.FAINT)
            panel.set_yticks([])
        panel.set_title(title, loc="left")
        panel.set_xlim(1 - 0.8 * every, ranks[-1] + 0.8 * every)
        panel.locator_params(axis="y", nbins=5)
        panel.locator_params(axis="x", integer=True)
    for panel in axes[-1]:
        panel.set_xlabel("rank of the design")
    looks = {size: {**DOTS, "color": style.COLOURS[size]} for size in outflow.SIZE_CLASSES}
    style.key(figure, looks | {"random mixture": RANDOM}, (FRAME.left, 109))
    return figure


def _draw_runs(panel, places, values, colour, name):
    """Draw means and ranges of (design, run) at places (design,); none where a design has no run."""
    rows = np.flatnonzero(np.isfinite(values).any(axis=1))
    mean, least, largest = (pick(values[rows], axis=1) for pick in (np.nanmean, np.nanmin, np.nanmax))
    if name.startswith("U"):
        mean, least, largest = map(outflow.signed_root, (mean, least, largest))
    panel.vlines(places[rows], least, largest, color=colour, linewidth=0.5)
    panel.plot(places[rows], mean, color=colour, **DOTS)
