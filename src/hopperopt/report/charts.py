"""The data of the page's charts as plain JSON values: numbers rounded to what a screen can show."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike

from hopperopt import uncertainty
from hopperopt.dataset import replicates
from hopperopt.report import answer, drawing
from hopperopt.surrogate.features import OUTPUTS

DIGITS = 4  # decimals of mass fractions
MOST_POINTS = 200  # of a front; of a longer one every so manyth is shown
OBJECTIVES = ("J_fine", "J_intermediate")


def numbers(values: ArrayLike, digits: int = DIGITS) -> list:
    """Nested lists of an array, rounded; None for what is not finite, which JSON does not know."""
    rounded = np.round(np.asarray(values, float), digits).astype(object)
    rounded[~np.isfinite(np.asarray(values, float))] = None
    return rounded.tolist()


def curves(dataset: xr.Dataset, factors: Sequence[str]) -> dict:
    """Mean curves m_k(M) of the plan's experiments with the half-widths of their bands of 90 %."""
    runs = replicates(dataset)
    half = half_widths(runs, dataset["pooled_variance"].values)
    designs = np.column_stack([dataset[name].values for name in factors])
    return {
        "M": numbers(dataset["M"]),
        "classes": list(map(str, dataset["size_class"].values)),
        "batch": numbers(dataset["target_fraction"]),
        "experiments": [
            {
                "name": str(name),
                "design": answer.design_words(dict(zip(factors, design, strict=True))),
                "runs": int(number),
                "mean": numbers(mean),
                "half": numbers(width),
            }
            for name, design, number, mean, width in zip(
                dataset["experiment"].values, designs, runs.number[:, 0, 0], runs.mean, half, strict=True
            )
        ],
    }


def half_widths(runs: uncertainty.Runs, pooled: np.ndarray) -> np.ndarray:
    """Half-widths of the bands of 90 % around mean curves, (..., size class, M)."""
    return uncertainty.SIGMAS * np.sqrt(uncertainty.mean_variance(runs, pooled))


def outflows(runs: uncertainty.Runs) -> list[dict]:
    """Mean curves of cases, (case, size class, M), with their bands."""
    half = half_widths(runs, uncertainty.pooled_variance(runs))
    return [
        {"mean": numbers(mean), "half": numbers(width)} for mean, width in zip(runs.mean, half, strict=True)
    ]


def front(table: pd.DataFrame, factors: Sequence[str], walls_of: Callable[[Mapping], Mapping | None]) -> list:
    """Points of the front: predicted J, values of the factors, and the insert's outline.

    table: as front.csv; walls_of: function of a design that gives its walls, see
    figures.hopper.walls_of, or None for a design that cannot be built.
    """
    keep = np.zeros(len(table), bool)
    keep[:: -(-len(table) // MOST_POINTS)] = True
    keep |= table["selected"].to_numpy(bool)
    points = []
    for _, row in table[keep].iterrows():
        walls = walls_of({name: float(row[name]) for name in factors})
        points.append(
            {
                "J": numbers(row[list(OBJECTIVES)], 6),
                "values": [value_words(name, row[name]) for name in factors],
                "selected": bool(row["selected"]),
                "feasible": bool(row["feasible"]),
                "built": walls is not None,
                "insert": drawing.outline(walls["insert"]).path if walls and "insert" in walls else "",
            }
        )
    return points


def effects(
    table: pd.DataFrame, dataset: xr.Dataset, words: Mapping[str, str], selected: Mapping[str, float]
) -> list[dict]:
    """Main effects: the levels of each factor, and at each J with its interval for each objective.

    table: as effects.csv; words: plain names of the factors; selected: the design that the study selected.
    """
    found = []
    for factor, rows in table.groupby("factor", sort=False):
        by_objective = {name: rows[rows["objective"] == name] for name in OUTPUTS}
        first = by_objective[OUTPUTS[0]]
        experiments = [names.split() for names in first["experiments"]]
        found.append(
            {
                "name": words[factor],
                "unit": answer.plain(answer.style.factor_parts(factor)[1]).strip(),
                "selected": selected[factor],
                "levels": first["level"].tolist(),
                "words": [_span(factor, dataset[factor].sel(experiment=names)) for names in experiments],
                "experiments": experiments,
                "J": {name: numbers(own[["J", "J_low", "J_high"]], 6) for name, own in by_objective.items()},
            }
        )
    return found


def _span(factor, values):
    """A level in words, or the range of a bin of designs."""
    ends = dict.fromkeys(value_words(factor, float(end)) for end in (values.min(), values.max()))
    return " to ".join(ends)


def value_words(factor: str, value: float) -> str:
    """Value of a factor with its unit."""
    return f"{value:.3g}{answer.plain(answer.style.factor_parts(factor)[1])}"
