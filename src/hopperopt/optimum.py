"""The design chosen from a Pareto front, and how much of the choice the surrogate's draws leave standing."""

from collections.abc import Mapping

import numpy as np
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting
from scipy.stats import qmc

from hopperopt.outflow import objective
from hopperopt.select import select
from hopperopt.surrogate.features import OUTPUTS, violation
from hopperopt.surrogate.prediction import Predictor

OBJECTIVES = tuple(f"J_{name}" for name in OUTPUTS)
NEAR_BOUND = 0.01  # of a factor's range
WIDENING = 0.2  # of a factor's range, beyond a bound on which the choice lies
DRAWS = 1000  # for the gain over the plan's centre
CHOICES = 100  # draws of which one is chosen each
CANDIDATES = 256  # designs for that, beside the front's (power of 2)
LIMITS = (0.05, 0.95)  # quantiles: an interval of 90 %


def choose(
    params: Mapping, predictor: Predictor, bounds: np.ndarray, designs: np.ndarray, objectives: np.ndarray
) -> tuple[int, dict]:
    """Choose a design of a front: its index (-1: the explicit one, of no front) and what selected.yaml says.

    params: `select`, `explicit`, `centre` and `seed`, as the stage `optimise` gets them; bounds (factors, 2);
    designs (n, factors) and objectives (n, 2) of the front.
    """
    names, middle = predictor.factors, predictor.array(params["centre"])
    centre, warnings = predictor.objectives(middle)[0], []
    if params["select"] == "explicit":
        index, rule, design = -1, "explicit", predictor.array(params["explicit"])[0]
    else:
        index, rule, warning = select(params["select"], objectives, centre, predictor.objective_error)
        design = designs[index]
        warnings += [] if warning is None else [warning]
        warnings += _on_bounds(names, design, bounds)
    feasible = violation(predictor.curves(design))[0] <= 0
    if not feasible:
        warnings.append("the surrogate predicts impossible mass fractions for the selected design")
    predicted = predictor.objectives(design)[0]
    half = half_width(predictor, np.vstack([design, middle]), np.random.default_rng(params["seed"]))
    warnings += _in_doubt(centre - predicted, half)
    said = {
        "design": dict(zip(names, design, strict=True)),
        "predicted": dict(zip(OBJECTIVES, predicted, strict=True)),
        "feasible": bool(feasible),
        "rule": rule,
        "warning": "; ".join(warnings) or None,
        "predicted_centre": dict(zip(OBJECTIVES, centre, strict=True)),
        "gain_over_centre": {
            name: {"predicted": gain, "half_width": width}
            for name, gain, width in zip(OBJECTIVES, centre - predicted, half, strict=True)
        },
    }
    return index, said


def half_width(predictor: Predictor, pair: np.ndarray, rng: np.random.Generator) -> list:
    """Half of the 90 % interval of the difference of J between two designs (2, factors), for each output.

    From joint draws, in which what both have in common cancels; None for a surrogate without any.
    """
    if not predictor.knows_its_error:
        return [None] * len(OUTPUTS)
    J = objective(predictor.draws(pair, DRAWS, rng), predictor.batch)
    low, high = np.quantile(J[:, 1] - J[:, 0], LIMITS, axis=0)
    return ((high - low) / 2).tolist()


def spread(
    params: Mapping, predictor: Predictor, bounds: np.ndarray, designs: np.ndarray
) -> dict[str, list[float]] | None:
    """Where the choice falls in draws of the surrogate: 90 % of its values, {factor: [low, high]}.

    In each joint draw the rule of `params` chooses from the front that the draw has among the front's designs
    (n, factors) and others all over the ranges, bounds (factors, 2). None for an explicit design, and for a
    surrogate without draws.
    """
    if params["select"] == "explicit" or not predictor.knows_its_error:
        return None
    rng = np.random.default_rng(params["seed"])
    low, high = bounds.T
    others = low + qmc.Sobol(len(bounds), rng=rng).random(CANDIDATES) * (high - low)
    candidates = np.vstack([designs, others])
    drawn = predictor.draws(np.vstack([candidates, predictor.array(params["centre"])]), CHOICES, rng)
    chosen = []
    for *J, centre in objective(drawn, predictor.batch):
        front = non_dominated(np.array(J))
        index, _, _ = select(params["select"], np.array(J)[front], centre)
        chosen.append(candidates[front[index]])
    limits = np.quantile(chosen, LIMITS, axis=0)
    return dict(zip(predictor.factors, limits.T.tolist(), strict=True))


def non_dominated(objectives: np.ndarray) -> np.ndarray:
    """Indices of the points (n, 2) that no other one beats in both objectives."""
    return NonDominatedSorting().do(objectives, only_non_dominated_front=True)


def widened(bounds: np.ndarray, design: np.ndarray) -> np.ndarray | None:
    """Bounds (factors, 2) moved outward where a design (factors,) lies on them; None where on none."""
    on = _near(design, bounds)
    outward = np.array([-1, 1]) * WIDENING * np.ptp(bounds, axis=1, keepdims=True)
    return np.where(on, bounds + outward, bounds) if on.any() else None


def _near(design, bounds):
    """Which bounds (factors, 2) a design (factors,) lies on."""
    return np.abs(design[:, None] - bounds) <= NEAR_BOUND * np.ptp(bounds, axis=1, keepdims=True)


def _on_bounds(factors, design, bounds):
    """A sentence for every factor of a design (factors,) that the search's bounds (factors, 2) hold back."""
    return [
        f"{factors[row]} = {design[row]:.5g} lies on the bound {bounds[row, end]:g} of its range: "
        "the optimum may lie beyond"
        for row, end in np.argwhere(_near(design, bounds))
    ]


def _in_doubt(gains, half_widths):
    """A sentence for every objective whose gain over the plan's centre is less than its uncertainty."""
    return [
        f"the predicted gain of {name} over the plan's centre, {gain:.2g}, is less than its uncertainty, "
        f"{half:.2g}"
        for name, gain, half in zip(OBJECTIVES, gains, half_widths, strict=True)
        if half is not None and gain < half
    ]
