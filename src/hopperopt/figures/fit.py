"""What the network was trained on and what it predicts, in every experiment (figure 4)."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopperopt import files
from hopperopt.figures import labels, multiples, style
from hopperopt.surrogate import prediction

HEADROOM = 1.2  # for the words at the top of a panel
TINTS = {"validation": "#E6F4F0", "test": "#F8EBF3"}
MARKERS = {"validation": "s", "test": "o"}
HOLLOW: Mapping[str, Any] = {"markerfacecolor": "white", "markersize": 2.5, "clip_on": False}


def write(
    params: Mapping,
    training: str | os.PathLike,
    network: str | os.PathLike,
    outputs: Sequence[str | os.PathLike],
) -> None:
    """Draw targets and network of at most 100 experiments.

    params: `dpi`; training, network: paths of training.nc and network.nc; outputs: paths, PNG or PDF.
    """
    data, predictor = multiples.some(files.read_netcdf(training)), prediction.load(network)
    designs = np.column_stack([data[name].values for name in predictor.factors])
    style.save(draw(data, predictor.curves(designs)), outputs, params["dpi"])


@style.styled
def draw(training: xr.Dataset, predicted: np.ndarray) -> Figure:
    """Draw targets (dotted) and network (solid) of every experiment.

    training: as the stage `filter` writes it; predicted (experiment, output, M): the network's curves. The
    targets are those after the clip; a cross is a point that it moved, where the simulation had put it.
    Panels of the validation and test experiments are named and tinted. With a split by points their points
    are marked instead.
    """
    figure, panels = multiples.grid(training, _meanings(training))
    drawn = np.stack([training["target"], training["target_clipped"], predicted])
    bottom, top = min(drawn.min(), 0.0), drawn.max()
    panels[0].set_ylim(bottom, HEADROOM * top)
    for row, panel in enumerate(panels):
        experiment = training.isel(experiment=row)
        for column, name in enumerate(training["output"].values):
            _draw_output(panel, experiment.sel(output=name), predicted[row, column], style.COLOURS[name])
        _mark_use(panel, experiment)
    batch = training["target_fraction"].to_series()
    for panel in multiples.last_column(panels):
        labels.at_ends(panel, {style.SYMBOLS[k]: (m, style.COLOURS[k]) for k, m in batch.items()})
    return figure


def _draw_output(panel: Axes, output: xr.Dataset, predicted: np.ndarray, colour: str) -> None:
    M, simulated, target = (output[name].values for name in ("M", "target", "target_clipped"))
    panel.axhline(output["target_fraction"].item(), color=colour, linewidth=0.5, alpha=0.5)
    panel.plot(M, target, color=colour, linestyle=":", clip_on=False)
    panel.plot(M, predicted, color=colour, clip_on=False)
    moved = simulated != target
    panel.plot(M[moved], simulated[moved], "x", color=colour, markersize=3, clip_on=False)
    if output["split"].ndim:
        for use, marker in MARKERS.items():
            own = output["split"].values == use
            panel.plot(M[own], target[own], marker, color=colour, **HOLLOW)


def _mark_use(panel: Axes, experiment: xr.Dataset) -> None:
    """Name and tint the panel of an experiment that did not train the network."""
    use = experiment["split"]
    if use.ndim or use.item() not in TINTS:
        return
    panel.set_facecolor(TINTS[use.item()])
    panel.text(0.5, 0.97, use.item(), transform=panel.transAxes, ha="center", va="top")


def _meanings(training):
    """What lines and marks mean, see style.key."""
    meanings = {"target": {"linestyle": ":"}, "network": {}}
    if (training["target"] != training["target_clipped"]).any():
        meanings["simulated, before the clip"] = {"linestyle": "", "marker": "x"}
    if training["split"].ndim > 1:
        meanings |= {use: {"linestyle": "", **HOLLOW, "marker": marker} for use, marker in MARKERS.items()}
    return meanings
