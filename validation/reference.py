"""The whole step against plain numpy.

A second solver, written in numpy from the equations alone (`validation/plain.py`), does the whole time step
with every sphere against every other: contact law, histories, walls, rolling friction, leapfrog. It shares
nothing with the compiled one, keeps no lists and spares no work, so that it can be read beside the papers.
The compiled solver must do the same to round-off, in a bed where everything happens at once: 240 spheres of
2, 3 and 4 mm of the study's materials, at the study's step, in a hopper with a knee over an insert with
smooth and sharp edges, pressed by 15 g, stirred and spun; after 100 steps the gate goes.

One step: before each of 300 steps the plain solver takes over positions, velocities, spins and springs of the
compiled one. After it, the largest error of any component of any sphere (contact, wall) is set against the
largest component of the same quantity in the bed; the row shows the worst step. The contacts must be the same
ones. Changes of velocity have fewer digits than velocities: the overlap that makes them is the difference of
lengths some thousand times greater. Alone: from the same start, 200 steps of each by itself; the distance of
any sphere from its double over the smallest diameter. It grows with every collision, in any two programs that
round differently. The rows on the bed say what happened in it, so that the test cannot become idle.
"""

import numpy as np

from validation import bed
from validation.plain import Plain, law
from validation.report import Row, at_most

STEPS, ALONE, OPENING = 300, 200, 100
ROUND_OFF, CHANGE, DRIFT = 1e-12, 1e-11, 1e-8  # tolerances; the drift in diameters
QUANTITIES = ("velocity", "spin", "springs", "forces on the walls")
BUSTLE = (  # what must happen in the bed: least number, unit
    ("contacts between spheres", 200, "on average"),
    ("contacts with faces of walls", 80, "on average"),
    ("contacts with edges of walls", 2, "on average"),
    ("contacts that slide", 30, "% on average"),
    ("spheres in flight", 10, "on average"),
    ("contacts made", 500, ""),
    ("contacts lost", 500, ""),
    ("springs handed on along a smooth wall", 5, ""),
)


def measure(figures):
    """Compare step by step, for both models of rolling friction."""
    rows, drawn = [], {}
    for rolling in ("edem", "cdt"):
        errors, changes, strangers, drift, bustle = compare(rolling)
        rows += [
            at_most(f"{rolling}, one step: {quantity}", ROUND_OFF, worst)
            for quantity, worst in zip(QUANTITIES, errors.max(axis=0), strict=True)
        ]
        rows += [
            at_most(f"{rolling}, one step: change of velocity", CHANGE, changes.max()),
            at_most(f"{rolling}, {STEPS} steps: contacts that only one has", 0, strangers),
            at_most(f"{rolling}, {ALONE} steps alone", DRIFT, drift.max(), "diameters"),
        ]
        rows += [
            Row(f"{rolling}, the bed: {what}", f"at least {least} {unit}".strip(),
                f"{number:.4g} {unit}".strip(), "bound", bool(number >= least))
            for (what, least, unit), number in zip(BUSTLE, bustle, strict=True)
        ]  # fmt: skip
        drawn[rolling] = errors, drift
    if figures:
        draw(figures / "reference.png", drawn)
    return rows


def plain_bed(rolling):
    """The bed in the plain solver."""
    pair = law(bed.PARTICLE, bed.PARTICLE, *bed.PAIR)
    wall = law(bed.PARTICLE, bed.PLEXIGLASS, *bed.WALL)
    x, v, omega, R = bed.stirred()
    return Plain(x, v, omega, R, bed.DENSITY, bed.WALLS, pair, wall, bed.TIME_STEP, bed.GRAVITY, rolling)


def compare(rolling):
    """Run the compiled solver, the plain one led by it, and the plain one alone.

    Returns the errors of one step (steps, quantities), those of the change of velocity (steps,), the number
    of contacts that only one had, the drift (steps,) in diameters, and the numbers that BUSTLE names.
    """
    led, alone = plain_bed(rolling), plain_bed(rolling)
    sim = bed.simulation(led.x, led.v, led.omega, led.R, rolling=rolling)
    errors, changes, drift, strangers, bustle = [], [], [], 0, Bustle()
    for step in range(STEPS):
        if step == OPENING:
            sim.open("gate", -1.0)
            for each in (led, alone):
                each.open("gate")
        before = led.v.copy()
        sim.advance(1)
        led.step()
        x, v, omega = (sim.by_identity(getattr(sim.spheres, a)) for a in ("position", "velocity", "spin"))
        xi, xi_wall, missing = springs_of(sim, led)
        compared = (
            (v, led.v),
            (omega, led.omega),
            (np.vstack([xi, xi_wall]), np.vstack([led.xi[led.touching], led.xi_wall[led.touching_wall]])),
            (np.array([sim.wall_force(w) for w in led.walls]), np.array(list(led.wall_force.values()))),
        )
        errors.append([relative(*pair) for pair in compared])
        changes.append(relative(v - before, led.v - before))
        strangers += missing
        bustle.see(led, reset=step == OPENING)
        if step < ALONE:
            alone.step()
            drift.append(np.linalg.norm(alone.x - x, axis=1).max() / (2 * led.R.min()))
        led.x, led.v, led.omega = x, v, omega
        led.xi[led.touching], led.xi_wall[led.touching_wall] = xi, xi_wall
    return np.array(errors), np.array(changes), strangers, np.array(drift), bustle.numbers()


