"""The stage `propose`: the designs of a round of infill, where the surrogate expects most of them.

A design may lower J_f, J_i or both: what it is worth is the expected hypervolume improvement (Emmerich,
Giannakoglou and Naujoks 2006), the mean over draws of the Gaussian processes of the area, below a corner,
that its J add to what the simulated designs dominate by their posterior J. The designs of a batch are found
one after the other, each with those before it taken as simulated with the outcome that is predicted (the
kriging believer of Ginsbourger, Le Riche and Carraro 2010).
"""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import qmc

from hopperopt import files
from hopperopt.optimum import OBJECTIVES, non_dominated
from hopperopt.outflow import objective
from hopperopt.surrogate import prediction
from hopperopt.surrogate.features import violation
from hopperopt.surrogate.gaussian import Gaussian

APART = 0.05  # least distance from what is simulated, of the range of at least one factor
CORNER = 1.1  # the hypervolumes' corner, in the largest posterior J of the plan
CANDIDATES = 512  # designs all over the ranges, beside those of the front (power of 2)
DRAWS = 200


def propose(
    params: Mapping,
    surrogate: str | os.PathLike,
    plan: str | os.PathLike,
    front: str | os.PathLike,
    proposals: Sequence[str | os.PathLike],
    output: str | os.PathLike,
) -> None:
    """Write proposals.csv, the designs of one round.

    params: `names` of its designs, as many as there are; `round`, from 1; `bounds` {factor: [low, high]};
    `replicates`, runs of each design; `seed`; `case_of`, a function of a design that returns its case, None
    where it cannot be built. surrogate: path of model.nc, Gaussian processes of all that is simulated so far;
    plan: of those of the plan alone, whose largest J fix the corner of all rounds; front: path of front.csv,
    of the first surrogate; proposals: those of proposals.csv of the rounds before, of whose designs all runs
    may have been dropped. Raises files.InputError where no design of the ranges can be built.
    """
    predictor, known = prediction.load(surrogate), prediction.load(plan)
    points = files.read_table(front, "selected", *predictor.factors)
    points = points.sort_values("selected", ascending=False, kind="stable")[list(predictor.factors)]
    earlier = [files.read_table(path, *predictor.factors)[list(predictor.factors)] for path in proposals]
    taken = pd.concat([points.iloc[:0], *earlier]).to_numpy(float)
    files.write_table(designs(params, predictor, corner(known), points.to_numpy(float), taken), output)


def corner(plan: prediction.Predictor) -> np.ndarray:
    """The corner (2,) of all hypervolumes; plan: processes of the plan alone."""
    return CORNER * plan.objectives(processes(plan).designs).max(axis=0)


def designs(
    params: Mapping,
    predictor: prediction.Predictor,
    limits: np.ndarray,
    front: np.ndarray,
    taken: np.ndarray,
) -> pd.DataFrame:
    """The designs of a round, a row each: what proposals.csv holds.

    params: as in `propose`; limits: the corner (2,); front (n, factors): designs of the front, the selected
    one first; taken (m, factors): those of the rounds before.
    """
    names = list(predictor.factors)
    bounds = np.array([params["bounds"][name] for name in names], dtype=float)
    low, high = bounds.T
    sampler = qmc.Sobol(len(bounds), rng=np.random.default_rng([params["seed"], params["round"]]))
    candidates = np.vstack([front, low + sampler.random(CANDIDATES) * (high - low)])

    def can_be_built(design):
        return params["case_of"](dict(zip(names, map(float, design), strict=True))) is not None

    search = Search(bounds, limits, params["replicates"], can_be_built, taken)
    chosen = batch(predictor, candidates, len(params["names"]), search, params["seed"])
    table = pd.DataFrame(candidates[[row.candidate for row in chosen]], columns=names)
    table[list(OBJECTIVES)] = predictor.objectives(table.to_numpy())
    table.insert(0, "experiment", params["names"])
    table["chosen_as"] = [row.reason for row in chosen]
    table["expected_improvement"] = [row.improvement for row in chosen]
    return table


