"""The stage `effects`: what each factor of the plan does to the objectives, and how much of it is noise.

The analysis of variance takes U of the designs apart into a linear and a quadratic term for each factor,
fitted one after the other, linear terms first, and the residual between the designs. A term is tested against
the residual, and the residual against the noise between fillings: do these terms lack what the designs do?
(Box, Hunter and Hunter, Statistics for Experimenters, 2005).
"""

import itertools
import logging
import os
from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray as xr
from scipy.special import fdtrc

from hopperopt import files, outflow
from hopperopt.uncertainty import Estimate

OUTPUTS = outflow.SIZE_CLASSES[:2]  # whose objectives there are
WEAK = 10  # times the error of a term of its own, beyond which terms are not told apart
BINS = 5  # of designs, where levels are not repeated
LEAST = 1e-9  # of a term's length, below which nothing of it is left

log = logging.getLogger(__name__)


def effects(params: Mapping, dataset: str | os.PathLike, levels: str | os.PathLike, anova: str | os.PathLike):
    """Write the main effects, effects.csv, and the analysis of variance, anova.csv.

    params: `factors`, their names in order. dataset: path of dataset.nc. What the plan cannot tell apart is
    said in the log.
    """
    data = files.read_netcdf(dataset)
    data = data.isel(experiment=np.flatnonzero(data["runs"].values))
    files.write_table(main_effects(data, params["factors"]), levels)
    files.write_table(analysis_of_variance(data, params["factors"]), anova)
    terms = second_order(scaled_designs(data, params["factors"]), params["factors"])
    log.info(
        f"{data.sizes['experiment']} designs tell {told_apart(terms)} of the {len(terms) + 1} terms of a "
        "second-order model apart (a constant, linear terms, squares, interactions)"
    )


def scaled_designs(data: xr.Dataset, factors) -> np.ndarray:
    """The plan's designs (experiments, factors), each factor's range from -1 to 1."""
    designs = np.column_stack([data[name].values for name in factors])
    low, high = designs.min(axis=0), designs.max(axis=0)
    return (2 * designs - low - high) / np.where(high > low, high - low, 1.0)


