"""Small experiments of random geometry, sizes, materials and steps, and what must hold for each of them."""

from collections import Counter
from typing import NamedTuple

import numpy as np

from hopperopt import config, experiment, outflow
from hopperopt.config.setup import Particles

STATUSES = ("complete", "jammed", "incomplete", "unsettled", "monitor")
BOUNDS = {"max_overlap": 0.3, "max_speed_ratio": 2.0, "max_energy_gain": 0.01, "lost_particles": 0}
# Steps: up to 0.4 Rayleigh times for any material, 0.77 for materials like the paper's.
USUAL_STEP, PAPERS_STEP = 0.4, 0.77
# Warnings of these keys say that a run may break its monitors.
BEYOND = {
    "particles.shear_modulus_pa",
    "particles.diameters_mm",
    "contact.particle.restitution",
    "simulation.time_step_s",
}


class Sample(NamedTuple):
    """Designs that were drawn: the cases asked for, and how often a key was refused or warned of."""

    cases: list
    refused: Counter
    warned: Counter


def sample(count, seed, beyond=False):
    """The first `count` random designs within the bounds of validity, or `beyond` them; same for a seed.

    Within are those that the configuration accepts without a warning that a monitor may break.
    """
    rng = np.random.default_rng(seed)
    cases, refused, warned = [], Counter(), Counter()
    while len(cases) < count:
        if refused.total() > 50 * count:
            raise RuntimeError(f"nearly all random designs are refused: {dict(refused)}")
        document = _document(rng)
        try:
            study = config.parse(document)
        except config.ConfigError as error:
            refused.update({line.partition(":")[0] for line in str(error).splitlines()})
            continue
        keys = {line.partition(":")[0] for line in study.warnings()} & BEYOND
        warned.update(keys)
        if bool(keys) == beyond:
            cases.append(study.simulation_case({}, "random", len(cases) + 1))
    return Sample(cases, refused, warned)


def judged(case, within=True):
    """The run of a case; AssertionError with all that is wrong with it. `within`: all monitors in bounds."""
    run = experiment.run(case)
    if found := list(_faults(case, run, within)):
        raise AssertionError(f"{found} in {case}")
    return run


def _faults(case, run, within):
    left = np.isfinite(run["exit_time"].values)
    size_class = run["size_class"].values
    mass = run["diameter"].values ** 3
    monitors = {name: float(run[name]) for name in BOUNDS}
    broken = {name: value for name, value in monitors.items() if not value <= BOUNDS[name]}
    status = run["status"].item()
    if status not in STATUSES:
        yield f"status {status}"
    if (status == "monitor") != bool(broken):
        yield f"status {status} with {monitors}"
    if within and broken:
        yield f"out of bounds: {broken}"
    if np.bincount(size_class).tolist() != case["particles"]["counts"]:
        yield "particles are not those of the case"
    if left.sum() + int(run["residual_count"]) != len(left):
        yield f"{left.sum()} out and {int(run['residual_count'])} inside of {len(left)}"
    inside = mass[~left].sum() / mass.sum()
    if abs(inside - float(run["residual_mass_fraction"])) > 1e-12:
        yield f"mass fraction {inside} inside, told {float(run['residual_mass_fraction'])}"
    if not np.isfinite(run["position_opening"].values).all():
        yield "a position that is no number"
    if left.any() and not monitors["lost_particles"]:
        yield from _windows(run, left, mass, size_class)


def _windows(run, left, mass, size_class):
    """The windows' masses add up to what left, of each size: the batch where the hopper is empty."""
    if not (run["exit_time"].values[left] > 0.0).all():
        yield "an exit before the opening"
    flow = outflow.outflow(run["exit_time"].values, run["diameter"].values, size_class)
    total = (flow.mass_fraction * np.diff(outflow.EDGES)).sum(axis=1)
    expected = np.bincount(size_class[left], weights=mass[left], minlength=3) / mass[left].sum()
    if np.abs(total - expected).max() > 1e-12:
        yield f"windows hold {total} of the sizes, not {expected}"


