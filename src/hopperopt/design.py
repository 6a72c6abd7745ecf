"""Plans of experiments: which designs are simulated, and under which names."""

import csv
import io
import math
import re
from collections import Counter
from itertools import product
from typing import NamedTuple

from hopperopt.document import NotAllowed
from hopperopt.quantity import Quantity

MOST_EXPERIMENTS = 10_000
NAME = re.compile(r"[a-z][a-z0-9_]*")
PROPOSED = "infill_"  # begins the names of the designs of infill

# Columns, dimensions and variables of the study's files, which no factor may be called.
# fmt: off
RESERVED = {
    "experiment", "replicate", "replicates", "size_class", "output", "case", "objective", "feasible",
    "selected", "status", "split", "target", "particle", "mass_fraction", "target_fraction",
    "counting_variance", "particle_count", "filling_level", "filling_time", "settled", "discharge_time",
    "discharge_time_s", "discharge_rate", "mass_flow_index", "max_overlap", "max_speed_ratio",
    "max_energy_gain", "lost_particles", "residual_count", "residual_mass_fraction", "step_count",
    "filling_level_mm", "moved", "clip_low", "clip_high", "target_clipped", "runs", "scatter_variance",
    "pooled_variance", "rank", "n", "against_bare", "fine", "fine_low", "fine_high", "intermediate",
    "intermediate_low", "intermediate_high", "chosen_as", "expected_improvement",
}
# fmt: on


class Experiment(NamedTuple):
    """One row of a plan: its name, factor values, and 1-based level numbers (empty without levels)."""

    name: str
    design: dict
    levels: dict


def l25(factors):
    """The orthogonal array L25(5^6): `factors` maps up to six names to five levels each.

    Columns i, j, and ki + j modulo 5 for k = 1 to 4 (Bose's construction): any two hold each
    pair of levels once.
    """
    columns = slice(len(factors))
    rows = [[i, j, *((k * i + j) % 5 for k in range(1, 5))][columns] for i, j in product(range(5), repeat=2)]
    return [
        Experiment(
            name,
            {factor: float(factors[factor][index]) for index, factor in zip(row, factors, strict=True)},
            {factor: index + 1 for index, factor in zip(row, factors, strict=True)},
        )
        for name, row in zip(names(len(rows)), rows, strict=True)
    ]


def lhs(factors, experiments, seed):
    """Latin hypercube within the ranges of the factors' levels."""
    from scipy.stats import qmc  # slow to import

    return _scaled(factors, qmc.LatinHypercube(len(factors), rng=seed).random(experiments))


def sobol(factors, experiments, seed):
    """Scrambled Sobol' points within the ranges of the factors' levels."""
    from scipy.stats import qmc  # slow to import

    return _scaled(factors, qmc.Sobol(len(factors), rng=seed).random(experiments))


def _scaled(factors, unit):
    """Experiments at points (n, factors) of the unit cube, to a millionth of each factor's range."""
    ranges = {factor: bounds(levels) for factor, levels in factors.items()}
    designs = [
        {
            factor: _between(*limits, share)
            for (factor, limits), share in zip(ranges.items(), row, strict=True)
        }
        for row in unit
    ]
    return [Experiment(name, design, {}) for name, design in zip(names(len(designs)), designs, strict=True)]


def _between(low, high, share):
    decimals = 6 - math.floor(math.log10(high - low))
    return min(max(round(low + (high - low) * float(share), decimals), low), high)


def bounds(levels):
    """Smallest and largest level of a factor."""
    return float(min(levels)), float(max(levels))


def centre(factors):
    """The design at the middle level of each factor (mean of the two middle ones for an even number)."""
    design = {}
    for factor, levels in factors.items():
        ordered = sorted(levels)
        half = len(ordered) // 2
        design[factor] = float(ordered[half] if len(ordered) % 2 else (ordered[half - 1] + ordered[half]) / 2)
    return design


def corners(factors):
    """Every combination of the factors' smallest and largest levels."""
    return [dict(zip(factors, values, strict=True)) for values in product(*map(bounds, factors.values()))]


def names(count):
    """exp_01, exp_02, ..., exp_99, exp_100: never padded anew, whatever the count."""
    return [f"exp_{number:02d}" for number in range(1, count + 1)]


def proposals(number, count):
    """infill_2_1, infill_2_2, ...: so many designs of a round of infill, 2."""
    return [f"{PROPOSED}{number}_{place}" for place in range(1, count + 1)]


def from_csv(text, factors):
    """An own plan: a column `experiment` and one for each factor.

    Raises NotAllowed with what the file should hold.
    """
    columns = ["experiment", *factors]
    rows = _rows(text, columns)
    if not rows:
        raise NotAllowed(f"a CSV file with the columns {', '.join(columns)}, each once, and at least one row")
    if len(rows) > MOST_EXPERIMENTS:
        raise NotAllowed(f"at most {MOST_EXPERIMENTS} experiments ({len(rows)} are there)")
    experiments = [_from_row(number, row, factors) for number, row in enumerate(rows, start=2)]
    name, count = Counter(experiment.name for experiment in experiments).most_common(1)[0]
    if count > 1:
        raise NotAllowed(f"a name for each experiment ({name} is there twice)")
    return experiments


def unused_columns(text, factors):
    """Columns of an own plan that are no factor's, nor the levels that design.csv has."""
    columns = next(csv.reader(io.StringIO(text), skipinitialspace=True))
    own = {"experiment", *factors, *(f"{factor}_level" for factor in factors)}
    return [column for column in columns if column and column not in own]


def _rows(text, columns):
    """Rows of a CSV text as dicts; none where a column is missing or there twice, or it is no CSV."""
    reader = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    try:
        found = list(reader.fieldnames or ())
        return list(reader) if all(found.count(column) == 1 for column in columns) else []
    except csv.Error:
        return []


def _from_row(number, row, factors):
    name = (row["experiment"] or "").strip()
    if not NAME.fullmatch(name):
        raise NotAllowed(f"names of small letters, digits and underscores (line {number} has {name!r})")
    if name.startswith(PROPOSED):
        raise NotAllowed(f"names that do not begin with {PROPOSED} (line {number} has {name!r})")
    design = {}
    for factor in factors:
        try:
            design[factor] = Quantity().read(row[factor])
        except NotAllowed:
            raise NotAllowed(
                f"a number in every column (line {number} has {factor} {row[factor]!r})"
            ) from None
    return Experiment(name, design, {})


def points_from_csv(text):
    """Points (r, z) of a profile, from a CSV file with the columns r_mm and z_mm; raises NotAllowed."""
    read = Quantity().read
    try:
        points = [[read(row["r_mm"]), read(row["z_mm"])] for row in _rows(text, ["r_mm", "z_mm"])]
    except NotAllowed:
        points = []
    if len(points) < 2:
        raise NotAllowed("a CSV file with the columns r_mm, z_mm and numbers in at least two rows")
    return points
