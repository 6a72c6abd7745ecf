"""The Pareto front, the design selected from it, and what simulations say."""

import os
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from hopperopt import files, outflow
from hopperopt.figures import labels, style
from hopperopt.surrogate import features

COLUMNS = ["J_fine", "J_intermediate"]
NETWORK = "#009E73"
FRONT = {"color": NETWORK, "marker": "o", "markersize": 1.8, "linewidth": 0.7}
SELECTED = {"color": NETWORK, "marker": "*", "markersize": 8}
IMPOSSIBLE = {"color": NETWORK, "marker": "o", "markersize": 2.5, "markerfacecolor": "none"}
PREDICTED = {"color": NETWORK, "marker": "o", "markersize": 3.5}
SIMULATED = {"color": style.INK, "marker": "D", "markersize": 4, "markerfacecolor": "white"}
PLAN = {"color": "#909090", "marker": "o", "markersize": 2.8, "markerfacecolor": "none"}
INFILL = {"color": "#0072B2", "marker": "^", "markersize": 3.2, "markerfacecolor": "none"}
PROPOSED = "infill_"  # begins the names of the designs of infill
CLOSEST = 5e-4  # least range of a panel; differences in J below it are nothing to look at
ARROW = {"arrowstyle": "->", "linewidth": 0.6, "color": style.INK, "shrinkB": 3}


def write(
    params: Mapping,
    front: str | os.PathLike,
    dataset: str | os.PathLike,
    verdict: str | os.PathLike,
    outputs: Sequence[str | os.PathLike],
) -> None:
    """Draw the front; params: `dpi`; front, dataset, verdict: paths of front.csv, dataset.nc, verdict.csv."""
    tables = files.read_table(front), files.read_netcdf(dataset), files.read_table(verdict)
    style.save(draw(*tables), outputs, params["dpi"])


@style.styled
def draw(front: pd.DataFrame, dataset: xr.Dataset, verdict: pd.DataFrame) -> Figure:
    """Draw J_i over J_f: the front as predicted, and the same among the simulations.

    front: columns J_fine, J_intermediate, feasible, selected and the factors; dataset: that of the plan and
    of the rounds of infill; verdict: a row per verification case and objective. Simulated objectives are
    sign(U) sqrt|U|, below zero where a curve departs less from the batch than noise alone does on average. An
    arrow leads from a case's prediction to its simulation; bars are intervals of 90 %.
    """
    figure = style.page(style.PAGE, 78)
    near, far = style.panels(figure, 1, 2, style.Frame(15, 3.5, 8.5, 10), (17, 0))[0]
    for panel, title in ((near, "predicted by the surrogate"), (far, "simulated, noise subtracted")):
        panel.set(xlabel=style.OBJECTIVES["fine"], ylabel=style.OBJECTIVES["intermediate"])
        panel.set_title(title, loc="left")
        panel.locator_params(nbins=6)
        _draw_front(panel, front)
    _keep_away(near)
    _label_selected(near, front)
    proposed = dataset["experiment"].str.startswith(PROPOSED)
    groups = [(PLAN, dataset.isel(experiment=~proposed)), (INFILL, dataset.isel(experiment=proposed))]
    _draw_simulated(far, front, [(look, _objectives(data)) for look, data in groups], verdict)
    style.key(figure, _meanings(front, proposed.any()), (2, 77))
    return figure


def _meanings(front, infill):
    """What lines and marks mean, see style.key."""
    marks = {"prediction of a case": PREDICTED, "case, simulated": SIMULATED}
    marks |= {"plan": PLAN, "infill": INFILL} if infill else {"plan, simulated": PLAN}
    if not front["feasible"].all():
        marks = {"impossible mass fractions": IMPOSSIBLE, **marks}
    if front["selected"].any():
        marks = {"selected": SELECTED, **marks}
    return {"front": FRONT, **{text: {"linestyle": "", **look} for text, look in marks.items()}}


def _draw_front(panel, front):
    points = front[COLUMNS].to_numpy(float)
    feasible, selected = (front[name].to_numpy(bool) for name in ("feasible", "selected"))
    panel.plot(*points[feasible].T, **FRONT)
    panel.plot(*points[~feasible].T, linestyle="", **IMPOSSIBLE)
    panel.plot(*points[selected].T, linestyle="", zorder=4, **SELECTED)


def _keep_away(panel):
    """Show at least a range of `CLOSEST`, around a front that is shorter."""
    for (low, high), limit in ((panel.get_xlim(), panel.set_xlim), (panel.get_ylim(), panel.set_ylim)):
        half = max(high - low, CLOSEST) / 2
        limit((low + high) / 2 - half, (low + high) / 2 + half)


def _label_selected(panel, front):
    """Write the selected design beside its point, if it is one of the front's."""
    for _, row in front[front["selected"].astype(bool)].iterrows():
        design = {name: row[name] for name in front.columns if name not in (*COLUMNS, "feasible", "selected")}
        text = style.design_text(design).replace(", ", "\n")
        labels.at_points(panel, {text: tuple(row[COLUMNS])}, _along(front[COLUMNS].to_numpy(float)))


def _draw_simulated(panel, front, groups, verdict):
    """Draw the experiments, (look, objectives) of each group, and the verification cases, with labels."""
    for line in (panel.axhline, panel.axvline):
        line(0, color=style.FAINT, linewidth=0.5, zorder=0)
    for look, objectives in groups:
        panel.plot(*objectives, linestyle="", zorder=1, **look)
    # A mark that is covered is worse than a line that is touched.
    marks = np.hstack([objectives for _, objectives in groups])
    places, lines = {}, [np.repeat(marks.T, 4, axis=0), _along(front[COLUMNS].to_numpy(float))]
    panel.autoscale_view()
    lines += [_along([(x, 0) for x in panel.get_xlim()]), _along([(0, y) for y in panel.get_ylim()])]
    for case in dict.fromkeys(verdict["case"]):
        rows = verdict[verdict["case"] == case].set_index("objective").loc[list(features.OUTPUTS)]
        simulated = rows["simulated"].to_numpy(float)
        if np.isfinite(simulated).all():
            places[case.replace("_", " ")] = tuple(simulated)
            lines += _draw_case(panel, rows)
    labels.at_points(panel, places, np.vstack(lines))


def _draw_case(panel, rows):
    """Draw prediction and simulation of a case; return points (n, 2) along each line drawn."""
    columns = ["simulated", "low", "high", "predicted"]
    simulated, (left, bottom), (right, top), predicted = rows[columns].to_numpy(float).T
    x, y = simulated
    panel.plot(x, y, zorder=3, **SIMULATED)
    lines = [[(left, y), (right, y)], [(x, bottom), (x, top)]]
    for line in lines:
        panel.plot(*np.transpose(line), color=SIMULATED["color"], linewidth=0.5, zorder=2)
    if np.isfinite(predicted).all():
        panel.plot(*predicted, zorder=2, **PREDICTED)
        panel.annotate("", simulated, predicted, zorder=2, arrowprops=ARROW)
        lines.append([predicted, simulated])
    return [_along(line) for line in lines]


def _along(line):
    """Points (n, 2) closely along a line through given points (m, 2)."""
    line = np.asarray(line, float)
    at = np.linspace(0, len(line) - 1, 50 * len(line))
    return np.column_stack([np.interp(at, np.arange(len(line)), values) for values in line.T])


def _objectives(dataset):
    """Objectives sign(U) sqrt|U| of the designs, (output, experiment)."""
    U = dataset["U_design"].sel(size_class=list(features.OUTPUTS)).transpose("size_class", "experiment")
    return outflow.signed_root(U.values)