def main_effects(data: xr.Dataset, factors) -> pd.DataFrame:
    """J = sign(U) sqrt|U| of the mean U at each level of each factor, with the noise's interval of 90 %.

    `experiments`: names of the designs whose mean it is.
    A factor whose levels the plan does not repeat has bins of equally many designs instead, named by the mean
    value of each.
    """
    U = data[["U_design", "U_design_variance"]].transpose("experiment", "size_class")
    rows = []
    names = data["experiment"].values
    for factor in factors:
        values = data[factor].values
        groups = _groups(values)
        if groups is None:
            groups = np.array_split(np.argsort(values, kind="stable"), max(1, min(BINS, len(values) // 2)))
            log.info(f"{factor}: its levels are not repeated, effects are of {len(groups)} bins of designs")
        for group, name in itertools.product(groups, OUTPUTS):
            part = U.isel(experiment=group).sel(size_class=name)
            mean = Estimate(
                part["U_design"].values.mean(), part["U_design_variance"].values.sum() / len(group) ** 2
            )
            J, low, high = map(outflow.signed_root, (mean.square, *mean.interval()))
            rows.append([factor, values[group].mean(), name, J, low, high, " ".join(names[group])])
    columns = ["factor", "level", "objective", "J", "J_low", "J_high", "experiments"]
    return pd.DataFrame(rows, columns=columns)


def _groups(values):
    """Indices of the designs at each level, the lowest first; None where levels are not repeated."""
    levels = np.unique(values)
    return [np.flatnonzero(values == level) for level in levels] if 2 * len(levels) <= len(values) else None


def analysis_of_variance(data: xr.Dataset, factors) -> pd.DataFrame:
    """The analysis of variance of U: a row per objective and source of variance.

    Sources are `designs` (all that differs between them), the terms, `residual` (tested against the noise: a
    lack of fit) and `noise` (of U between fillings; none without repeated runs). `aliased`: see there.
    Interactions are no terms of the analysis: what they do shows in the terms that they look like, and in the
    residual.
    """
    terms = second_order(scaled_designs(data, factors), factors)
    fitted = list(terms)[: 2 * len(factors)]
    shares = aliased(terms, fitted)
    repeats = int(np.maximum(data["runs"].values - 1, 0).sum())
    parts = []
    for name in OUTPUTS:
        U = data["U_design"].sel(size_class=name).values
        noise = float(data["U_design_variance"].sel(size_class=name).mean()) if repeats else np.nan
        total = float(np.sum((U - U.mean()) ** 2))
        squares = _explained(U, [terms[term] for term in fitted])
        freedom = len(U) - 1 - np.count_nonzero(np.isfinite(squares))
        sums = {"designs": total, **dict(zip(fitted, squares, strict=True))}
        table = pd.DataFrame({"sum_of_squares": sums | {"residual": total - np.nansum(squares)}})
        table["df"] = [len(U) - 1, *np.isfinite(squares).astype(int), freedom]
        table.loc["noise", "df"] = repeats
        table["mean_square"] = table["sum_of_squares"] / table["df"].where(table["df"] > 0)
        table.loc["noise", "mean_square"] = noise
        residual = table.loc["residual", "mean_square"]
        table.loc[fitted, "F"] = table.loc[fitted, "mean_square"] / residual
        table.loc[fitted, "p"] = fdtrc(1, freedom, table.loc[fitted, "F"])
        table.loc["residual", ["F", "p"]] = residual / noise, fdtrc(freedom, repeats, residual / noise)
        parts.append(table.reindex([*table.index[:-2], *list(terms)[len(fitted) :], "residual", "noise"]))
        parts[-1].insert(0, "objective", name)
    table = pd.concat(parts).rename_axis("source").reset_index()
    table["aliased"] = table["source"].map(shares)
    columns = ["objective", "source", "df", "sum_of_squares", "mean_square", "F", "p", "aliased"]
    return table[columns].astype({"df": "Int64"})


def second_order(designs: np.ndarray, factors) -> dict[str, np.ndarray]:
    """Terms of a second-order model at scaled designs (n, factors), by name, each (n,) with mean 0.

    Linear terms first, then the squares, then the interactions of two factors.
    """
    by_factor = dict(zip(factors, designs.T, strict=True))
    terms = {
        **by_factor,
        **{f"{name}^2": values**2 for name, values in by_factor.items()},
        **{f"{a} x {b}": by_factor[a] * by_factor[b] for a, b in itertools.combinations(factors, 2)},
    }
    return {name: values - values.mean() for name, values in terms.items()}


def aliased(terms: Mapping[str, np.ndarray], fitted) -> dict[str, float]:
    """Share of each term's sum of squares that terms of the other kind, fitted or not, look like.

    So much of an interaction is taken for fitted terms, and so much of a fitted term may be interactions.
    """
    shares = {}
    for name, values in terms.items():
        others = [other for key, other in terms.items() if (key in fitted) != (name in fitted)]
        square = float(values @ values)
        if others and square > LEAST:
            matrix = np.column_stack(others)
            rest = values - matrix @ np.linalg.lstsq(matrix, values)[0]
            shares[name] = 1 - float(np.sum(rest**2)) / square
    return shares


def told_apart(terms: Mapping[str, np.ndarray]) -> int:
    """Number of terms, the constant one among them, that the plan tells apart: the rank of their matrix.

    Combinations of terms known with more than WEAK times the error that terms of their own would have do not
    count.
    """
    lengths = np.array([np.linalg.norm(values) for values in terms.values()])
    matrix = np.column_stack(list(terms.values())) / np.where(lengths > LEAST, lengths, np.inf)
    return 1 + int(np.sum(np.linalg.svd(matrix, compute_uv=False) > 1 / WEAK))


def _explained(response, terms):
    """Sums of squares that terms explain one after the other; NaN for one that its predecessors make up."""
    basis, squares = [np.full(len(response), len(response) ** -0.5)], []
    for term in terms:
        rest = term - sum((term @ direction) * direction for direction in basis)
        if np.linalg.norm(rest) <= LEAST * max(np.linalg.norm(term), 1):
            squares.append(np.nan)
            continue
        basis.append(rest / np.linalg.norm(rest))
        squares.append(float(response @ basis[-1]) ** 2)
    return np.array(squares)
