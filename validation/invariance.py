"""What must not matter: direction, handedness, numbering, a moving observer.

The bed of the case below, stirred and pressed by a tilted weight, moves for 50 steps; so does the same bed
turned about the axis, seen in a mirror through the axis, or with its spheres numbered otherwise. The spheres
without walls and weight, driven into each other, are also turned about a slanted axis and watched from a
moving frame. Once the change is undone, it must have left no trace. An error is the largest one of any
component of any sphere or contact, over the smallest diameter for positions, and over the largest component
in the bed for velocities, spins and tangential springs; a row shows the worst of the four. Round-off grows
with every collision: hence 1e-10 and not less. Steps are of 4e-5 s, as in the study, but of 2e-5 s with
`cdt`: at 4e-5 s its torque turns the spin of a sphere that is held at a wall round and round, and round-off
goes beyond 1e-10.
"""

import numpy as np

from validation import bed
from validation.report import Row, at_most

STEPS = 50
TIME_STEP = {"edem": bed.TIME_STEP, "cdt": 0.5 * bed.TIME_STEP}  # s
LEAST = {"bed": 200, "cluster": 100}  # contacts between spheres after those steps
TOLERANCE = 1e-10
ANGLE = 1.0  # rad
MIRROR = np.array([0.6, 0.8, 0.0])  # its normal
UNTURNED, AT_REST = np.eye(3), np.zeros(3)
DRIFT = np.array([1.0, -2.0, 3.0])  # m/s, of the moving frame
SPREAD, IMPLOSION = 0.05, 40.0  # the cluster: the bed blown up by this, its spheres flying back (1/s)


def measure(figures):
    """Undo each change and compare, for both models of rolling friction."""
    x, v, omega, radius = bed.stirred()
    order = np.random.default_rng(4).permutation(len(x))
    outward = x - x.mean(axis=0)
    starts = {
        "bed": (x, v, omega, radius),
        "cluster": (x + SPREAD * outward, v - IMPLOSION * outward, omega, radius),
    }
    changes = {
        "bed": {
            "turned by 1 rad about the axis": {"turn": rotation([0.0, 0.0, 1.0])},
            "in a mirror": {"turn": np.eye(3) - 2.0 * np.outer(MIRROR, MIRROR)},
            "numbered otherwise": {"order": order},
        },
        "cluster": {
            "turned by 1 rad about (1, 2, 2)": {"turn": rotation([1.0, 2.0, 2.0])},
            "from a moving frame": {"drift": DRIFT},
        },
    }
    rows = []
    for rolling in ("edem", "cdt"):
        for name, some in changes.items():
            setting = starts[name], rolling, name == "bed"
            plain = moved(*setting)
            for how, change in some.items():
                error = difference(moved(*setting, **change), plain, 2 * radius.min())
                rows.append(at_most(f"{rolling}: {name} {how}", TOLERANCE, error))
            touching = int(plain["springs"].any(axis=2).sum() / 2)
            test, least = f"{rolling}: {name}, contacts between spheres at the end", LEAST[name]
            rows.append(Row(test, f"at least {least}", str(touching), "bound", touching >= least))
    return rows


def rotation(axis):
    """Matrix of a rotation by ANGLE about an axis (Rodrigues' formula)."""
    across = np.cross(np.eye(3), axis / np.linalg.norm(axis))  # across @ x is axis x x
    return np.eye(3) + np.sin(ANGLE) * across + (1.0 - np.cos(ANGLE)) * across @ across


def moved(start, rolling, walled, turn=UNTURNED, order=None, drift=AT_REST):
    """Change the start, let it move, undo the change.

    Arguments: `start`, positions, velocities, spins (n, 3) and radii (n,); `walled`, whether in the hopper,
    with weight, or free; `turn`, an orthogonal matrix; `order`, a permutation; `drift` m/s. Returns arrays by
    name, SI units; springs of all pairs (n, n, 3) and of all walls (n, walls, 2, 3).
    """
    x, v, omega, radius = start
    order = np.arange(len(x)) if order is None else order
    axial = np.linalg.det(turn) * turn  # spins are axial vectors: a mirror turns them round
    sim = bed.simulation(
        (x @ turn.T)[order], (v @ turn.T + drift)[order], (omega @ axial.T)[order], radius[order],
        turn @ bed.GRAVITY if walled else 0.0, bed.WALLS if walled else {}, rolling, TIME_STEP[rolling],
    )  # fmt: skip
    sim.advance(STEPS)
    pairs, touches = bed.springs(sim)
    springs, at_walls = np.zeros((len(x), len(x), 3)), np.zeros((len(x), len(bed.WALLS), 2, 3))
    for (i, j), spring in pairs.items():
        springs[order[i], order[j]], springs[order[j], order[i]] = spring @ turn, -spring @ turn
    for (i, wall), several in touches.items():
        at_walls[order[i], list(bed.WALLS).index(wall), : len(several)] = several @ turn
    values = {name: np.empty_like(x) for name in ("position", "velocity", "spin")}
    for name, value in values.items():
        value[order] = sim.by_identity(getattr(sim.spheres, name))
    return {
        "position": (values["position"] - drift * sim.time) @ turn,
        "velocity": (values["velocity"] - drift) @ turn,
        "spin": values["spin"] @ axial,
        "springs": springs,
        "springs at walls": at_walls,
    }


def difference(changed, plain, diameter):
    """The worst error: of positions over the smallest diameter (m), else over the largest component."""
    scale = {name: np.abs(value).max() for name, value in plain.items()} | {"position": diameter}
    scale["springs at walls"] = scale["springs"]
    return np.max([np.abs(changed[name] - plain[name]).max() / scale[name] for name in plain])
