"""What a time step means to single contacts: friction held at rest, periods and dashpots by load."""

import math

import numpy as np
from scipy.spatial import cKDTree

from hopperopt.dem.materials import contact_law
from hopperopt.dem.simulation import Simulation
from hopperopt.figures import labels, style

COARSE, FINE = 4.0e-5, 1.0e-5  # s
DENSITY, GRAVITY, FRICTION = 2285.0, 9.81, 0.5
RESTITUTION = {"sphere": 0.7, "wall": 0.2}
MATERIAL = {"sphere": (1.0e7, 0.25), "wall": (2.2e7, 0.25)}  # shear modulus (Pa), Poisson's ratio
CONTACTS = {  # radii of the sphere and of what it touches (m)
    "2 mm on 2 mm": (0.001, 0.001),
    "2 mm on 4 mm": (0.001, 0.002),
    "4 mm on 4 mm": (0.002, 0.002),
    "2 mm on wall": (0.001, math.inf),
    "4 mm on wall": (0.002, math.inf),
}
SPEEDS = (0.05, 0.5, 3.0)  # m/s
HOLDING_TIME, CREEP = 0.2, 1.0e-6  # s, m/s: a sphere still faster than this does not rest


def sphere_mass(radius):
    """Mass (kg)."""
    return DENSITY * 4 / 3 * math.pi * radius**3


def _law(other, rolling=0.0, friction=FRICTION):
    return contact_law(MATERIAL["sphere"], MATERIAL[other], RESTITUTION[other], friction, rolling)


def _pair(radii):
    """Law, effective radius (m) and effective mass (kg)."""
    first, second = radii
    law = _law("wall" if math.isinf(second) else "sphere")
    return law, 1 / (1 / first + 1 / second), 1 / (1 / sphere_mass(first) + 1 / sphere_mass(second))


def bed_loads(run):
    """Median and 99th percentile of the elastic forces (N) between the spheres of a settled bed."""
    position, radius = run["position_opening"].astype(float), run["diameter"] / 2
    one, other = cKDTree(position).query_pairs(2 * radius.max(), output_type="ndarray").T
    overlap = radius[one] + radius[other] - np.linalg.norm(position[one] - position[other], axis=1)
    effective = radius[one] * radius[other] / (radius[one] + radius[other])
    force = 4 / 3 * _law("sphere").modulus * np.sqrt(effective) * np.maximum(overlap, 0) ** 1.5
    return np.percentile(force[overlap > 0], [50, 99])


def friction_held(radii, strength, step):
    """Largest ratio of tangential to normal force at which a sphere rests, under `strength` times gravity.

    Found by bisection of the slope. At rest the contact bears the weight, so that the ratio is the tangent of
    the angle between weight and normal.
    """
    low, high, held = 0.0, 2.0, 0.0
    while high - low > 1e-3:
        tan = (low + high) / 2
        ratio = _ratio_at_rest(radii, tan, strength, step)
        low, high = (low, tan) if np.isnan(ratio) else (tan, high)
        held = np.fmax(held, ratio)
    return held


def _ratio_at_rest(radii, tan, strength, step):
    """Ratio for a sphere on a slope, or on a sphere that the slope holds fast; NaN if it slides off."""
    stack = [radii[0]] if math.isinf(radii[1]) else [radii[1], radii[0]]
    position = np.zeros((len(stack), 3))
    position[:, 2] = np.cumsum(stack) + np.cumsum([0.0, *stack[:-1]])
    pull = strength * GRAVITY / math.hypot(1, tan)
    sim = Simulation(
        position,
        np.zeros_like(position),
        stack,
        DENSITY,
        {"floor": [[0, 0], [1, 0]]},
        _law("sphere", rolling=10.0),
        _law("wall", 10.0, FRICTION if len(stack) == 1 else 5.0),
        step,
        gravity=[pull * tan, 0.0, -pull],
    )
    sim.advance(round(HOLDING_TIME / step))
    end, speed = sim.by_identity(sim.spheres.position), sim.by_identity(sim.spheres.velocity)[-1]
    slid = np.linalg.norm(speed) > CREEP
    if slid or np.linalg.norm(end[-1] - position[-1]) > radii[0] / 2:
        return np.nan
    normal = [0, 0, 1] if len(stack) == 1 else end[-1] - end[0]
    return math.tan(math.acos(np.dot(normal, [-tan, 0, 1]) / np.linalg.norm(normal) / math.hypot(1, tan)))


