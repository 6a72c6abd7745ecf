"""Restitution and bouncing.

At a fine step, 200 steps in an elastic contact, a pair of 2 and 4 mm or a sphere on the wall must rebound
with e times its impact speed to 0.5 %, for any e, whatever the phase of the time step at which they first
touch; with e = 0 with less than 1 % of it. That holds only if the contact ends at zero overlap: a normal
force clipped at zero turns 0.5 into 0.55.

At the study's own step of 4·10⁻⁵ s a contact of the smallest particles (2 mm) has three to six steps. Then
single rebounds scatter with the phase, and it is their mean over 100 phases that has to come near e: within 5
% between particles, within 15 % at the wall, at any speed that occurs in the hopper (0.05 to 3 m/s).

A dropped sphere bounces to h_k − R = (h_0 − R) e^(2k), here to 1 %: the form takes impacts for sudden, the
solver has the weight act on through the contact.
"""

import matplotlib.pyplot as plt
import numpy as np

from validation.report import at_most, save_plain, within
from validation.setups import (
    GRAVITY,
    TIME_STEP,
    effective,
    hertz_duration,
    impacts,
    on_floor,
    pair_law,
    wall_law,
)

STEPS = 200  # in an elastic contact
RESTITUTIONS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
SPEEDS = np.geomspace(0.05, 3.0, 31)  # m/s
SMALL = 0.001  # m, radius of the smallest particles
DROP, BOUNCES = 0.1, {0.9: 3, 0.7: 3, 0.5: 2}  # m; restitution: bounces
BLUE, ORANGE = "#0072B2", "#D55E00"


def rebounds(law, radii, speed, time_step, phases):
    """Rebound over impact speed, (phases,): first touch at so many instants spread evenly over a step."""
    gap = (np.arange(phases) + 0.5) / phases * speed * time_step
    velocity = np.zeros((phases, len(radii), 3))
    velocity[:, 0, 2] = -speed
    after, _ = impacts(law, np.tile(radii, (phases, 1)), velocity, time_step, gap=gap)
    return (after[:, 0, 2] - (after[:, 1, 2] if len(radii) == 2 else 0.0)) / speed


def fine(law, radii, speed=0.5):
    """Rebound over impact speed at STEPS steps in a contact, (100 phases,)."""
    lasts = hertz_duration(speed, *effective([radii]), law.modulus)[0]
    return rebounds(law, radii, speed, lasts / STEPS, 100)


def fine_rows():
    """Restitution 0 to 1 at the fine step, pairs and wall."""
    rows = []
    for name, make, radii in (("particles", pair_law, [0.001, 0.002]), ("wall", wall_law, [0.0015])):
        off = {e: np.abs(fine(make(e), radii) / e - 1.0).max() for e in RESTITUTIONS}
        worst = max(off, key=off.get)
        rows.append(
            at_most(
                f"{name}: e from 0.1 to 1, {STEPS} steps, largest error (e = {worst})",
                0.5,
                100 * off[worst],
                "%",
            )
        )
        rows.append(
            at_most(f"{name}: e = 0, rebound over impact speed", 0.01, np.abs(fine(make(0.0), radii)).max())
        )
    return rows


def coarse():
    """Mean, least and largest rebound over impact speed at the study's step, (speeds, 3); particles, wall."""
    curves = []
    for law, radii in ((pair_law(), [SMALL, SMALL]), (wall_law(), [SMALL])):
        all_ = [rebounds(law, radii, speed, TIME_STEP, 100) for speed in SPEEDS]
        curves.append(np.array([(out.mean(), out.min(), out.max()) for out in all_]))
    return curves


def bounce(restitution, bounces):
    """Heights of the lowest point of a 4 mm sphere every millisecond: times (s) and heights (m)."""
    dt, every = 4.0e-6, 250
    sim = on_floor([0.002], [[0.0, 0.0, 0.0]], wall_law(restitution), dt, gap=DROP, gravity=GRAVITY)
    flights = restitution ** np.arange(bounces + 1) * np.sqrt(8.0 * DROP / GRAVITY)
    samples = round((flights.sum() - 0.5 * flights[0] - 0.4 * flights[-1]) / (dt * every))
    heights = np.empty(samples)
    for k in range(samples):
        sim.advance(every)
        heights[k] = sim.spheres.position[0, 2] - 0.002
    return dt * every * np.arange(1, samples + 1), heights


def bounce_rows(tracks):
    """The tops of the flights."""
    rows = []
    for e, (_, z) in tracks.items():
        found = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])]
        tops = np.full(BOUNCES[e], np.nan)  # each flight must have its own
        tops[: len(found)] = found[: len(tops)]
        rows += [
            within(
                f"bounce {k}, e = {e}: h − R", 1e3 * DROP * e ** (2 * k), 1e3 * top, 0.01, "mm", relative=True
            )
            for k, top in enumerate(tops, 1)
        ]
    return rows


def measure(figures):
    """Rows at the fine and at the study's step, and of the bounces."""
    rows = fine_rows()
    curves = coarse()
    for name, curve, e, allowed in zip(("particles", "wall"), curves, (0.7, 0.2), (5.0, 15.0), strict=True):
        off = 100.0 * np.abs(curve[:, 0] / e - 1.0)
        speed = SPEEDS[off.argmax()]
        rows.append(
            at_most(f"{name}: mean e at 4·10⁻⁵ s, largest error ({speed:.2g} m/s)", allowed, off.max(), "%")
        )
    tracks = {e: bounce(e, bounces) for e, bounces in BOUNCES.items()}
    rows += bounce_rows(tracks)
    if figures:
        draw(figures, curves, tracks)
    return rows


def draw(folder, curves, tracks):
    """Restitution at the study's step over the speed; heights of the bouncing sphere over time."""
    figure, (one, two) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for curve, e, name, colour in zip(curves, (0.7, 0.2), ("particles", "wall"), (BLUE, ORANGE), strict=True):
        one.fill_between(SPEEDS, curve[:, 1], curve[:, 2], color=colour, alpha=0.2, lw=0)
        one.plot(SPEEDS, curve[:, 0], color=colour)
        one.axhline(e, color="black", ls="--", lw=1)
        one.text(0.055, e - 0.07, f"{name}: mean and range over phases", color=colour, va="top")
    one.set_xscale("log")
    one.set_xticks([0.05, 0.1, 0.2, 0.5, 1, 2, 3], ["0.05", "0.1", "0.2", "0.5", "1", "2", "3"])
    one.minorticks_off()
    one.set_ylim(0, 1)
    one.set_xlabel("impact speed (m/s)")
    one.set_ylabel("rebound over impact speed")
    for (e, (time, z)), colour in zip(tracks.items(), (BLUE, ORANGE, "#009E73"), strict=True):
        two.plot(time, 1e3 * z, color=colour, lw=1)
        fall = np.sqrt(2.0 * DROP / GRAVITY)
        for k in range(1, BOUNCES[e] + 1):
            top, when = DROP * e ** (2 * k), fall * (1.0 + 2.0 * sum(e**j for j in range(1, k)) + e**k)
            two.plot(when, 1e3 * top, "o", mfc="none", color=colour)
            if k == 1:
                two.text(when, 1e3 * top - 5.0, f"{e}", color=colour, ha="center", va="top")
    two.set_ylim(0, 105)
    two.set_xlabel("time (s)")
    two.set_ylabel("height above the floor (mm)")
    two.text(0.98, 0.97, "numbers: e\ncircles: closed form", transform=two.transAxes, ha="right", va="top")
    save_plain(figure, folder / "impact.png")
