"""The stage `optimise`: NSGA-II on the surrogate, its Pareto front, and the design chosen from it."""

import logging
import os
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.callback import Callback
from pymoo.core.problem import Problem
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.optimize import minimize

from hopperopt.files import write_netcdf, write_table, write_yaml
from hopperopt.select import select
from hopperopt.surrogate import prediction
from hopperopt.surrogate.features import OUTPUTS, factor_grid, violation

OBJECTIVES = tuple(f"J_{name}" for name in OUTPUTS)
GRID_DESIGNS = 10_000  # size of the grid on which impossible predictions are counted, about
NEAR_BOUND = 0.01  # of a factor's range

log = logging.getLogger(__name__)


class Front(NamedTuple):
    """Non-dominated designs of the last generation, by rising J of the fine particles."""

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
    `mutation_probability`, `seed`, `select` (knee, compromise or explicit), `explicit` (a design or None),
    `centre` (a design), all in the factors' own units. surrogate: path of model.nc; front, history, selected:
    paths of front.csv, history.nc and selected.yaml.
    """
    predictor = prediction.load(surrogate)
    bounds = np.array([params["bounds"][name] for name in predictor.factors], dtype=float)
    found, record = search(predictor, bounds, params)
    choice = _choose(params, predictor, bounds, found)
    impossible = count_impossible(predictor, bounds)
    table = pd.DataFrame(
        np.hstack([found.designs, found.objectives]), columns=[*predictor.factors, *OBJECTIVES]
    )
    table["feasible"] = found.violation <= 0
    table["selected"] = np.arange(len(table)) == choice.pop("index")
    write_table(table, front)
    write_netcdf(_history(record, predictor.factors), history)
    write_yaml({**choice, "front_points": len(table), "infeasible_grid_predictions": impossible}, selected)


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


def _choose(params, predictor, bounds, found):
    """Choose a design: the head of selected.yaml, and its `index` in the front (-1: not of the front)."""
    centre = predictor.objectives(predictor.array(params["centre"]))[0]
    warnings = []
    if params["select"] == "explicit":
        index, rule, design = -1, "explicit", predictor.array(params["explicit"])
    else:
        index, rule, warning = select(params["select"], found.objectives, centre, predictor.objective_error)
        design = found.designs[[index]]
        warnings += [] if warning is None else [warning]
        warnings += _on_bounds(predictor.factors, design[0], bounds)
    feasible = violation(predictor.curves(design))[0] <= 0
    if not feasible:
        warnings.append("the surrogate predicts impossible mass fractions for the selected design")
    warning = "; ".join(warnings) or None
    if warning is not None:
        log.warning(warning)
    return {
        "design": dict(zip(predictor.factors, design[0], strict=True)),
        "predicted": dict(zip(OBJECTIVES, predictor.objectives(design)[0], strict=True)),
        "feasible": bool(feasible),
        "rule": rule,
        "warning": warning,
        "predicted_centre": dict(zip(OBJECTIVES, centre, strict=True)),
        "index": index,
    }


def _on_bounds(factors, design, bounds):
    """A sentence for every factor of a design (factors,) that the search's bounds (factors, 2) hold back."""
    return [
        f"{name} = {value:.5g} lies on the bound {bound:g} of its range: the optimum may lie beyond"
        for name, value, limits in zip(factors, design, bounds, strict=True)
        for bound in limits
        if abs(value - bound) <= NEAR_BOUND * np.ptp(limits)
    ]


def _history(record, factors):
    """Dataset of all generations, the first the random initial population."""
    X, F, G = (np.stack(arrays) for arrays in zip(*record, strict=True))
    dimensions = ("generation", "individual")
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
            "generation": np.arange(1, len(X) + 1),
            "individual": np.arange(X.shape[1]),
            "factor": list(factors),
            "objective": list(OBJECTIVES),
            "constraint": ["violation"],
        },
        attrs={"title": "populations of the optimiser"},
    )