def overlap_under(radii, force):
    """Overlap (m) at an elastic force (N)."""
    law, radius, _ = _pair(radii)
    return (0.75 * force / (law.modulus * math.sqrt(radius))) ** (2 / 3)


def periods(radii, delta):
    """Natural periods (s) of the normal and of the tangential spring of free spheres in contact."""
    law, radius, mass = _pair(radii)
    root = math.sqrt(radius * delta)
    s_n, s_t = 2 * law.modulus * root, 8 * law.shear_modulus * root
    return 2 * math.pi * math.sqrt(mass / s_n), 2 * math.pi * math.sqrt(2 / 7 * mass / s_t)


def dashpots(radii, delta, step):
    """c_n = gamma_n dt / (2 m*) and c_t = gamma_t dt / (2 * 2/7 m*)."""
    law, radius, mass = _pair(radii)
    root = math.sqrt(radius * delta)
    c_n, c_t = (
        law.damping * math.sqrt(s * mass) * step / (2 * mass)
        for s in (2 * law.modulus * root, 8 * law.shear_modulus * root)
    )
    return c_n, 3.5 * c_t


def resting(radii, force):
    """A contact at rest, in words."""
    delta = overlap_under(radii, force)
    normal, tangential = periods(radii, delta)
    return _words(radii, delta, "a period", lambda step: f"{normal / step:.3g} ({tangential / step:.3g})")


def impact(radii, speed):
    """A head-on impact, in words; dashpots at the deepest overlap."""
    law, radius, mass = _pair(radii)
    delta = (15 / 16 * mass * speed**2 / (law.modulus * math.sqrt(radius))) ** 0.4
    return _words(radii, delta, "a contact", lambda step: f"{2.9432 * delta / speed / step:.3g}")


def _words(radii, delta, per, count):
    """Overlap, steps and dashpots at the coarse step, and at the fine one after a slash."""
    both = (COARSE, FINE)
    c_n, c_t = zip(*(dashpots(radii, delta, step) for step in both), strict=True)
    parts = [
        f"δ {1e6 * delta:.2g} µm",
        f"{' / '.join(count(step) for step in both)} steps {per}",
        f"c_n {' / '.join(f'{c:.2g}' for c in c_n)}",
        f"c_t {' / '.join(f'{c:.2g}' for c in c_t)}",
    ]
    return ", ".join(parts)


@style.styled
def draw(loads, path):
    """Steps in a period of the tangential spring, and c_t, against the load at rest, at the coarse step."""
    page = style.page(style.PAGE, 72)
    axes = style.panels(page, 1, 2, style.Frame(12, 22, 11, 8), (34, 0))[0]
    force = np.geomspace(5e-5, 1e-1, 60)
    colours = ("#0072B2", "#56B4E9", "#009E73", "#D55E00", "#CC79A7")
    steps, shares = {}, {}
    for (name, radii), colour in zip(CONTACTS.items(), colours, strict=True):
        deltas = [overlap_under(radii, one) for one in force]
        period = [periods(radii, delta)[1] / COARSE for delta in deltas]
        c_t = [dashpots(radii, delta, COARSE)[1] for delta in deltas]
        for panel, values, ends in zip(axes, (period, c_t), (steps, shares), strict=True):
            panel.plot(1000 * force, values, color=colour)
            ends[name] = (values[-1], colour)
    axes[0].axhline(math.pi, color=style.INK, linestyle=":")
    axes[0].annotate("stable above", (0.06, math.pi), (0, -3), textcoords="offset points", va="top")
    titles = ("steps of 4e-5 s in a tangential period", "$c_t$ at 4e-5 s")
    for panel, title, ends in zip(axes, titles, (steps, shares), strict=True):
        panel.set(xscale="log", xlim=(0.05, 100), ylim=(0, None), xlabel="load / mN", ylabel=title)
        for load, name in zip(loads, ("bed's median", "bed's 99 %"), strict=True):
            panel.axvline(1000 * load, color=style.FAINT, linewidth=0.6, zorder=0)
            panel.annotate(name, (1000 * load, 1), (0, 2), textcoords="offset points", ha="center",
                           xycoords=("data", "axes fraction"))  # fmt: skip
        labels.at_ends(panel, ends)
    style.save(page, [path], 150)
