"""Beverloo's law: the discharge of a flat-bottomed cylinder.

The study's spheres and walls, no insert, a flat bottom with an outlet of 24, 30, 36 and 42 mm, that is 8 to
14 mean diameters d = 3 mm. Beverloo (1961): W = C ρ_b sqrt(g) (D - k d)^2.5, so that W^(2/5) against D is a
straight line that meets zero at D_0 = k d, the annulus at the outlet's edge that the grains' size leaves
empty. Measured k lie between 1 and 2 (about 1.4 for spheres of one size), and C near 0.58. Friction,
dilation and collisions decide the rate together, and nothing here is fitted to it: r² above 0.995 and 1 < k
< 2.

The bed is twice as deep as the largest outlet and poured as in the study, in the study's cylinder of 100
mm. The usual rule asks for D + 30 d, 132 mm, before the rate is free of the cylinder's width (Nedderman,
Statics and Kinematics of Granular Materials, 1992); so the largest outlet is measured in that width as
well, and must give the same rate within 5 %. The rate is that between M = 0.2 and 0.6. M is the mass that
has left over all that leaves until the flow of half a second is below a tenth of the mean rate: a heap stays
on the flat bottom. In fractions of the whole batch the window would reach into the end, when the bed above
the outlet is less deep than the outlet is wide and the rate falls. ρ_b is the density of the spheres times
the solid fraction of the core (see Bulk). Over the smallest outlet, six coarse spheres wide, an arch can form
that stays. Such a bed has no rate; another is poured, and their number is told.
"""

import math
from itertools import pairwise

import numpy as np

from hopperopt import experiment
from hopperopt.figures import style
from hopperopt.monitors import filling_level
from hopperopt.provenance import code_digest
from validation import experiments
from validation.bulk import Core
from validation.kept import kept
from validation.report import Row, within

OUTLETS = (0.024, 0.030, 0.036, 0.042)  # m
WIDTH, WIDE = 0.100, 0.132  # m, cylinders
MEAN_DIAMETER, SURFACE_MEAN = 0.003, 0.099 / 29  # m: by number; sum of d³ over sum of d²
DEPTH = 2 * OUTLETS[-1]
WINDOW = (0.2, 0.6)  # of M
REST = 1.0e-3  # of m g d, kinetic energy per sphere of a settled bed
LOOK = 0.05  # s between two looks at the flow
TRICKLE = 0.1  # of the mean rate, over
PAUSE = 0.5  # s, so that an arch that soon falls ends nothing
ARCHED, BEDS = 0.5, 5  # share of the batch: a bed of which less leaves is poured anew, so often at most
GRAVITY = 9.81


def measure(figures):
    """Rows: straightness, k, C, the width of the cylinder, and the rate's steadiness."""
    vessels = [*((outlet, WIDTH) for outlet in OUTLETS), (OUTLETS[-1], WIDE)]
    *flows, wide = experiments.in_two_processes(discharge, vessels)
    fit = Fit(np.array(OUTLETS), np.array([rate(flow, *WINDOW) for flow in flows]))
    k, error = fit.zero / MEAN_DIAMETER, fit.zero_error(np.array([_rate_error(flow) for flow in flows]))
    bulk = np.mean([flow["bulk_density"] for flow in flows])
    c = fit.slope**2.5 / (bulk * math.sqrt(GRAVITY))
    both = (rate(flow, *WINDOW) for flow in (flows[-1], wide))
    if figures is not None:
        _draw(flows, fit, figures / "beverloo.png")
    return [
        Row("W^(2/5) against D: r²", "above 0.995", f"{fit.r2:.5f}", "bound", bool(fit.r2 > 0.995)),
        Row("k = D_0 / d", "between 1 and 2", f"{k:.2f}", "bound", bool(1 < k < 2)),
        Row("k's standard error; k by the surface mean diameter 3.41 mm", "",
            f"{error / MEAN_DIAMETER:.2f}; {fit.zero / SURFACE_MEAN:.2f}", "", True),
        Row("C", "0.58", f"{c:.3f} (ρ_b {bulk:.0f} kg/m³)", "", True),
        within("W, 42 mm, in a cylinder of 132 mm, against 100 mm", *both, 0.05, "kg/s", relative=True),
        *(_rate_row(*one) for one in zip(OUTLETS, flows, fit.law(), strict=True)),
    ]  # fmt: skip


def discharge(vessel):
    """Exit times (s) in order, mass that has left by then and the batch's (kg), bulk density (kg/m3), and how
    many beds were poured before one flowed.

    `vessel`: diameters (m) of the outlet and of the cylinder.
    """
    outlet, width = vessel
    study = experiments.study().with_values(
        {
            "insert.shape": "none",
            "hopper.half_angle_deg": 90,
            "hopper.outlet_radius_mm": 500 * outlet,
            "hopper.cylinder_radius_mm": 500 * width,
            "filling.level_mm": 1000 * DEPTH,
        }
    )
    name = f"outlet_{1000 * outlet:.0f}_{1000 * width:.0f}"
    for bed in range(BEDS):
        case = study.simulation_case(None, name, bed)
        key = [case, REST, LOOK, TRICKLE, PAUSE, code_digest("hopperopt.experiment")]
        flow = kept(name, key, lambda case=case: _discharge(case), solver=False)
        if flow["mass"][-1] > ARCHED * flow["batch"]:
            break
    return flow | {"arched": bed}


