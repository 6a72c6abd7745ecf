"""Single impacts: the eight tests of Chung and Ooi.

C. Y. Chung and J. Y. Ooi, *Benchmark tests for verifying discrete element modelling codes at particle impact
level*, Granular Matter 13 (2011) 643–656. Rolling friction is off; T4 has a time step of 2·10⁻⁸ s (about 300
in a contact), the others at least 500 steps in a contact.

Where a contact slides from first to last touch, and in the head-on tests, there are closed forms: Hertz's
impact, and an impulse of friction of μ times the normal one. A result must lie within 1 % of them, or, where
the expected velocity is below a quarter of the incident speed, within 1 % of that speed. (The forms take the
lever arm for R. The overlap shortens it, which makes up nearly all of the differences: 0.5 % of the spin in
T5.) Where it sticks, no closed form exists. There the yardstick is the same contact law as an ordinary
differential equation, written apart from the solver and solved to eight digits with each change between
sticking and sliding as an event (`contact_ode`): the whole curve, sliding or sticking, must lie within 1 % of
the incident speed.

The points read off the paper's figures are drawn beside it. Where the contact sticks they are those of other
contact models, and no target: a spring without slip departs from them there.

T8 lets a sphere of 0.1 m hit one of 0.5 m, quasi-rigid in the paper. Here it is rigid, and 125 times as heavy
as the small one; its mass cancels out of β(x), since the surface velocity answers to an impulse J by 7/2 J/m*
whatever the two masses are.
"""

import numpy as np

from hopperopt.dem.materials import contact_law
from hopperopt.dem.simulation import Simulation
from validation.chung_ooi_figures import draw
from validation.contact_ode import Impact, rebound
from validation.report import at_most, within
from validation.setups import (
    RIGID,
    effective,
    hertz_duration,
    impacts,
    on_floor,
    shear_modulus,
    sphere_mass,
)

STEPS = 500  # in an elastic contact, at least
# Young's modulus (Pa), Poisson's ratio, density (kg/m3)
LIMESTONE, MAGNESIUM = (2.0e10, 0.25, 2500.0), (4.0e10, 0.35, 1800.0)
OXIDE, STEEL, ALUMINIUM = (3.8e11, 0.23, 4000.0), (2.08e11, 0.30, 7850.0), (7.0e10, 0.33, 2700.0)
ANGLES = np.array(
    [5, 7.5, 10, 12.5, 15, 17.5, 20, 22.5, 25, 27.5, 30, 32.5, 35, 40, 45, 50, 60, 70, 80, 85.0]
)
SLIP_RATIOS = np.concatenate([np.arange(0.25, 7.0, 0.25), np.arange(7.0, 10.0, 0.5), np.arange(10.0, 21.0)])
SPIN_RATIOS = np.geomspace(0.15, 25.0, 36)


def elastic(material):
    """(shear modulus, Poisson's ratio) of a (Young's modulus, Poisson's ratio, density)."""
    return shear_modulus(*material[:2]), material[1]


class Curve:
    """Impacts of sphere 0 (on the rigid plane, or on a larger rigid sphere 1), by the solver and by the ODE.

    Arguments: `material`; radii (1 or 2, m); restitution; friction; normal and tangential speed and spin of
    sphere 0 (arrays, m/s, rad/s); the time step (s), or None. Results, (n,): normal and tangential velocity
    after it, R omega, that of the surface `slip`; `reference`, the first three of the ODE; `incident` speed.
    """

    def __init__(self, material, radii, e, mu, normal, tangential, spin, time_step=None):
        law = contact_law(elastic(material), RIGID, e, mu, 0.0)
        n, k = len(normal), len(radii)
        radius, density = np.tile(np.array(radii, dtype=float), (n, 1)), material[2]
        velocity, turning = np.zeros((n, k, 3)), np.zeros((n, k, 3))
        velocity[:, 0, 0], velocity[:, 0, 2], turning[:, 0, 1] = tangential, -normal, spin
        if time_step is None:
            time_step = hertz_duration(normal, *effective(radius, density), law.modulus).min() / STEPS
        after, turned = impacts(law, radius, velocity, time_step, spin=turning, density=density)
        self.incident = np.hypot(normal, tangential)
        self.rolling = radius * turned[:, :, 1]
        other = after[:, 1] if k == 2 else np.zeros((n, 3))
        self.tangential, self.normal = (after[:, 0] - other)[:, [0, 2]].T
        self.slip = self.tangential - self.rolling.sum(axis=1)
        masses = *sphere_mass(radius[0], density), np.inf
        youngs, poisson, _ = material  # against a rigid body
        moduli = youngs / (1.0 - poisson**2), elastic(material)[0] / (2.0 - poisson)
        impact = Impact((*radii, np.inf)[:2], masses[:2], *moduli, e, mu)
        given = zip(tangential, -normal, spin, strict=True)
        ode = np.array([rebound(impact, (v_t, v_n), (w, 0.0)) for v_t, v_n, w in given])
        self.reference = ode[:, 0], ode[:, 1], ode[:, 2:][:, :k] * radius
        self.reference_slip = ode[:, 0] - self.reference[2].sum(axis=1)

    def off_reference(self):
        """Largest difference from the ODE, % of the incident speed."""
        v_t, v_n, rolling = self.reference
        differences = np.column_stack([self.tangential - v_t, self.normal - v_n, self.rolling - rolling])
        return 100.0 * (np.abs(differences).max(axis=1) / self.incident).max()


