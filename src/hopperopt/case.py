"""The case of one simulation: all that the solver is told, as plain JSON values in SI."""

import math

from hopperopt import geometry
from hopperopt.monitors import MAX_SPEED_RATIO

MM = 1000.0
HEADROOM = 0.020  # m of wall above the particles that start, and their first rise
SCATTERS = 5  # standard deviations of the speed that the fastest particle has upwards


def simulation(setup, labels, seed):
    """Case of a setup (its models in mm and degrees); `labels` are the design's factor values as typed."""
    insert, spheres = setup.insert_profile, setup.particles
    interval = setup.simulation.snapshot_interval_s
    return {
        "walls": {
            # The rim is a length of wall of its own: contacts below it are what they are without it.
            "hopper": [*setup.hopper.profile(_wall_top(setup)).tolist(), _rim(setup)],
            "gate": geometry.gate(setup.hopper.outlet_radius_mm / MM).tolist(),
            "insert": None if insert is None else insert.tolist(),
        },
        "particles": {
            "diameters": spheres.diameters,
            "counts": [setup.particle_count // 3] * 3,
            "density": spheres.density_kg_m3,
            "shear_modulus": spheres.shear_modulus_pa,
            "poisson_ratio": spheres.poisson_ratio,
        },
        "wall": {
            "shear_modulus": setup.wall.shear_modulus_pa,
            "poisson_ratio": setup.wall.poisson_ratio,
        },
        "contact": setup.contact.model_dump(),
        "filling": _filling(setup),
        "discharge": {
            "sensor": setup.discharge.sensor_mm / MM,
            "idle_limit": setup.discharge.idle_limit_s,
            "time_limit": setup.discharge.time_limit_s,
        },
        "time_step": setup.time_step,
        "gravity": setup.simulation.gravity_m_s2,
        "seed": seed,
        "design": {name: float(value) for name, value in labels.items()},
        # A case without snapshots does not tell of them: it is the one that it was before there were any.
        **({} if interval is None else {"snapshot_interval": interval}),
    }


def _filling(setup):
    filling = setup.filling
    return {
        "level": filling.level_mm / MM,
        "column_radius": round(_column_radius(setup), geometry.DECIMALS),
        "column_bottom": round(float(setup.column_bottom), geometry.DECIMALS),
        "solid_fraction": filling.column_solid_fraction,
        "speed": filling.speed_m_s,
        "speed_scatter": filling.speed_scatter_m_s,
        "settling_limit": filling.settling_limit_s,
    }


def _column_radius(setup):
    """Radius within which the centres of the falling particles lie: a coarse radius clear of the wall."""
    return setup.hopper.cylinder_radius_mm / MM - setup.particles.diameters[-1] / 2


def column_top(setup):
    """Height of the column that the particles fill at the column's solid fraction."""
    sphere = math.pi / 6 * sum(diameter**3 for diameter in setup.particles.diameters) / 3
    section = math.pi * _column_radius(setup) ** 2
    volume = setup.particle_count * sphere / setup.filling.column_solid_fraction
    return setup.column_bottom + volume / section


def _wall_top(setup):
    """Height of the wall: clear of the column's spheres and the rise of those that start upwards."""
    upwards = SCATTERS * setup.filling.speed_scatter_m_s
    rise = upwards * upwards / (2 * setup.simulation.gravity_m_s2)
    return column_top(setup) + setup.particles.diameters[-1] + rise + HEADROOM


def _rim(setup):
    """Point r, z of the wall's upper end: no particle rises above it that keeps the bound of the speed."""
    start = setup.filling.speed_m_s + SCATTERS * setup.filling.speed_scatter_m_s
    head = _wall_top(setup) + start * start / (2 * setup.simulation.gravity_m_s2)
    return [setup.hopper.cylinder_radius_mm / MM, round(float(MAX_SPEED_RATIO**2 * head), geometry.DECIMALS)]
