"""Energy: no impact gains any, and an elastic gas keeps its own to second order.

Friction and dashpots only take energy out, so an oblique impact must not end with more kinetic energy (spin
included) than it began with; one code's wall model gained up to 34 % at 76° (LAMMPS, pull request
5007). Judged are impacts at
0° to 88° from the normal, of pairs of 2 and 4 mm and on the wall: at a fine step of 200 in an elastic
contact, for e = 0.1 to 0.95 and μ = 0.05 to 2; and with the study's materials at 4·10⁻⁵ s, for all its sizes,
20 phases of first touch and 0.05 to 3 m/s. The largest change is that of the most grazing impacts, which have
hardly any energy to lose. (Spheres that spin before they graze each other, and touch for one step alone, can
gain some 10⁻⁵ of their energy at 4·10⁻⁵ s; that row is not judged.)

With e = 1 nothing is lost but by sliding, and the error of the time step shows: a gain of up to 0.2 % is
allowed at 200 steps, and has to fall with the step. With spin before the impact it does not fall to nothing:
the law itself, as an ordinary differential equation (`contact_ode`), gains a little there, as its tangential
spring stiffens while stretched.

In an elastic gas without friction (60 spheres under gravity in a closed can, four times) kinetic,
gravitational and elastic energy, all at the same instant, must add up to what they were at first. The rms
over time of the error falls with the square of the step, as it has to for the leapfrog scheme: the slope is
judged from 1 to 16 µs.
"""

import matplotlib.pyplot as plt
import numpy as np

from hopperopt.dem.simulation import Simulation
from validation.contact_ode import Impact, rebound
from validation.report import Row, at_most, save_plain
from validation.setups import (
    DENSITY,
    GRAVITY,
    TIME_STEP,
    effective,
    hertz_duration,
    impacts,
    kinetic_energy,
    pair_law,
    sphere_mass,
    wall_law,
)

