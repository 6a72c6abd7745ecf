"""Errors of the networks against the number of their hidden nodes."""

import os
from collections.abc import Mapping, Sequence

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from hopperopt import files
from hopperopt.figures import labels, style
from hopperopt.surrogate import features

USES = {
    "training": {"color": "#333333", "marker": "o"},
    "validation": {"color": "#009E73", "marker": "s"},
    "test": {"color": "#CC79A7", "marker": "D"},
    "cross_validation": {"color": "#E69F00", "marker": "^"},
}


def write(params: Mapping, errors: str | os.PathLike, outputs: Sequence[str | os.PathLike]) -> None:
    """Draw the errors; params: `dpi`; errors: path of errors.csv; outputs: paths, PNG or PDF."""
    style.save(draw(files.read_table(errors)), outputs, params["dpi"])


@style.styled
def draw(errors: pd.DataFrame) -> Figure:
    """Draw the root mean square errors of m_f and m_i for training, validation and test.

    errors: a row per hidden size, columns hidden, selected and {use}_rmse_{output}; those of the
    cross-validation are empty where there was none. A dashed line marks the network that is used.
    """
    errors = errors.sort_values("hidden")
    figure = style.page(style.COLUMN, 92)
    axes = style.panels(figure, 2, 1, style.Frame(13, 24, 8.5, 5), (0, 6), sharex=True)[:, 0]
    for panel, name in zip(axes, features.OUTPUTS, strict=True):
        ends = {}
        for use, look in USES.items():
            values = errors[f"{use}_rmse_{name}"]
            if values.notna().any():
                panel.plot(errors["hidden"], values, **look, clip_on=False)
                ends[use.replace("_", "-")] = (values.iloc[-1], look["color"])
        panel.set_ylim(0)
        panel.locator_params(axis="y", nbins=5)
        panel.set_title(f"rms error of {style.SYMBOLS[name]}", loc="left")
        labels.at_ends(panel, ends)
        for hidden in errors.loc[errors["selected"].astype(bool), "hidden"]:
            panel.axvline(hidden, color=style.FAINT, linewidth=0.7, linestyle="--", zorder=0)
            panel.annotate("selected", (hidden, 0), (2, 2), textcoords="offset points", color="#777777")
    axes[-1].set_xlabel("hidden nodes")
    axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure
