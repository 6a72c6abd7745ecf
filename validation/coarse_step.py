"""The coarse step: 4e-5 s, judged on outflow, friction and stability.

The study's step is 77 % of the Rayleigh time of the 2 mm spheres, where 20 to 40 % are usual. So the
full-size centre design (15,000 spheres, insert 55°, 40 mm, at 29.6 mm) is simulated with 4e-5 s and with
1e-5 s, eight and five seeds, all different. A step that is too long would change friction and damping, and
with them bed and flow.

- Mean discharge time (last exit): within 2 %. One run scatters by less than 1 % (row below), so that the
  standard error of the difference is about a fifth of the tolerance.
- Mean curves m_f(M) and m_i(M), in the study's 21 windows of M: with the seeds' variances s_a²(M) and
  s_b²(M), n_a and n_b seeds and s² = ((n_a - 1) s_a² + (n_b - 1) s_b²) / (n_a + n_b - 2), two means of one
  and the same process differ by the rms sqrt(mean over M of s² (1/n_a + 1/n_b)). The measured rms is at
  most 1.5 times that; by chance alone the ratio scatters by 0.15 about 1.
- Friction held: a contact at rest whose dashpot is centred transmits its spring's force over 1 + c_t, and
  without a correction of Coulomb's limit would hold only μ / (1 + c_t). Here a sphere on a plane, or on
  another sphere, its spin held by a large rolling friction, stands under a gravity that is tilted further
  and further: the largest ratio of tangential to normal force at which it rests is the friction held, 0.5
  within 0.02. Once under its own weight, once under a gravity that gives the load which 1 % of the contacts
  in the settled bed exceed.
- `time_step_s: auto` is a fifth of the Rayleigh time π R sqrt(ρ/G) / (0.1631 ν + 0.8766) = 5.1766e-5 s.

The other rows tell what a step means to a contact, by load, at 4e-5 s and, after the slash, at 1e-5 s. At
rest: overlap δ; the natural period 2π sqrt(m*/S_n) of the normal spring, in brackets 2π sqrt(2/7 m*/S_t) of
the tangential one, in steps (leapfrog is stable above π). In an impact: deepest overlap (15/16 m* v² / (E*
sqrt(R*)))^0.4 and duration 2.94 δ/v in steps. c_n = γ_n dt / (2 m*) and c_t = γ_t dt / (2 · 2/7 m*) are the
rates of the dashpots' decay times half a step. Loads are those between the spheres of a settled bed of the
centre design.
"""

import math

import numpy as np

from hopperopt.figures import style
from hopperopt.outflow import GRID, outflow
from validation import experiments
from validation.report import Row, at_most, within
from validation.step_contacts import (
    COARSE,
    CONTACTS,
    FINE,
    FRICTION,
    GRAVITY,
    SPEEDS,
    bed_loads,
    draw,
    friction_held,
    impact,
    resting,
    sphere_mass,
)

SEEDS = 8, 5  # of the coarse and of the fine step
SHOWN = {"discharge_rate": ("kg/s", 1), "filling_level": ("mm", 1000), "filling_time": ("s", 1)}


def measure(figures):
    """Rows: outflow at both steps, friction held, `auto`, steps and damping by load."""
    coarse, fine = _runs()
    loads = bed_loads(coarse[0])
    if figures is not None:
        _draw(coarse, fine, figures / "coarse_step_curves.png")
        draw(loads, figures / "coarse_step_loads.png")
    return [*_outflow_rows(coarse, fine), *_friction_rows(loads), _auto_row(), *_table(loads)]


def _runs():
    """Runs of the centre design at the coarse and at the fine step."""
    study = experiments.study()
    centre = experiments.centre(study)
    fine = study.with_values({"simulation.time_step_s": FINE})
    named = [
        *experiments.cases(fine, centre, "fine", SEEDS[1]),  # the longest first
        *experiments.cases(study, centre, "coarse", SEEDS[0]),
    ]
    runs = experiments.run(named)
    return runs[SEEDS[1] :], runs[: SEEDS[1]]


def curves(runs):
    """Composition of the outflow of each run, (run, size class, 21)."""
    return np.array(
        [outflow(run["exit_time"], run["diameter"], run["size_class"]).mass_fraction for run in runs]
    )


