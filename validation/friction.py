"""Sliding, rolling and resting on a plane.

A sphere set sliding on a rough plane without spin slows down and spins up until it rolls (test DEM04 of the
MFIX verification manual; R. Garg, J. Galvin, T. Li, S. Pannala, Powder Technology 220 (2012) 122–137).
Whatever the friction μ, it rolls from t = 2 u₀ / (7 μ g) on, with v = ω R = 5/7 u₀; here to 0.1 %, without
rolling friction.

On an incline of angle α, with the rolling friction of the study (`edem`), a sphere rests while tan α < μ_r,
rolls while tan α < 3.5 μ_s − 2.5 μ_r, and slides beyond. The spheres (2, 3 and 4 mm) are let go at slopes
0.02 apart; the row gives the two of them between which the motion changes, and holds if the closed form lies
between them, for each sphere. At the study's step of 4·10⁻⁵ s as well: there the force that a resting contact
transmits is the divided elastic force, and limits of friction that refer to anything else let loaded spheres
creep.
"""

import matplotlib.pyplot as plt
import numpy as np

from validation.report import Row, at_most, save_plain
from validation.setups import GRAVITY, TIME_STEP, on_floor, sphere_mass, wall_law

RADII = np.array([0.001, 0.0015, 0.002])  # m
FRICTIONS = (0.1, 0.3, 0.5, 1.0)
START = 0.2  # m/s, u0 of the sliding spheres
# Restitution, static and rolling friction: those of the study's particles and walls, and another
LAWS = ((0.7, 0.5, 0.05), (0.2, 0.5, 0.25), (0.2, 0.3, 0.1))
APART = 0.02  # of the slopes, in tan
LET_GO = 0.06  # s, how long a sphere is watched on the incline
COLOURS = ("#0072B2", "#D55E00", "#009E73", "black")


def resting(law, time_step, pull, rolling, speed=0.0):
    """Spheres pressed into the floor by their weight, moving along x; gravity `pull` (3,) in m/s2."""
    deep = (0.75 * sphere_mass(RADII) * -pull[2] / (law.modulus * np.sqrt(RADII))) ** (2.0 / 3.0)
    velocity = np.zeros((3, 3))
    velocity[:, 0] = speed
    return on_floor(RADII, velocity, law, time_step, gap=-deep, gravity=pull, rolling=rolling), RADII - deep


def motion(sim, arm):
    """Velocity along x (m/s) and that of the surface on the floor, (3,) each."""
    velocity = sim.by_identity(sim.spheres.velocity)[:, 0]
    return velocity, velocity - arm * sim.by_identity(sim.spheres.spin)[:, 1]


def slide_to_roll(friction):
    """Times (s), velocities, surface velocities over u0 (samples, 3), and the onset of rolling (s), (3,)."""
    dt, every = 2.0e-6, 10
    sim, _ = resting(wall_law(0.2, friction), dt, np.array([0.0, 0.0, -GRAVITY]), "none", START)
    rolls = 2.0 / 7.0 * START / (friction * GRAVITY)
    samples = []
    for _ in range(round(1.5 * rolls / (dt * every))):
        sim.advance(every)
        samples.append(motion(sim, RADII))
    velocity, slip = np.array(samples).transpose(1, 0, 2) / START
    time = np.arange(1, len(slip) + 1) * dt * every
    # The last two samples of each sphere that still slides give the line to its end.
    last = np.argmax(slip < 1.0e-3, axis=0) - 1
    before, after = (slip[k, [0, 1, 2]] for k in (last - 1, last))
    onset = time[last] + after / (before - after) * dt * every
    return time, velocity, slip, onset


def sliding_rows(tracks):
    """Onset of rolling and the speeds from then on."""
    rows = []
    for friction, (_, velocity, slip, onset) in tracks.items():
        expected = 2.0 / 7.0 * START / (friction * GRAVITY)
        end, spin = velocity[-1], velocity[-1] - slip[-1]
        for what, off in (
            ("onset of rolling, 2 u₀ / (7 μ g)", onset / expected - 1.0),
            ("v = 5/7 u₀", 1.4 * end - 1.0),
            ("ω R = 5/7 u₀", 1.4 * spin - 1.0),
        ):
            worst = 100.0 * np.abs(off).max()
            rows.append(at_most(f"slide to roll, μ = {friction}: {what}, largest error", 0.1, worst, "%"))
    return rows


def incline(restitution, static, rolling, tan, time_step):
    """What each sphere does on a slope, (3,) "rests", "rolls", "slides"; its acceleration over g, and that of
    the closed form."""
    cos = 1.0 / np.sqrt(1.0 + tan**2)
    pull = GRAVITY * np.array([tan * cos, 0.0, -cos])
    sim, arm = resting(wall_law(restitution, static, rolling), time_step, pull, "edem")
    half = round(0.5 * LET_GO / time_step)
    sim.advance(half)
    early, _ = motion(sim, arm)
    sim.advance(half)
    late, slip = motion(sim, arm)
    # A fiftieth of what the gentlest slope here beyond a limit gives; creep would be above it.
    faintest = 1.0e-4 * GRAVITY * sim.time
    does = np.where(late < faintest, "rests", np.where(slip < faintest, "rolls", "slides"))
    expected = max(0.0, 5.0 / 7.0 * cos * (tan - rolling), cos * (tan - static))
    return does, (late - early) / (half * time_step * GRAVITY), expected