def processes(predictor: prediction.Predictor) -> Gaussian:
    """The predictor's Gaussian processes. Raises files.InputError for another surrogate."""
    if not isinstance(predictor.model, Gaussian):
        raise files.InputError("infill: designs are proposed by Gaussian processes, not by a network")
    return predictor.model


class Search(NamedTuple):
    """What a batch keeps to."""

    bounds: np.ndarray  # (factors, 2)
    corner: np.ndarray  # (2,) of the hypervolumes
    replicates: int  # runs that each design will have
    can_be_built: Callable[[np.ndarray], bool]
    taken: np.ndarray  # (m, factors) designs that were proposed before, simulated or not


class Choice(NamedTuple):
    """A design of a batch."""

    candidate: int
    reason: str  # "selected" from the front, or for its "improvement"
    improvement: float  # expected, of the hypervolume, relative to that of the simulated designs


def batch(
    predictor: prediction.Predictor, candidates: np.ndarray, number: int, search: Search, seed: int
) -> list[Choice]:
    """Choose so many of the candidates (n, factors), the first of which is the design selected from the
    front.

    That one comes first, then those of the largest expected improvement; each is at least a twentieth of the
    range of some factor away from all that is simulated, was proposed before or is chosen, as long as there
    is such a design.
    Impossible mass fractions are chosen only where nothing else is predicted. Raises files.InputError where
    too few candidates can be built.
    """
    chosen: list[Choice] = []
    possible = violation(predictor.curves(candidates)) <= 0
    left = possible.copy() if possible.any() else np.ones(len(candidates), dtype=bool)
    while len(chosen) < number:
        simulated = processes(predictor).designs
        gain = expected_improvement(predictor, candidates, search.corner, np.random.default_rng(seed))
        distance = separation(candidates, np.vstack([simulated, search.taken]), search.bounds)
        order = np.lexsort([distance, gain, distance >= APART])[::-1]
        selected = not chosen and distance[0] >= APART
        order = np.concatenate([[0], order]) if selected else order
        found = next((c for c in order if left[c] and search.can_be_built(candidates[c])), None)
        if found is None:
            raise files.InputError(
                f"infill: of {len(candidates)} designs within the factors' ranges only {len(chosen)} can be "
                f"built, a round needs {number}"
            )
        reason = "selected" if selected and found == 0 else "improvement"
        chosen.append(Choice(int(found), reason, gain[found]))
        left[found] = False
        believed = processes(predictor).believing(candidates[found], search.replicates)
        predictor = predictor._replace(model=believed)
    return chosen


def expected_improvement(
    predictor: prediction.Predictor, candidates: np.ndarray, corner: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Expected hypervolume improvement (n,) of candidates, relative to what the simulated designs have.

    Those count with their posterior J; where they have no hypervolume below the corner, the whole rectangle
    from the origin to it takes its place.
    """
    incumbents = predictor.objectives(processes(predictor).designs)
    J = objective(predictor.draws(candidates, DRAWS, rng), predictor.batch)
    gain = improvement(J, incumbents, corner).mean(axis=0)
    whole = float(np.prod(corner)) - float(improvement(np.zeros(2), incumbents, corner))
    return gain / (whole if whole > 0 else np.prod(corner))


def improvement(points: np.ndarray, incumbents: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """Area (...) that each of the points (..., 2) adds to what incumbents (m, 2) dominate below a corner
    (2,).

    The area that no incumbent dominates is cut into strips at the incumbents' first coordinates.
    """
    inside = incumbents[(incumbents < corner).all(axis=1)]
    front = inside[non_dominated(inside)] if len(inside) else inside
    front = front[np.argsort(front[:, 0])]
    left = np.concatenate([[-np.inf], front[:, 0]])
    right = np.concatenate([front[:, 0], corner[:1]])
    top = np.concatenate([corner[1:], front[:, 1]])
    x, y = points[..., 0, None], points[..., 1, None]
    return (np.maximum(right - np.maximum(left, x), 0) * np.maximum(top - y, 0)).sum(axis=-1)


def separation(designs: np.ndarray, others: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Distance (n,), in ranges, of designs from the nearest of others (m, factors): largest of factors."""
    differences = np.abs(designs[:, None] - others) / np.ptp(bounds, axis=1)
    return differences.max(axis=-1).min(axis=1)
