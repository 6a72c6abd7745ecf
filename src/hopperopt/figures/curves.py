"""Composition of the outflow in every experiment of the plan (figure 3)."""

import os
from collections.abc import Mapping, Sequence

import xarray as xr
from matplotlib.figure import Figure

from hopperopt import files
from hopperopt.figures import labels, multiples, style


def write(params: Mapping, dataset: str | os.PathLike, outputs: Sequence[str | os.PathLike]) -> None:
    """Draw a data set; params: `dpi`; dataset: path of dataset.nc; outputs: paths, PNG or PDF."""
    style.save(draw(files.read_netcdf(dataset)), outputs, params["dpi"])


@style.styled
def draw(dataset: xr.Dataset) -> Figure:
    """Draw m_k(M) of every experiment, the mean of its replicates; several are drawn thinly as well.

    Thin straight lines are the mass fractions of the batch. A panel without a complete run says so.
    """
    figure, panels = multiples.grid(dataset)
    M, target = dataset["M"].values, dataset["target_fraction"]
    panels[0].set_ylim(0, 1)
    panels[0].set_yticks([0, 0.5, 1], ["0", "0.5", "1"])
    for row, panel in enumerate(panels):
        for name in style.COLOURS:
            colour = style.COLOURS[name]
            runs = (
                dataset["mass_fraction"]
                .isel(experiment=row)
                .sel(size_class=name)
                .dropna("replicate", how="all")
            )
            panel.axhline(target.sel(size_class=name), color=colour, linewidth=0.5, alpha=0.7)
            if runs.sizes["replicate"] > 1:
                panel.plot(M, runs.transpose("M", "replicate"), color=colour, linewidth=0.4, alpha=0.5)
            if runs.sizes["replicate"]:
                panel.plot(M, runs.mean("replicate"), color=colour, clip_on=False)
        if dataset["mass_fraction"][row].isnull().all():
            panel.text(0.5, 0.5, "no complete run", ha="center", va="center", color=style.FAINT)
    columns = panels[0].get_subplotspec().get_gridspec().ncols
    for panel in panels[columns - 1 :: columns]:
        labels.at_ends(
            panel, {style.SYMBOLS[k]: (float(target.sel(size_class=k)), c) for k, c in style.COLOURS.items()}
        )
    return figure
