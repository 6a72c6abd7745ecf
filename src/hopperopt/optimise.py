"""The stage `optimise`: NSGA-II on the surrogate, its Pareto front, and the design chosen from it."""

import logging
import os
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.callback import Callback
from pymoo.core.problem import Problem
from pymoo.indicators.hv import HV
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.optimize import minimize

from hopperopt.files import write_netcdf, write_table, write_yaml
from hopperopt.optimum import OBJECTIVES, choose, non_dominated, spread, widened
from hopperopt.surrogate import prediction
from hopperopt.surrogate.features import OUTPUTS, factor_grid, violation

GRID_DESIGNS = 10_000  # size of the grid on which impossible predictions are counted, about
MARGIN = 0.1  # of the fronts' range, from their worst point to the corner of their hypervolumes

log = logging.getLogger(__name__)


class Front(NamedTuple):
    """Non-dominated designs, by rising J of the fine particles."""

    designs: np.ndarray  # (n, factors)
    objectives: np.ndarray  # (n, 2)
    violation: np.ndarray  # (n,) above 0: impossible mass fractions are predicted


def optimise(
    params: Mapping,
    surrogate: str | os.PathLike,
    front: str | os.PathLike,
    history: str | os.PathLike,
    selected: str | os.PathLike,
) -> None:
    """Search the factors' ranges for designs with small J_f and J_i, and choose one.

    params: `bounds` {factor: [low, high]}, `population`, `generations`, `crossover_probability`,
    `mutation_probability`, `seed`, `seeds` (number of searches, from `seed` on), `select` (knee, compromise
    or explicit), `explicit` (a design or None), `centre` (a design), all in the factors' own units.
    surrogate: path of model.nc; front, history, selected: paths of front.csv, history.nc and selected.yaml.
    """
    predictor = prediction.load(surrogate)
    bounds = np.array([params["bounds"][name] for name in predictor.factors], dtype=float)
    searches = search_all(predictor, bounds, params)
    fronts = [found for found, _ in searches]
    found = merged(fronts)
    index, choice = choose(params, predictor, bounds, found.designs, found.objectives)
    choice["beyond_bounds"] = None if index < 0 else beyond(params, predictor, bounds, found.designs[index])
    if choice["beyond_bounds"]:
        choice["warning"] += f"; {_in_words(choice['beyond_bounds'])}"
    if choice["warning"] is not None:
        log.warning(choice["warning"])
    table = pd.DataFrame(
        np.hstack([found.designs, found.objectives]), columns=[*predictor.factors, *OBJECTIVES]
    )
    table["feasible"] = found.violation <= 0
    table["selected"] = np.arange(len(table)) == index
    write_table(table, front)
    write_netcdf(_history([record for _, record in searches], predictor.factors), history)
    choice |= {
        "choice_over_draws": spread(params, predictor, bounds, found.designs),
        "front_points": len(table),
        "hypervolume_of_each_search": agreement(fronts, found),
        "infeasible_grid_predictions": count_impossible(predictor, bounds),
    }
    write_yaml(choice, selected)


def search_all(
    predictor: prediction.Predictor, bounds: np.ndarray, params: Mapping
) -> list[tuple[Front, list]]:
    """Run `search` with each seed, params["seeds"] of them from params["seed"] on."""
    seeds = range(params["seed"], params["seed"] + params["seeds"])
    return [search(predictor, bounds, {**params, "seed": seed}) for seed in seeds]


def merged(fronts: Sequence[Front]) -> Front:
    """The front of all searches; of infeasible points only the least infeasible one, where all are."""
    points = Front(*(np.concatenate(parts) for parts in zip(*fronts, strict=True)))
    feasible = np.flatnonzero(points.violation <= 0)
    if not feasible.size:
        feasible = np.argmin(points.violation, keepdims=True)
    rows = feasible[non_dominated(points.objectives[feasible])]
    rows = rows[np.argsort(points.objectives[rows, 0], kind="stable")]
    return Front(*(item[rows] for item in points))


def agreement(fronts: Sequence[Front], whole: Front) -> list[float | None]:
    """Hypervolume of each search's front over that of them all; None where a front is a point."""
    everything = np.concatenate([front.objectives for front in fronts])
    corner = everything.max(axis=0) + MARGIN * np.ptp(everything, axis=0)
    volume = HV(ref_point=corner)
    if not (total := volume(whole.objectives)) > 0:
        return [None] * len(fronts)
    return [float(volume(front.objectives) / total) for front in fronts]


