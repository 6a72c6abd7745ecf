"""Composition of the outflow in every experiment of the plan (figure 3)."""

import os
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from hopperopt import files, uncertainty
from hopperopt.dataset import replicates
from hopperopt.figures import labels, multiples, style


def write(params: Mapping, dataset: str | os.PathLike, outputs: Sequence[str | os.PathLike]) -> None:
    """Draw at most 100 experiments of a data set.

    params: `dpi`; dataset: path of dataset.nc; outputs: paths, PNG or PDF.
    """
    style.save(draw(multiples.some(files.read_netcdf(dataset))), outputs, params["dpi"])


@style.styled
def draw(dataset: xr.Dataset) -> Figure:
    """Draw m_k(M) of every experiment, the mean of its replicates, in a band of 90 %.

    The band is 1.64 standard deviations of the mean to either side, from the scatter between replicates, or
    from counting where there is but one run. Thin straight lines are the mass fractions of the batch. A panel
    without a complete run says so.
    """
    figure, panels = multiples.grid(dataset)
    M, target = dataset["M"].values, dataset["target_fraction"]
    runs = replicates(dataset)
    half = uncertainty.SIGMAS * np.sqrt(uncertainty.mean_variance(runs, dataset["pooled_variance"].values))
    panels[0].set_ylim(0, 1)
    panels[0].set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
    for row, panel in enumerate(panels):
        for name, mean, band in zip(dataset["size_class"].values, runs.mean[row], half[row], strict=True):
            colour = style.COLOURS[name]
            panel.axhline(float(target.sel(size_class=name)), color=colour, linewidth=0.5, alpha=0.7)
            if np.isfinite(mean).all():
                panel.fill_between(M, mean - band, mean + band, color=colour, alpha=0.25, linewidth=0)
                panel.plot(M, mean, color=colour, clip_on=False)
        if not runs.number[row].any():
            panel.text(0.5, 0.5, "no complete run", ha="center", va="center", color=style.FAINT)
    for panel in multiples.last_column(panels):
        labels.at_ends(
            panel, {style.SYMBOLS[k]: (float(target.sel(size_class=k)), c) for k, c in style.COLOURS.items()}
        )
    return figure