def _document(rng):
    """One experiment of a few hundred spheres, as a configuration document."""
    fine = rng.uniform(2.0, 5.0)
    coarse = fine * 4.0 ** rng.random()
    outlet = coarse * rng.uniform(0.8, 4.0)
    paper_like = rng.random() < 0.25
    step = PAPERS_STEP if paper_like else rng.uniform(0.2, USUAL_STEP)
    density, modulus, poisson = rng.uniform(500, 8000), 10 ** rng.uniform(7.0, 8.0), rng.uniform(0.0, 0.5)
    document = {
        "hopper": {
            "outlet_radius_mm": outlet,
            "half_angle_deg": rng.choice([90.0, rng.uniform(10.0, 90.0)], p=[0.1, 0.9]),
            "cylinder_radius_mm": outlet + coarse * rng.uniform(1.0, 6.0),
        },
        "insert": _insert(rng, coarse),
        "particles": {
            "diameters_mm": [fine, rng.uniform(fine, coarse), coarse],
            "density_kg_m3": density,
            "shear_modulus_pa": modulus,
            "poisson_ratio": poisson,
        },
        "wall": {
            "shear_modulus_pa": rng.choice([np.inf, modulus * rng.uniform(0.5, 10.0)], p=[0.1, 0.9]),
        },
        "contact": {
            "rolling": str(rng.choice(["edem", "cdt", "none"])),
            "particle": _contact(rng, paper_like),
            "wall": _contact(rng, paper_like),
        },
        "filling": {
            "level_mm": coarse * rng.uniform(2.0, 10.0),
            "particles": 3 * int(rng.integers(50, 100)),
            "settling_limit_s": 0.8,
        },
        "discharge": {"idle_limit_s": 0.1, "time_limit_s": 2.0},
        # A study needs a plan; here it is of no account.
        "factors": {"gravity_m_s2": {"key": "simulation.gravity_m_s2", "levels": [9.8, 9.81]}},
        "design": {"plan": "lhs", "lhs": {"experiments": 4}},
        "surrogate": {"selected_hidden_nodes": 7, "validation_experiments": 1, "test_experiments": 1},
        "verification": {"cases": {"bare": "bare"}},
    }
    rayleigh = Particles.model_validate(document["particles"]).rayleigh_time
    return document | {"simulation": {"time_step_s": step * rayleigh}}


def _insert(rng, coarse):
    radius, length, opening, cylinder = coarse * rng.uniform([0.5, 0.5, 0.6, 0.1], [4.0, 8.0, 4.0, 4.0])
    lower, upper = rng.uniform(15.0, 85.0, 2)
    points = np.column_stack(
        [coarse * rng.uniform(0.5, 4.0, 3), np.cumsum(coarse * rng.uniform(0.2, 3.0, 3))]
    )
    shell = rng.random() < 0.5
    return {
        "shape": str(rng.choice(["none", "cone", "double_cone", "bullet", "cone_in_cone", "profile"])),
        "height_mm": coarse * rng.uniform(1.0, 12.0),
        "cone": {"slope_deg": lower, "length_mm": length},
        "double_cone": {"lower_slope_deg": lower, "upper_slope_deg": upper, "length_mm": length},
        "bullet": {"radius_mm": radius, "cylinder_length_mm": cylinder, "nose_slope_deg": upper},
        "cone_in_cone": {
            "slope_deg": rng.uniform(30.0, 89.0),
            "length_mm": length,
            "opening_radius_mm": opening,
            "thickness_mm": coarse * rng.uniform(0.3, 1.0),
        },
        "profile": {
            "points_mm": points.tolist() if shell else [[0, 0], *points.tolist(), [0, points[-1, 1] + radius]]
        },
    }


def _contact(rng, paper_like):
    return {
        "restitution": rng.uniform(0.0, 0.7 if paper_like else 0.95),
        "static_friction": rng.uniform(0.0, 0.5 if paper_like else 2.0),
        "rolling_friction": rng.uniform(0.0, 0.5),
    }