def beyond(
    params: Mapping, predictor: prediction.Predictor, bounds: np.ndarray, design: np.ndarray
) -> dict | None:
    """What is chosen where the bounds (factors, 2) that a design (factors,) lies on are moved outward.

    There the surrogate extrapolates, and whether such an insert fits is not looked at. None where the design
    lies on no bound.
    """
    wider = widened(bounds, design)
    if wider is None:
        return None
    found = merged([front for front, _ in search_all(predictor, wider, params)])
    _, choice = choose(params, predictor, wider, found.designs, found.objectives)
    ranges = dict(zip(predictor.factors, wider.tolist(), strict=True))
    return {"ranges": ranges, **{name: choice[name] for name in ("design", "predicted", "rule")}}


def _in_words(choice):
    """The choice beyond the bounds, as a warning."""
    values = [
        f"{name} = {value:.4g}" for part in ("design", "predicted") for name, value in choice[part].items()
    ]
    return f"an extrapolation, with ranges a fifth wider there: {', '.join(values)}"


def search(predictor: prediction.Predictor, bounds: np.ndarray, params: Mapping) -> tuple[Front, list]:
    """Run NSGA-II; bounds: (factors, 2), params as in `optimise`.

    The mutation probability holds per variable. The random initial population is the first of the
    generations, as in pymoo and in Deb's own program: `generations` populations are evaluated in all. Returns
    the Front and a list of (X, F, G) per generation. The front has infeasible points only where nothing
    feasible was found: then it is the least infeasible design.
    """
    algorithm = NSGA2(
        pop_size=params["population"],
        crossover=SBX(prob=params["crossover_probability"]),
        # In pymoo `prob` holds per individual, `prob_var` per variable of a chosen individual.
        mutation=PM(prob=1.0, prob_var=params["mutation_probability"]),
    )
    record = _Record()
    result = minimize(
        _Segregation(predictor, bounds),
        algorithm,
        ("n_gen", params["generations"]),
        seed=params["seed"],
        callback=record,
        return_least_infeasible=True,
    )
    found = [np.atleast_2d(result.opt.get(name)) for name in ("X", "F")]
    points = Front._make([*found, result.opt.get("G")[:, 0]])
    order = np.argsort(points.objectives[:, 0], kind="stable")
    return Front(*(item[order] for item in points)), record.generations


def count_impossible(predictor: prediction.Predictor, bounds: np.ndarray) -> dict[str, int]:
    """Count impossible predictions, m_f < 0, m_i < 0 or m_f + m_i > 1, on a grid over the factors' ranges."""
    points = max(3, int(GRID_DESIGNS ** (1 / len(bounds))))
    curves = predictor.curves(factor_grid(bounds, points))
    fine, intermediate = curves[:, 0], curves[:, 1]
    return {
        "points_per_factor": points,
        "designs": len(curves),
        "infeasible_designs": int((violation(curves) > 0).sum()),
        "predictions": fine.size,
        "m_f_below_0": int((fine < 0).sum()),
        "m_i_below_0": int((intermediate < 0).sum()),
        "m_f_plus_m_i_above_1": int((fine + intermediate > 1).sum()),
    }


class _Segregation(Problem):
    """J_f and J_i to be small, subject to predictions that are possible mass fractions."""

    def __init__(self, predictor, bounds):
        super().__init__(
            n_var=len(bounds), n_obj=len(OUTPUTS), n_ieq_constr=1, xl=bounds[:, 0], xu=bounds[:, 1]
        )
        self.predictor = predictor

    def _evaluate(self, designs, out, *args, **kwargs):
        curves, out["F"] = self.predictor.predict(designs)
        out["G"] = violation(curves)[:, None]


class _Record(Callback):
    """Keeps X, F and G of each generation (pymoo's save_history copies the whole problem each time)."""

    def __init__(self):
        super().__init__()
        self.generations = []

    def notify(self, algorithm):
        self.generations.append([algorithm.pop.get(name) for name in ("X", "F", "G")])


def _history(records, factors):
    """Dataset of all generations of each search, the first the random initial population."""
    searches = [[np.stack(arrays) for arrays in zip(*record, strict=True)] for record in records]
    X, F, G = (np.stack(arrays) for arrays in zip(*searches, strict=True))
    dimensions = ("search", "generation", "individual")
    return xr.Dataset(
        {
            "X": ((*dimensions, "factor"), X, {"long_name": "design, in the factors' units"}),
            "F": ((*dimensions, "objective"), F, {"long_name": "predicted objectives", "units": "1"}),
            "G": (
                (*dimensions, "constraint"),
                G,
                {"long_name": "constraint, above 0 for impossible predictions", "units": "1"},
            ),
        },
        coords={
            "search": np.arange(1, len(X) + 1),
            "generation": np.arange(1, X.shape[1] + 1),
            "individual": np.arange(X.shape[2]),
            "factor": list(factors),
            "objective": list(OBJECTIVES),
            "constraint": ["violation"],
        },
        attrs={"title": "populations of the optimiser"},
    )