def off(obtained, expected, scale):
    """Largest error in %: of the expected value, or of `scale` where that is below a quarter of it."""
    whole = np.where(np.abs(expected) < 0.25 * scale, scale, np.abs(expected))
    return 100.0 * (np.abs(obtained - expected) / whole).max()


def head_on(sim, mass):
    """Deepest overlap over the radius, largest force (N) and duration (s) of an impact along z."""
    speeds = []
    for _ in range(2 * STEPS):
        speeds.append(sim.by_identity(sim.spheres.velocity)[0, 2])
        sim.advance(1)
    time_step = sim.settings.time_step
    force = mass * np.diff(speeds) / time_step
    return sim.max_overlap, np.abs(force).max(), np.count_nonzero(force) * time_step


def hertz_rows():
    """T1: two spheres at ±10 m/s. T2: a sphere on a rigid plane at 0.2 m/s. Both elastic, after Hertz."""
    law = contact_law(elastic(LIMESTONE), elastic(LIMESTONE), 1.0, 0.35, 0.0)
    position, velocity = [[0.0, 0.0, 0.02], [0.0, 0.0, 0.0]], [[0.0, 0.0, -10.0], [0.0, 0.0, 10.0]]
    t1 = Simulation(position, velocity, [0.01] * 2, LIMESTONE[2], {}, law, law, 54.20e-6 / STEPS, 0.0, "none")
    law = contact_law(elastic(MAGNESIUM), RIGID, 1.0, 0.0, 0.0)
    t2 = on_floor([0.1], [[0.0, 0.0, -0.2]], law, 767.05e-6 / STEPS, density=MAGNESIUM[2])
    rows = []
    for name, sim, radius, density, expected in (
        ("T1 two spheres", t1, 0.01, LIMESTONE[2], (368.30, 7108.2, 54.20)),
        ("T2 sphere on a rigid plane", t2, 0.1, MAGNESIUM[2], (52.123, 7232.7, 767.05)),
    ):
        ratio, force, duration = head_on(sim, float(sphere_mass(radius, density)))
        obtained = 1e6 * ratio * radius, force, 1e6 * duration
        for what, unit, hertz, value in zip(
            ("overlap", "force", "duration"), ("µm", "N", "µs"), expected, obtained, strict=True
        ):
            rows.append(within(f"{name}: {what}", hertz, value, 0.01, unit, relative=True))
    return rows


def restitution_rows():
    """T3: 3.9 m/s on a rigid plane."""
    rows = []
    for e in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        law = contact_law(elastic(OXIDE), RIGID, e, 0.0, 0.0)
        lasts = hertz_duration(3.9, *effective([[0.0025]], OXIDE[2]), law.modulus)[0]
        after, _ = impacts(law, [[0.0025]], [[[0.0, 0.0, -3.9]]], lasts / STEPS, density=OXIDE[2])
        obtained = after[0, 0, 2] / 3.9
        name = "T3 restitution"
        if e:
            rows.append(within(name, e, obtained, 0.01, relative=True))
        else:
            rows.append(at_most(f"{name} 0: rebound over impact speed", 0.01, abs(obtained)))
    return rows


