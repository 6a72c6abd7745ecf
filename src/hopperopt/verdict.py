"""What the fresh simulations of the verification say: of the predictions, and against the bare hopper.

Differences of U are tested, one-sided at 5 %: that of the selected design is the study's question and stands
as it is, all others are adjusted after Holm for their number.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from hopperopt import outflow, uncertainty
from hopperopt.surrogate.features import OUTPUTS
from hopperopt.uncertainty import Estimate, Runs

PRIMARY, BARE = "selected", "bare"  # kinds of cases
COLUMNS = (
    "case", "objective", "n", "predicted", "predicted_low", "predicted_high", "simulated", "low", "high",
    "raw_rms", "z", "diff_bare", "diff_low", "diff_high", "p_holm", "better_than_bare", "verdict",
)  # fmt: skip


class Prediction(NamedTuple):
    """What a surrogate says of one design, arrays (output,): J, its limits of 90 %, J squared."""

    J: np.ndarray
    low: np.ndarray
    high: np.ndarray
    squared: Estimate


NONE = Prediction._make([*np.full((3, len(OUTPUTS)), np.nan), Estimate(*np.full((2, len(OUTPUTS)), np.nan))])


class Case(NamedTuple):
    """A verification case: its kind (a word of the configuration, or "design"), prediction and runs."""

    name: str
    kind: str
    predicted: Prediction
    runs: Runs  # of one design: arrays (size class, M)


def judge(cases: Sequence[Case], target: np.ndarray) -> pd.DataFrame:
    """A row per case and objective: the columns COLUMNS, and `detectable`.

    target (size class,): mass fractions m_k0 of the batch. J is that of the mean curve of n runs. Differences
    are those of U, a case's less the bare hopper's, negative for less segregation; `detectable` is the
    smallest one that the row's test, adjusted for the others as the least of their p-values is, finds with a
    power of 80 %. Empty: what needs a run, a prediction or a bare hopper that is not there.
    """
    runs = uncertainty.stacked([case.runs for case in cases])
    simulated = uncertainty.estimate(runs, target, uncertainty.pooled_variance(runs))
    simulated = Estimate(*(values[:, : len(OUTPUTS)] for values in simulated))
    stacks = [np.stack([getattr(case.predicted, name) for case in cases]) for name in Prediction._fields[:3]]
    squared = Estimate(*np.stack([case.predicted.squared for case in cases], axis=1))
    predicted = Prediction._make([*stacks, squared])
    difference = simulated - _bare([case.kind for case in cases], simulated)
    primary = np.array([case.kind == PRIMARY for case in cases])
    p = difference.p_below()
    better, worse = _adjusted(p, primary), _adjusted(1 - p, primary)
    low, high = simulated.interval()
    diff_low, diff_high = difference.interval()
    values = {
        "n": np.broadcast_to(runs.number[..., 0], low.shape),
        "predicted": predicted.J,
        "predicted_low": predicted.low,
        "predicted_high": predicted.high,
        "simulated": outflow.signed_root(simulated.square),
        "low": outflow.signed_root(low),
        "high": outflow.signed_root(high),
        "raw_rms": outflow.objective(runs.mean, target)[:, : len(OUTPUTS)],
        "z": (simulated - predicted.squared).in_deviations(),
        "diff_bare": difference.square,
        "diff_low": diff_low,
        "diff_high": diff_high,
        "p_holm": better,
        "better_than_bare": np.where(np.isnan(better), None, better < uncertainty.LEVEL),
        "verdict": _words(better, worse),
        "detectable": difference.detectable(_levels(p, primary)),
    }
    names = {
        "case": np.repeat([case.name for case in cases], len(OUTPUTS)),
        "objective": np.tile(OUTPUTS, len(cases)),
    }
    return pd.DataFrame(names | {column: value.ravel() for column, value in values.items()})


def _bare(kinds, simulated):
    """Estimate of the bare hopper (case, output), NaN in its own row; NaN where there is none."""
    at = [row for row, kind in enumerate(kinds) if kind == BARE]
    reference = Estimate(*(np.full_like(values, np.nan) for values in simulated))
    if at:
        for whole, values in zip(reference, simulated, strict=True):
            whole[[row for row in range(len(kinds)) if row not in at]] = values[at[0]]
    return reference


def _adjusted(p, primary):
    """P-values (case, output) of which those of the primary cases stay and the others are Holm's."""
    adjusted = p.copy()
    adjusted[~primary] = uncertainty.holm(p[~primary].ravel()).reshape(-1, p.shape[1])
    return adjusted


def _levels(p, primary):
    """Levels (case, 1) of the tests of p-values (case, output): Holm's strictest but for primary cases."""
    others = np.count_nonzero(np.isfinite(p[~primary]))
    return np.where(primary, uncertainty.LEVEL, uncertainty.LEVEL / max(others, 1))[:, None]


def _words(better, worse):
    """Verdicts from adjusted p-values (case, output); None without one."""
    words = np.where(worse < uncertainty.LEVEL, "worse", "not distinguishable")
    words = np.where(better < uncertainty.LEVEL, "better", words)
    return np.where(np.isnan(better), None, words)