def relative(obtained, expected):
    """Largest error of any component over the largest component (NaN if any is NaN)."""
    return np.abs(obtained - expected).max() / np.abs(expected).max()


def springs_of(sim, plain):
    """The compiled solver's springs (m) in the order of the plain one's contacts, NaN where it has none.

    Returns (pairs, 3), (wall contacts, 3) and the number of contacts that only one of the two has.
    """
    pairs, walls = bed.springs(sim)
    walls = {(i, wall, k): spring for (i, wall), held in walls.items() for k, spring in enumerate(held)}
    none = np.full(3, np.nan)
    xi = [pairs.pop(names, none) for names in both(plain.i[plain.touching], plain.j[plain.touching])]
    xi_wall, met = [], {}
    for i, s in both(*plain.touching_wall):
        place = i, plain.surfaces.owner[s]
        met[place] = met.get(place, -1) + 1  # a sphere in a corner touches several surfaces of one wall
        xi_wall.append(walls.pop((*place, met[place]), none))
    xi, xi_wall = np.reshape(xi, (-1, 3)), np.reshape(xi_wall, (-1, 3))
    return xi, xi_wall, len(pairs) + len(walls) + sum(np.isnan(a[:, 0]).sum() for a in (xi, xi_wall))


def both(first, second):
    """The elements of two arrays, two by two."""
    return list(zip(first.tolist(), second.tolist(), strict=True))


class Bustle:
    """Counts what goes on in a bed."""

    def __init__(self):
        self.steps, self.events, self.before = [], np.zeros(3, int), None

    def see(self, plain, reset):
        """Count one step; with `reset`, do not compare its contacts with the last ones (walls changed)."""
        pairs, (i, s), edge = plain.touching, plain.touching_wall, plain.surfaces.edge
        touching = np.unique(np.concatenate([plain.i[pairs], plain.j[pairs], i]))
        self.steps.append((
            len(pairs), (~edge[s]).sum(), edge[s].sum(),
            100 * plain.sliding.mean(), len(plain.R) - len(touching),
        ))  # fmt: skip
        now = dict.fromkeys(pairs.tolist())
        now |= dict(zip(both(i, s), plain.elements.tolist(), strict=True))
        if self.before is not None and not reset:
            made, lost = now.keys() - self.before.keys(), self.before.keys() - now.keys()
            handed = sum(now[place] != self.before[place] for place in now.keys() & self.before.keys())
            self.events += len(made), len(lost), handed
        self.before = now

    def numbers(self):
        """In the order of BUSTLE."""
        return [*np.mean(self.steps, axis=0), *self.events]


def draw(path, drawn):
    """Errors of single steps, and how two runs from one start part."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), sharey=False, layout="constrained")
    colours = {"edem": "#0072B2", "cdt": "#D55E00"}
    for rolling, (errors, drift) in drawn.items():
        left.semilogy(np.arange(1, STEPS + 1), errors.max(axis=1), color=colours[rolling], lw=0.8)
        right.semilogy(np.arange(1, ALONE + 1), drift, color=colours[rolling])
        right.annotate(rolling, (ALONE, drift[-1]), (4, 0), textcoords="offset points",
                       color=colours[rolling], va="center")  # fmt: skip
    for axes, limit in ((left, ROUND_OFF), (right, DRIFT)):
        axes.axhline(limit, color="black", lw=0.8, ls="--")
        axes.annotate("tolerance", (1, limit), (0, 3), textcoords="offset points")
        axes.set_xlabel("steps")
        axes.spines[["top", "right"]].set_visible(False)
    left.set(ylabel="largest relative error of one step")
    right.set(ylabel="distance from the double (diameters)", xlim=(0, 1.12 * ALONE))
    figure.savefig(path, dpi=150)
    plt.close(figure)