def threshold(name, law, limit, states, time_step):
    """A row for the slope where one state becomes the other, and the largest error of accelerations."""
    slopes = limit + APART * np.array([-1.5, -0.5, 0.5, 1.5])
    runs = [incline(*law, tan, time_step) for tan in slopes]
    right = [np.all(does == states[k // 2]) for k, (does, _, _) in enumerate(runs)]
    seen = [" and ".join(sorted(set(does))) for does, _, _ in runs]
    row = Row(
        name,
        f"{states[0]}, {states[1]} from {limit:.4g}",
        f"{seen[1]} at {slopes[1]:.4g}, {seen[2]} at {slopes[2]:.4g}",
        f"± {APART / 2.0} in tan α",
        all(right),
    )
    return row, max(np.abs(obtained - expected).max() for _, obtained, expected in runs)


def incline_rows():
    """Both limits for each law, at a fine step and at the study's."""
    rows, off = [], {}
    for label, time_step in (("5·10⁻⁶ s", 5.0e-6), ("4·10⁻⁵ s", TIME_STEP)):
        worst = 0.0
        for law in LAWS:
            _, static, rolling = law
            name = f"incline, μ_s = {static}, μ_r = {rolling}, {label}"
            for limit, states in (
                (rolling, ("rests", "rolls")),
                (3.5 * static - 2.5 * rolling, ("rolls", "slides")),
            ):
                row, error = threshold(name, law, limit, states, time_step)
                rows.append(row)
                worst = max(worst, error)
        off[label] = worst
    rows += [
        at_most(f"incline, {label}: acceleration over g, largest error", 0.001, worst)
        for label, worst in off.items()
    ]
    return rows


def measure(figures):
    """Rows of sliding that becomes rolling, and of the incline."""
    tracks = {friction: slide_to_roll(friction) for friction in FRICTIONS}
    rows = sliding_rows(tracks) + incline_rows()
    if figures:
        draw(figures, tracks)
    return rows


def draw(folder, tracks):
    """Velocity and spin of the sliding spheres over time; acceleration on the incline over its slope."""
    figure, (one, two) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for colour, (friction, (time, velocity, slip, _)) in zip(COLOURS, tracks.items(), strict=True):
        scaled = friction * GRAVITY * time / START
        one.plot(scaled, velocity[:, 1], color=colour, lw=1)
        one.plot(scaled, velocity[:, 1] - slip[:, 1], color=colour, lw=1)
    one.axvline(2.0 / 7.0, color="0.5", ls="--", lw=1)
    one.axhline(5.0 / 7.0, color="0.5", ls="--", lw=1)
    one.text(0.05, 0.99, r"$v/u_0$", va="bottom")
    one.text(0.12, 0.2, r"$\omega R/u_0$", va="bottom")
    one.text(0.42, 0.7, "5/7", color="0.4", va="top", ha="right")
    one.text(0.29, 0.02, "2/7", color="0.4", va="bottom")
    one.text(0.295, 0.45, "μ = 0.1, 0.3, 0.5\nand 1 coincide", va="center")
    one.set_ylim(0, 1.1)
    one.set_xlabel(r"$\mu g t/u_0$")
    one.set_ylabel("velocity, spin")
    law = LAWS[1]
    _, static, rolling = law
    slopes = np.linspace(0.0, 1.6, 33)
    runs = [incline(*law, tan, TIME_STEP) for tan in slopes]
    two.plot(slopes, [expected for _, _, expected in runs], color="0.5", lw=1)
    for state, colour in zip(("rests", "rolls", "slides"), COLOURS, strict=False):
        there = [k for k, (does, _, _) in enumerate(runs) if (does == state).all()]
        two.plot(slopes[there], [runs[k][1].mean() for k in there], "o", ms=4, mfc="none", color=colour)
        middle = there[len(there) // 2]
        two.text(slopes[middle], runs[middle][1].mean() + 0.05, state, color=colour, ha="right", va="bottom")
    for limit in (rolling, 3.5 * static - 2.5 * rolling):
        two.axvline(limit, color="0.5", ls="--", lw=1)
    two.text(0.63, 0.05, "line: closed form", transform=two.transAxes, color="0.4", ha="right")
    two.set_xlabel(r"slope tan α ($\mu_s = 0.5$, $\mu_r = 0.25$, 4·10⁻⁵ s)")
    two.set_ylabel("acceleration over g")
    save_plain(figure, folder / "friction.png")