def chance_rms(first, second):
    """The rms difference that chance gives two means of curves (run, M): pooled variance, see above."""
    n, m = len(first), len(second)
    pooled = ((n - 1) * first.var(axis=0, ddof=1) + (m - 1) * second.var(axis=0, ddof=1)) / (n + m - 2)
    return math.sqrt(np.mean(pooled * (1 / n + 1 / m)))


def _outflow_rows(coarse, fine):
    times, fine_times = _scalars(coarse, "discharge_time"), _scalars(fine, "discharge_time")
    share = 100 / fine_times.mean()
    gap, error = share * (times.mean() - fine_times.mean()), chance_rms(times[:, None], fine_times[:, None])
    scatter = " and ".join(f"{share * t.std(ddof=1):.2f} %" for t in (times, fine_times))
    rows = [
        within("mean discharge time, against 1e-5 s", fine_times.mean(), times.mean(), 0.02, "s", True),
        _told(
            "its difference ± standard error; scatter of a run",
            f"{gap:+.2f} ± {share * error:.2f} %; {scatter}",
        ),
    ]
    one, other = curves(coarse), curves(fine)
    for k, name in enumerate(("m_f(M)", "m_i(M)")):
        chance = chance_rms(one[:, k], other[:, k])
        rms = math.sqrt(np.mean((one[:, k].mean(axis=0) - other[:, k].mean(axis=0)) ** 2))
        rows.append(
            at_most(f"{name}: rms difference of the means over chance's {chance:.4f}", 1.5, rms / chance)
        )
    for name, (unit, scale) in SHOWN.items():
        texts = [_mean(scale * _scalars(runs, name), unit) for runs in (fine, coarse)]
        rows.append(Row(f"{name.replace('_', ' ')}, against 1e-5 s", *texts, "", True))
    return rows


def _scalars(runs, name):
    return np.array([float(run[name]) for run in runs])


def _error(values):
    return values.std(axis=0, ddof=1) / math.sqrt(len(values))


def _mean(values, unit):
    return f"{values.mean():.4g} ± {_error(values):.1g} {unit}"


def _told(test, text):
    """A row that is not judged."""
    return Row(test, "", text, "", True)


def _friction_rows(loads):
    rows = []
    for name, radii in CONTACTS.items():
        weight = sphere_mass(radii[0]) * GRAVITY
        for load in (weight, loads[1]):
            held = friction_held(radii, load / weight, COARSE)
            rows.append(within(f"friction held, {name}, {1000 * load:.2g} mN", FRICTION, held, 0.02))
    return rows


def _auto_row():
    case = experiments.study().with_values({"simulation.time_step_s": "auto"}).case({}, 1)
    return within("`time_step_s: auto`", 1.03533e-5, case["time_step"], 1e-4, "s", relative=True)


def _table(loads):
    rows = []
    for name, radii in CONTACTS.items():
        forces = {
            "weight of one": sphere_mass(radii[0]) * GRAVITY,
            "bed's median": loads[0],
            "bed's 99 %": loads[1],
        }
        for words, force in forces.items():
            rows.append(_told(f"{name}, {words}, {1000 * force:.2g} mN", resting(radii, force)))
        rows += [_told(f"{name}, impact at {speed:g} m/s", impact(radii, speed)) for speed in SPEEDS]
    return rows


@style.styled
def _draw(coarse, fine, path):
    """Mean curves at both steps, each within two standard errors."""
    page = style.page(style.PAGE, 68)
    axes = style.panels(page, 1, 2, style.Frame(13, 3, 11, 8), (16, 0))[0]
    shown = {"4e-5 s": (coarse, "#D55E00", "-"), "1e-5 s": (fine, "#0072B2", "--")}
    for k, name in enumerate(("fine", "intermediate")):
        symbol = style.SYMBOLS[name]
        for runs, colour, line in shown.values():
            one = curves(runs)[:, k]
            mean, error = one.mean(axis=0), 2 * _error(one)
            axes[k].fill_between(GRID, mean - error, mean + error, color=colour, alpha=0.2, linewidth=0)
            axes[k].plot(GRID, mean, line, color=colour)
        axes[k].set(xlim=(0, 1), ylim=(0, None), xlabel=style.DISCHARGED, ylabel=f"mass fraction {symbol}")
    meanings = {
        f"{words}, {len(runs)} seeds": {"color": colour, "linestyle": line}
        for words, (runs, colour, line) in shown.items()
    }
    style.key(page, meanings, (13, 66))
    style.put(page, style.PAGE - 3, 66, "bands: two standard errors of the mean", ha="right", va="top")
    style.save(page, [path], 150)
