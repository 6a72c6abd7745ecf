"""Outflow at the optimum, predicted and simulated (figure 5)."""

import json
import os
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from hopperopt import files, outflow
from hopperopt.figures import labels, style
from hopperopt.surrogate import features, prediction

PREDICTED = {"marker": "o", "markersize": 2.6, "linewidth": 0.8, "clip_on": False}
SIMULATION = {"linestyle": "", "marker": "o", "markersize": 4, "markerfacecolor": "none", "clip_on": False}
BAND = {"linewidth": 5, "color": style.FAINT, "alpha": 0.5, "solid_capstyle": "butt"}
SIGMAS = 1.64  # nine of ten points of a smooth curve's simulation lie within them


def write(
    params: Mapping,
    simulations: Sequence[str | os.PathLike],
    surrogate: str | os.PathLike,
    outputs: Sequence[str | os.PathLike],
) -> None:
    """Draw a case; params: `dpi`; simulations: the files of its runs; surrogate: path of model.nc."""
    runs, predictor = [files.read_netcdf(path) for path in simulations], prediction.load(surrogate)
    design = json.loads(runs[0].attrs["case"])["design"]
    predicted = predictor.curves(predictor.array(design))[0] if design else None
    usable = [run for run in runs if run["status"].item() == "complete"]
    style.save(draw(usable, design, predictor.batch, predicted), outputs, params["dpi"])


@style.styled
def draw(
    runs: Sequence[xr.Dataset],
    design: Mapping[str, float],
    batch: np.ndarray,
    predicted: np.ndarray | None,
) -> Figure:
    """Draw the simulated m_f and m_i (open markers, mean of the runs) and the predicted ones (solid).

    batch (output,): mass fractions m_k0; predicted (output, M), None for a hopper without an insert. The band
    around the prediction (without one, around the batch's mass fraction) is 1.64 standard deviations of the
    simulation's counting noise: where it is right, nine points of ten lie in it.
    """
    figure = style.page(style.COLUMN, 72)
    axes = style.panels(figure, 1, 1, style.Frame(11.5, 7, 8.5, 10.5), (0, 0))[0, 0]
    simulated, noise = _simulated(runs)
    for k, name in enumerate(features.OUTPUTS):
        colour = style.COLOURS[name]
        middle = np.full(outflow.GRID.size, batch[k]) if predicted is None else predicted[k]
        axes.axhline(batch[k], color=colour, linewidth=0.5, alpha=0.7)
        if predicted is not None:
            axes.plot(outflow.GRID, middle, color=colour, **PREDICTED)
        if runs:
            limits = middle - SIGMAS * noise[k], middle + SIGMAS * noise[k]
            axes.fill_between(outflow.GRID, *limits, color=colour, alpha=0.18, linewidth=0)
            axes.plot(outflow.GRID, simulated[k], color=colour, **SIMULATION)
    axes.set(xlim=(-0.02, 1.02), xlabel=style.DISCHARGED, ylabel="mass fraction in the outflow")
    axes.set_ylim(min(0.0, *(np.min(line.get_ydata()) for line in axes.lines)))
    ends = {style.SYMBOLS[k]: (m, style.COLOURS[k]) for k, m in zip(features.OUTPUTS, batch, strict=True)}
    labels.at_ends(axes, ends)
    style.put(figure, 2, 71, style.design_text(design), va="top")
    style.key(figure, _meanings(len(runs), predicted is not None), (2, 67))
    return figure


def _simulated(runs):
    """Mean mass fractions and their counting noise, two arrays (output, M); None for both without a run."""
    if not runs:
        return None, None
    names = ("exit_time", "diameter", "size_class")
    flows = [outflow.outflow(*(run[name].values for name in names)) for run in runs]
    variance = np.mean([flow.counting_variance for flow in flows], axis=0) / len(flows)
    return np.mean([flow.mass_fraction for flow in flows], axis=0), np.sqrt(variance)


def _meanings(runs, predicted):
    """What lines and marks mean, see style.key."""
    meanings = {"prediction": PREDICTED} if predicted else {}
    if not runs:
        return {**meanings, "no complete simulation": {"linestyle": ""}}
    words = "simulation" if runs == 1 else f"{runs} simulations"
    return {**meanings, words: SIMULATION, "counting noise, 90 %": BAND}