def _discharge(case):
    sim = experiment.build(case)
    mass = sim.by_identity(sim.spheres.mass)
    diameter = np.repeat(case["particles"]["diameters"], case["particles"]["counts"])
    look = round(LOOK / case["time_step"])
    sim.advance(4 * look)
    while sim.energy()[0] > REST * GRAVITY * mass.sum() * diameter.mean():
        sim.advance(look)
    position = sim.by_identity(sim.spheres.position)
    level = filling_level(position, diameter / 2, sim.contacts(), case)
    core = Core(position, diameter, case["walls"], level)
    sim.open("gate", case["discharge"]["sensor"])
    left, back = [0.0], round(PAUSE / LOOK)  # mass that has left at each look
    while len(left) <= back or left[-1] - left[-1 - back] > TRICKLE * PAUSE * left[-1] / sim.time:
        sim.advance(look)
        left.append(mass[np.isfinite(sim.exit_time)].sum())
    order = np.argsort(sim.exit_time)[: np.count_nonzero(np.isfinite(sim.exit_time))]
    return {
        "time": sim.exit_time[order],
        "mass": np.cumsum(mass[order]),
        "batch": mass.sum(),
        "bulk_density": core.solid_fraction * case["particles"]["density"],
    }


def rate(flow, low, high):
    """Mean rate (kg/s) between two shares of the mass that leaves."""
    mass = flow["mass"]
    begin, end = np.interp([low, high], mass / mass[-1], flow["time"])
    return (high - low) * mass[-1] / (end - begin)


def _rate_error(flow):
    """Standard error (kg/s) of the rate, from the scatter of eight parts of the window."""
    edges = np.linspace(*WINDOW, 9)
    return np.std([rate(flow, *part) for part in pairwise(edges)], ddof=1) / math.sqrt(8)


def _rate_row(outlet, flow, law):
    halves = ", ".join(f"{rate(flow, *window):.4f}" for window in ((0.2, 0.4), (0.4, 0.6)))
    stays = 100 * (1 - flow["mass"][-1] / flow["batch"])
    text = f"{rate(flow, *WINDOW):.4f} kg/s (M 0.2 to 0.4, 0.4 to 0.6: {halves}); {stays:.0f} % stay"
    if flow["arched"]:
        text += f"; {flow['arched']} beds before it arched over"
    return Row(f"W, outlet {1000 * outlet:.0f} mm, against the fit", f"{law:.4f} kg/s", text, "", True)


class Fit:
    """Least squares of W^(2/5) = slope (D - zero)."""

    def __init__(self, outlets, rates):
        self.outlets, self.rates, self.root = outlets, rates, rates**0.4
        self.slope, offset = np.polyfit(outlets, self.root, 1)
        self.zero = -offset / self.slope
        self.r2 = np.corrcoef(outlets, self.root)[0, 1] ** 2

    def zero_error(self, errors):
        """Standard error (m) of the zero for those of the rates (kg/s)."""
        shifted = self.rates + np.diag(errors)
        return math.sqrt(sum((Fit(self.outlets, rates).zero - self.zero) ** 2 for rates in shifted))

    def law(self):
        """Rates (kg/s) of the fit at its outlets."""
        return (self.slope * (self.outlets - self.zero)) ** 2.5


@style.styled
def _draw(flows, fit, path):
    """The straight line, and the mass that has left over time with the window marked."""
    page = style.page(style.PAGE, 72)
    line, course = style.panels(page, 1, 2, style.Frame(13, 4, 11, 4), (18, 0))[0]
    ends = np.array([fit.zero, 1.05 * OUTLETS[-1]])
    line.plot(1000 * ends, fit.slope * (ends - fit.zero), color=style.FAINT)
    line.plot(1000 * fit.outlets, fit.root, "o", color="#0072B2")
    words = f"$k\\,d$ = {1000 * fit.zero:.1f} mm"
    line.annotate(words, (1000 * fit.zero, 0), (16, 4), textcoords="offset points")
    line.set(xlim=(0, 46), ylim=(0, None), xlabel="outlet $D$ / mm", ylabel=r"$W^{2/5}$ / (kg/s)$^{2/5}$")
    for outlet, flow in zip(OUTLETS, flows, strict=True):
        times, mass = flow["time"], flow["mass"]
        inside = (mass > WINDOW[0] * mass[-1]) & (mass < WINDOW[1] * mass[-1])
        course.plot(times, mass, color=style.FAINT)
        course.plot(times[inside], mass[inside], color="#0072B2", linewidth=2)
        place = (times[-1], mass[-1])
        course.annotate(f"{1000 * outlet:.0f} mm", place, (7, 3), textcoords="offset points", ha="right")
    course.annotate("thick: $M$ from 0.2 to 0.6", (0.98, 0.05), xycoords="axes fraction", ha="right")
    course.set(xlim=(0, None), ylim=(0, None), xlabel="time / s", ylabel="mass that has left / kg")
    style.save(page, [path], 150)