ANGLES = np.arange(0.0, 89.0, 4.0)  # degrees from the normal; 76 is among them
RESTITUTIONS, FRICTIONS = (0.1, 0.3, 0.5, 0.7, 0.9, 0.95), (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
SPEEDS = (0.05, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)  # m/s
SPINS = (-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)  # times R over the speed
PAIR, ALONE = [0.001, 0.002], [0.0015]  # m
TIME_STEPS = 1.0e-6 * 2.0 ** np.arange(5)  # s, of the gas
BLUE, ORANGE = "#0072B2", "#D55E00"


def changes(law, radii, speed, time_step, phases=1, spins=(0.0,)):
    """Relative change of kinetic energy in oblique impacts, (angles, phases x spins).

    The first sphere comes in at `speed` (m/s), with spins times speed / R about the axis across its path.
    """
    angle, phase, turn = np.meshgrid(np.radians(ANGLES), np.arange(phases) / phases, spins, indexing="ij")
    angle, phase, turn = angle.ravel(), phase.ravel(), turn.ravel()
    velocity, spin = np.zeros((2, len(angle), len(radii), 3))
    velocity[:, 0, 0], velocity[:, 0, 2] = speed * np.sin(angle), -speed * np.cos(angle)
    spin[:, 0, 1] = turn * speed / radii[0]
    radius = np.tile(radii, (len(angle), 1))
    gap = phase * speed * np.cos(angle) * time_step
    after = impacts(law, radius, velocity, time_step, gap=gap, spin=spin)
    gain = kinetic_energy(radius, *after) / kinetic_energy(radius, velocity, spin) - 1.0
    return gain.reshape(len(ANGLES), -1)


def fine(restitution, friction, steps, **options):
    """Changes at so many steps in an elastic contact, pairs and wall; (2, angles)."""
    both = []
    for law, radii in ((pair_law(restitution, friction), PAIR), (wall_law(restitution, friction), ALONE)):
        lasts = hertz_duration(1.0, *effective([radii]), law.modulus)[0]
        both.append(changes(law, radii, 1.0, lasts / steps, **options).max(axis=1))
    return np.array(both)


def guard_row(name, gains, at=None):
    """A row for the largest change over all impacts, `gains` (..., angles), or over those at one angle."""
    if at is not None:
        return at_most(
            f"{name}, {at}°: change of kinetic energy", 0.0, 100.0 * gains[..., at == ANGLES].max(), "%"
        )
    steepest = ANGLES[gains.reshape(-1, len(ANGLES)).max(axis=0).argmax()]
    return at_most(
        f"{name}: change of kinetic energy, largest (at {steepest:.0f}°)", 0.0, 100.0 * gains.max(), "%"
    )


def study(spins=(0.0,)):
    """Changes with the study's materials at its step: particles, wall; (speeds, impacts, angles)."""
    sizes = (0.001, 0.0015, 0.002)
    both = (pair_law(), [[a, b] for a in sizes for b in sizes]), (wall_law(), [[a] for a in sizes])
    return [
        np.array(
            [np.hstack([changes(law, r, speed, TIME_STEP, 20, spins) for r in radii]).T for speed in SPEEDS]
        )
        for law, radii in both
    ]


def elastic_rows():
    """Gain with e = 1, how it falls with the step, and what the law itself gains when there is spin."""
    gain = [100.0 * max(fine(1.0, mu, n, phases=20).max() for mu in (0.2, 0.5, 2.0)) for n in (100, 200, 400)]
    turning = 100.0 * fine(1.0, 2.0, 200, spins=SPINS).max()
    law, mass = wall_law(1.0, 2.0), float(sphere_mass(ALONE[0]))
    impact = Impact((*ALONE, np.inf), (mass, np.inf), law.modulus, law.shear_modulus, 1.0, 2.0)
    angle = np.radians(52.0)
    v_x, v_z, spin, _ = rebound(impact, (np.sin(angle), -np.cos(angle)), (1.0 / ALONE[0], 0.0))
    own = 100.0 * ((v_x**2 + v_z**2 + 0.4 * (ALONE[0] * spin) ** 2) / 1.4 - 1.0)
    return [
        at_most("e = 1: gain at 200 steps", 0.2, gain[1], "%"),
        at_most("e = 1: gain at 200 steps, over that at 100", 1.0, gain[1] / gain[0]),
        at_most("e = 1: gain at 400 steps, over that at 200", 1.0, gain[2] / gain[1]),
        at_most("e = 1, spin of up to 3 v/R before it: gain at 200 steps", 0.2, turning, "%"),
        Row("e = 1, spin v/R, 52° on the wall, μ = 2: gain in the ODE", "", f"{own:.3g} %", "", True),
    ]


def gas(time_step, seed):
    """60 elastic frictionless spheres of three sizes in a closed can, falling and bouncing."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 2, np.arange(5)), axis=-1).reshape(-1, 3)
    position = grid[np.hypot(grid[:, 0], grid[:, 1]) < 2.3][:60] * 0.0042 + [0.0, 0.0, 0.004]
    can = {"can": [[0.0, 0.0], [0.013, 0.0], [0.013, 0.03], [0.0, 0.03]]}
    velocity, radius = rng.normal(0.0, 0.5, position.shape), rng.permutation([0.001, 0.0015, 0.002] * 20)
    laws = pair_law(1.0, 0.0), wall_law(1.0, 0.0)
    return Simulation(position, velocity, radius, DENSITY, can, *laws, time_step, GRAVITY, "none")


def gas_error(time_step):
    """Rms over time and gases of the error in the total energy, over its first value."""
    every, errors = round(32.0e-6 / time_step), []
    for seed in range(4):
        sim = gas(time_step, seed)
        begin = sum(sim.energy())
        for _ in range(300):
            sim.advance(every)
            errors.append(sum(sim.energy()) / begin - 1.0)
    return np.sqrt(np.mean(np.square(errors)))


def measure(figures):
    """Rows of the guard, of elastic impacts and of the gas."""
    gains = np.array([fine(e, mu, 200, phases=2) for e in RESTITUTIONS for mu in FRICTIONS])
    rows = [guard_row("fine step", gains), guard_row("fine step", gains, at=76)]
    coarse = study()
    for name, gain in zip(("particles", "wall"), coarse, strict=True):
        rows += [guard_row(f"4·10⁻⁵ s, {name}", gain), guard_row(f"4·10⁻⁵ s, {name}", gain, at=76)]
    turning = 100.0 * max(gain.max() for gain in study(SPINS))
    name = "4·10⁻⁵ s, spin of up to 3 v/R before it: change of kinetic energy, largest"
    rows.append(Row(name, "", f"{turning:.2g} %", "", True))
    rows += elastic_rows()
    errors = np.array([gas_error(step) for step in TIME_STEPS])
    slope = np.polyfit(np.log(TIME_STEPS), np.log(errors), 1)[0]
    name = "gas: slope of the energy error over the step"
    rows.append(Row(name, "1.6 to 2.6", f"{slope:.2f}", "range", bool(1.6 < slope < 2.6)))
    if figures:
        draw(figures, coarse, errors)
    return rows


def draw(folder, coarse, errors):
    """Energy left after impacts at the study's step over the angle; the gas's error over the step."""
    figure, (one, two) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    names, places = ("particles", "wall"), ((4.0, 0.66), (42.0, 0.24))
    for gain, colour, name, place in zip(coarse, (BLUE, ORANGE), names, places, strict=True):
        left = 1.0 + gain.reshape(-1, len(ANGLES))
        one.fill_between(ANGLES, left.min(axis=0), left.max(axis=0), color=colour, alpha=0.3, lw=0)
        one.plot(ANGLES, left.mean(axis=0), color=colour)
        one.text(*place, f"{name}: mean, range", color=colour)
    one.axhline(1.0, color="black", ls="--", lw=1)
    one.axvline(76.0, color="0.5", ls=":", lw=1)
    one.set_xlim(0, 90)
    one.set_ylim(0, 1.08)
    one.set_xlabel("angle of impact from the normal (°)")
    one.set_ylabel("kinetic energy, after / before")
    two.loglog(1e6 * TIME_STEPS, errors, "o", color=BLUE)
    two.loglog(1e6 * TIME_STEPS, errors[2] * (TIME_STEPS / TIME_STEPS[2]) ** 2, "--", color="0.5", lw=1)
    two.text(9.0, errors[3], "slope 2", color="0.4", va="top")
    two.set_xticks(1e6 * TIME_STEPS, [f"{1e6 * step:.0f}" for step in TIME_STEPS])
    two.minorticks_off()
    two.set_xlabel("time step (µs)")
    two.set_ylabel("energy error of the gas, rms")
    save_plain(figure, folder / "energy.png")