def gear_rows():
    """T7: two spheres that roll on each other like gears feel no friction."""
    e, speed, radius = 0.5, 0.2, 0.1
    law = contact_law(elastic(ALUMINIUM), elastic(ALUMINIUM), e, 0.4, 0.0)
    spin = np.zeros((9, 2, 3))
    spin[:, 0, 1] = np.linspace(-24.0, 24.0, 9)
    spin[:, 1, 1] = -spin[:, 0, 1]
    velocity = np.zeros_like(spin)
    velocity[:, :, 2] = -speed, speed
    radii = np.full((9, 2), radius)
    lasts = hertz_duration(2.0 * speed, *effective(radii[:1], ALUMINIUM[2]), law.modulus)[0]
    after, turned = impacts(law, radii, velocity, lasts / STEPS, spin=spin, density=ALUMINIUM[2])
    sideways = np.abs(after[:, :, 0]).max() / speed
    change = radius * np.abs(turned - spin).max() / speed
    return [
        at_most("T7 equal surface speeds: tangential velocity over impact speed", 1e-9, sideways),
        at_most("T7: change of spin times R over impact speed", 1e-9, change),
        within("T7: normal velocity over impact speed", e, after[0, 0, 2] / speed, 0.01, relative=True),
    ]


def oblique():
    """T4 and T5, on the rigid plane; T6 on it and T8 on the larger sphere, with spin."""
    radians, none = np.radians(ANGLES), np.zeros(len(ANGLES))
    t4 = Curve(OXIDE, [0.0025], 0.98, 0.092, 3.9 * np.cos(radians), 3.9 * np.sin(radians), none, 2.0e-8)
    normal = np.full(len(SLIP_RATIOS), 5.0)
    t5 = Curve(STEEL, [1.0e-5], 1.0, 0.3, normal, SLIP_RATIOS * 0.3 * 5.0, 0.0 * normal)
    normal = np.full(len(SPIN_RATIOS), 0.2)
    spin = -3.5 * 0.4 * 1.5 * 0.2 / SPIN_RATIOS / 0.1
    t6 = Curve(ALUMINIUM, [0.1], 0.5, 0.4, normal, 0.0 * normal, spin)
    t8 = Curve(ALUMINIUM, [0.1, 0.5], 0.5, 0.4, normal, 0.0 * normal, spin)
    return t4, t5, t6, t8


def sliding_rows(t4, t5, t6, t8):
    """Against the closed forms of contacts that slide throughout."""
    mu, e, speed = 0.092, 0.98, 3.9
    slides = ANGLES >= 35.0
    cos, sin = np.cos(np.radians(ANGLES[slides])), np.sin(np.radians(ANGLES[slides]))
    impulse = mu * (1.0 + e) * speed * cos  # of friction, over the mass
    forms = (
        ("tangential velocity", t4.tangential, speed * sin - impulse),
        ("spin", t4.rolling[:, 0], 2.5 * impulse),
        ("surface velocity (rebound angle)", t4.slip, speed * sin - 3.5 * impulse),
    )
    rows = [
        at_most(f"T4 from 35°: {what}", 1.0, off(obtained[slides], expected, speed), "%")
        for what, obtained, expected in forms
    ]
    slides, unit = SLIP_RATIOS >= 7.0, 0.3 * 5.0
    x, incident = SLIP_RATIOS[slides], t5.incident[slides]
    rows += [
        at_most("T5 x ≥ 7: surface velocity", 1.0, off(t5.slip[slides], unit * (x - 7.0), incident), "%"),
        at_most("T5 x ≥ 7: spin", 1.0, off(t5.rolling[slides, 0], 5.0 * unit, incident), "%"),
    ]
    slides = SPIN_RATIOS <= 0.9
    surface = 3.5 * 0.4 * 1.5 * 0.2 / SPIN_RATIOS[slides]
    for name, curve in (("T6", t6), ("T8", t8)):
        expected = surface * (1.0 - SPIN_RATIOS[slides])
        error = off(curve.slip[slides], expected, surface)
        rows.append(at_most(f"{name} x ≤ 0.9: surface velocity β", 1.0, error, "%"))
    return rows


def measure(figures):
    """Rows of T1 to T8; the curves of T4, T5, T6 and T8 are drawn."""
    curves = oblique()
    rows = hertz_rows() + restitution_rows() + sliding_rows(*curves) + gear_rows()
    names = "T4, 5° to 85°", "T5, x to 20", "T6, x from 0.15 to 25", "T8, x from 0.15 to 25"
    for name, curve in zip(names, curves, strict=True):
        rows.append(at_most(f"{name}: off the ODE, of the incident speed", 1.0, curve.off_reference(), "%"))
    if figures:
        draw(figures, *curves, ANGLES, SLIP_RATIOS, SPIN_RATIOS)
    return rows
