"""What a study may not be, and what is only unusual: the rules that no single value can break.

Works on the models' attributes alone. A refusal or warning about designs is said once, for the worst of them.
"""

import difflib
import math
import re
from contextlib import suppress
from typing import NamedTuple

from hopperopt import case as cases
from hopperopt import design as plans
from hopperopt import geometry, impact
from hopperopt.dem.materials import contact_law
from hopperopt.document import ConfigError, dotted_keys, mistake

MM = 1000.0
SIMULATED = {"hopper", "insert", "particles", "wall", "contact", "filling", "discharge", "simulation"}
SMALLEST_GAP, USUAL_GAP = 2, 3  # coarse diameters between insert and wall
USUAL_OUTLET = 5, 200  # coarse diameters
MOST_PARTICLES = 10_000_000
MOST_RUNS = 10_000  # of the plan, and of the verification
SHORTEST_STEP, USUAL_STEP = 1e-4, 0.4  # Rayleigh times
# The scheme is stable at the paper's step for the paper's materials: those with at most its restitution and
# friction may take it without a warning.
TESTED = {"step": 0.78, "restitution": 0.7, "static_friction": 0.5}
USUAL_COMPRESSION, USUAL_REBOUND = 0.25, 1.8  # see hopperopt.impact
MOST_CORNERS = 256
FOLDS = 5  # of the cross-validation


class Finding(NamedTuple):
    """Something about one design: a key, its badness (the largest is told), and the words for it."""

    key: str
    kind: str
    badness: float
    text: str


def refusals(setup):
    """Sentences for what makes one simulation impossible; none when all is well."""
    return [_sentence(finding) for finding in _refused(setup)]


def _sentence(finding, where=""):
    return f"{finding.key}: {finding.text}".replace("{where}", where)


def _refused(setup):
    """Findings that make a simulation impossible. What does not fit a wrong hopper, or spheres of a wrong
    size, is no mistake of its own."""
    found = list(_hopper(setup)) or list(_filling(setup)) or list(_time_step(setup))
    yield from found
    if setup.insert_profile is not None and not any(finding.key.startswith("hopper") for finding in found):
        yield from _insert(setup)


def _no(key, kind, badness, value, allowed):
    return Finding(key, kind, badness, f"{value}{{where}} is not allowed; allowed: {allowed}")


def _unit(value, low, high):
    """A question for a length (mm) that would lie between `low` and `high` if it were typed in metres."""
    return f" (in metres? {value:.4g} m is {value * MM:.4g} mm)" if low <= abs(value) * MM <= high else ""


def _hopper(setup):
    hopper, coarse = setup.hopper, setup.particles.diameters_mm[-1]
    if hopper.cylinder_radius_mm <= hopper.outlet_radius_mm:
        allowed = f"more than the outlet's radius, {hopper.outlet_radius_mm:g} mm"
        allowed += _unit(hopper.cylinder_radius_mm, hopper.outlet_radius_mm, MM)
        yield _no("hopper.cylinder_radius_mm", "narrow", 0, f"{hopper.cylinder_radius_mm:g}", allowed)
    if hopper.outlet_radius_mm < coarse / 2:
        allowed = f"at least the radius of the largest sphere, {coarse / 2:g} mm"
        allowed += _unit(hopper.outlet_radius_mm, coarse / 2, hopper.cylinder_radius_mm)
        yield _no("hopper.outlet_radius_mm", "small", 0, f"{hopper.outlet_radius_mm:g}", allowed)


def _filling(setup):
    level, coarse = setup.filling.level_mm, setup.particles.diameters_mm[-1]
    if level < coarse:
        allowed = f"at least a coarse diameter, {coarse:g} mm{_unit(level, coarse, MM)}"
        yield _no("filling.level_mm", "level", -level, f"{level:g}", allowed)
    if setup.particle_count > MOST_PARTICLES:
        count = f"filling with {setup.particle_count:.2g} particles"
        allowed = f"at most {MOST_PARTICLES:g}{_unit(coarse, 0, 2 * setup.hopper.outlet_radius_mm)}"
        yield _no("particles.diameters_mm", "count", setup.particle_count, count, allowed)


def _time_step(setup):
    rayleigh = setup.particles.rayleigh_time
    if setup.time_step > rayleigh:
        allowed = f"at most {rayleigh:.3g} (the smallest sphere's Rayleigh time, s), or auto (a fifth of it)"
        yield _no("simulation.time_step_s", "step", setup.time_step, f"{setup.time_step:g}", allowed)
    elif setup.time_step < SHORTEST_STEP * rayleigh:
        allowed = f"at least {SHORTEST_STEP * rayleigh:.3g} ({SHORTEST_STEP:g} Rayleigh times, s)"
        yield _no("simulation.time_step_s", "short", -setup.time_step, f"{setup.time_step:g}", allowed)


def _insert(setup):
    profile, coarse = setup.insert_profile, setup.particles.diameters[-1]
    key = f"insert.{setup.insert.shape}"
    if geometry.crosses_axis(profile):
        yield _no(key, "axis", 0, "a profile that crosses the axis", "r above 0, and 0 only at its ends")
        return
    if geometry.crosses_itself(profile):
        yield _no(key, "crossing", 0, "a profile that crosses or touches itself", "a simple line")
        return
    if (inner := geometry.inner_radius(profile)) < coarse / 2:
        value = f"a face that looks inwards on a circle of radius {inner * MM:.3g} mm"
        yield _no(key, "hollow", -inner, value, f"no smaller than the largest sphere, {coarse / 2 * MM:g} mm")
    gap = _gap(setup)
    if gap < SMALLEST_GAP * coarse:
        value = "an insert that touches the wall or lies beyond it"
        if gap > 0:
            value = f"a gap of {gap * MM:.3g} mm between insert and wall"
        least = f"a gap of at least {SMALLEST_GAP * coarse * MM:g} mm ({SMALLEST_GAP} coarse diameters)"
        least += _unit(setup.insert.height_mm, coarse * MM, setup.filling.level_mm)
        yield _no("insert", "gap", -gap, value, least)


def _gap(setup):
    """Gap between insert and hopper (m), 0 for an insert that is not inside."""
    vessel = setup.hopper.profile(setup.column_bottom)
    inside = geometry.stays_inside(setup.insert_profile, vessel)
    return geometry.gap(setup.insert_profile, vessel) if inside else 0.0


def _unusual(setup):
    """Findings that a simulation can live with."""
    coarse, hopper = setup.particles.diameters[-1], setup.hopper
    width, (least, most) = 2 * hopper.outlet_radius_mm / MM / coarse, USUAL_OUTLET
    if width < least:
        text = f"an outlet of {width:.3g} coarse diameters{{where}} may jam; usual: {least} or more"
        yield Finding("hopper.outlet_radius_mm", "outlet", -width, text)
    elif width > most:
        text = (
            f"an outlet of {width:.3g} coarse diameters{{where}}; usual: at most {most} (all lengths in mm)"
        )
        yield Finding("hopper.outlet_radius_mm", "wide", width, text)
    depth = -setup.discharge.sensor_mm / MM
    if depth < coarse / 2:
        text = f"{-depth * MM:g}{{where}} is less than a coarse radius below the outlet"
        text += _unit(depth * MM, coarse / 2 * MM, MM)
        yield Finding("discharge.sensor_mm", "sensor", -depth, text)
    share = setup.time_step / setup.particles.rayleigh_time
    if share > USUAL_STEP and not _tested(setup, share):
        text = f"{share:.2f} Rayleigh times{{where}}: an impact may gain energy; usual: at most {USUAL_STEP}"
        yield Finding("simulation.time_step_s", "step", share, text)
    yield from _hard_impacts(setup)
    profile = setup.insert_profile
    if profile is None:
        return
    if (gap := _gap(setup)) < USUAL_GAP * coarse:
        text = (
            f"a gap to the wall of {gap / coarse:.2f} coarse diameters{{where}}; usual: {USUAL_GAP} or more"
        )
        yield Finding("insert", "gap", -gap, text)
    if (width := float(profile[:, 0].max())) < coarse / 2:
        text = f"its radius, {width * MM:.3g} mm{{where}}, is less than a coarse sphere's"
        text += _unit(width * MM, coarse / 2 * MM, setup.hopper.cylinder_radius_mm)
        yield Finding(f"insert.{setup.insert.shape}", "thin", -width, text)
    apex, level = float(profile[:, 1].max()) * MM, setup.filling.level_mm
    if apex > level:
        text = f"the apex, at {apex:.3g} mm, stands above the bed's surface, at {level:g} mm{{where}}"
        yield Finding("insert", "apex", apex - level, text)


def _hard_impacts(setup):
    """Impacts that may break the monitors of overlap and speed."""
    spheres, filling, contact = setup.particles, setup.filling, setup.contact
    fine, _, coarse = spheres.diameters
    sphere = (spheres.shear_modulus_pa, spheres.poisson_ratio)
    others = (sphere, (setup.wall.shear_modulus_pa, setup.wall.poisson_ratio))
    modulus = min(contact_law(sphere, other, 1, 0, 0).modulus for other in others)
    start = filling.speed_m_s + 3 * filling.speed_scatter_m_s
    speed = math.sqrt(start**2 + 2 * setup.simulation.gravity_m_s2 * cases.column_top(setup))
    compression = impact.compression(fine, coarse, spheres.density_kg_m3, modulus, speed)
    if compression > USUAL_COMPRESSION:
        text = (
            f"a coarse sphere that falls at {speed:.2g} m/s may compress a fine one by {compression:.2f} of "
            f"its radius{{where}}; usual: at most {USUAL_COMPRESSION} (a run that exceeds 0.3 is refused)"
        )
        yield Finding("particles.shear_modulus_pa", "soft", compression, text)
    rebound = impact.rebound(spheres.diameters, contact.particle.restitution, contact.wall.restitution)
    if rebound > USUAL_REBOUND:
        text = (
            f"a fine sphere may rebound from coarse ones at {rebound:.2f} times the speed of free fall"
            f"{{where}}; usual: at most {USUAL_REBOUND} (a run that exceeds 2 is refused)"
        )
        yield Finding("contact.particle.restitution", "rebound", rebound, text)


def _tested(setup, share):
    contacts = (setup.contact.particle, setup.contact.wall)
    return share <= TESTED["step"] and all(
        contact.restitution <= TESTED["restitution"] and contact.static_friction <= TESTED["static_friction"]
        for contact in contacts
    )


def _grouped(designs, find):
    """One sentence for each kind of finding, naming the worst design and how many share it.

    `designs` holds (name, labels, setup); where all designs share a finding, none is named.
    """
    groups = {}
    for name, labels, setup in designs:
        for finding in find(setup):
            groups.setdefault((finding.key, finding.kind), []).append((finding, name, labels))
    for members in groups.values():
        finding, name, labels = max(members, key=lambda member: member[0].badness)
        where = ""
        if len(members) < len(designs) or len({member[0].text for member in members}) > 1:
            values = ", ".join(f"{factor} {value:g}" for factor, value in labels.items())
            others = f" and {len(members) - 1} more" if len(members) > 1 else ""
            where = f" (in {name}{': ' if values else ''}{values}{others})"
        yield _sentence(finding, where)


def mistakes(study, faulty):
    """Sentences for all that is wrong with a study; `faulty` names the sections that could not be read."""
    found, blocked = [], set(faulty)
    rules = (
        ("keys", SIMULATED | {"factors"}, _factor_keys),
        ("plan", {"factors", "design"}, _plan),
        ("runs", {"design", "verification", "plan", "keys"}, _runs),
        ("network", {"surrogate", "design", "plan", "keys"}, _network),
        ("explicit", {"factors", "optimise"}, _explicit),
        ("cases", {"factors", "verification"}, _cases),
        ("names", {"cases", "plan", "keys"}, _names),
        ("plan values", {"plan", "keys"}, _plan_values),
        ("case values", {"explicit", "cases", "keys"}, _case_values),
    )
    for name, needs, rule in rules:
        if needs & blocked:
            blocked.add(name)
        elif sentences := list(rule(study)):
            found += sentences
            blocked.add(name)
    if SIMULATED & blocked:
        return found
    if {"plan values", "case values"} & blocked:  # not all designs are known, the hopper is
        return found + refusals(study.without_insert())
    return found + list(_grouped(_designs(study), _refused))


def _factor_keys(study):
    """Each factor has a name of its own and sets a number that the simulations use."""
    known = [key for key in dotted_keys(study.document) if key.partition(".")[0] in SIMULATED]
    setters = {}
    for name, factor in study.factors.items():
        place = f"factors.{name}"
        if name in plans.RESERVED:
            yield mistake(place, name, "a name that no column of the tables has, as theta_deg")
        if factor.key not in known:
            near = difflib.get_close_matches(factor.key, known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            yield mistake(f"{place}.key", factor.key, f"the key of a number that the simulations use{hint}")
        elif factor.key.startswith("particles.diameters_mm."):
            allowed = "a number other than the diameters: all experiments share one batch (its composition)"
            yield mistake(f"{place}.key", factor.key, allowed)
        elif factor.key in setters:
            yield mistake(f"{place}.key", factor.key, f"a key that {setters[factor.key]} does not set")
        else:
            yield from _factor_levels(study, place, factor)
        setters.setdefault(factor.key, name)


def _factor_levels(study, place, factor):
    """Levels differ, are allowed where the key stands, and make a difference to the simulation."""
    if len(set(factor.levels)) < len(factor.levels):
        yield mistake(f"{place}.levels", factor.levels, "levels that differ")
        return
    try:
        setups = [study.with_values({factor.key: level}) for level in factor.levels]
    except ConfigError as error:
        yield f"{place}.levels: {error}"
        return
    cases = []
    for setup in setups:
        with suppress(ConfigError):  # what is wrong with a design is said of the plan's designs
            cases.append(setup.case({}, 0))
    if len(cases) > 1 and all(case == cases[0] for case in cases):
        yield mistake(f"{place}.key", factor.key, "a number that makes a difference (this one makes none)")


def _plan(study):
    """The plan can be made from the factors."""
    if study.design.plan != "l25":
        return
    if len(study.factors) > 6:
        yield mistake("factors", list(study.factors), "at most 6 factors with plan l25")
    for name, factor in study.factors.items():
        if len(factor.levels) != 5:
            yield mistake(f"factors.{name}.levels", factor.levels, "five levels with plan l25")


def _runs(study):
    """The plan and the verification have no more runs than Snakemake can take."""
    for section, names in (("design", study.plan), ("verification", study.verification.cases)):
        replicates = getattr(study, section).replicates
        if len(names) * replicates > MOST_RUNS:
            allowed = f"at most {MOST_RUNS // len(names)} for {len(names)} designs ({MOST_RUNS} runs)"
            yield mistake(f"{section}.replicates", replicates, allowed)


def _network(study):
    """The surrogate's settings go with each other and with the number of experiments."""
    surrogate, count = study.surrogate, len(study.plan)
    chosen, sizes = surrogate.selected_hidden_nodes, surrogate.hidden_nodes
    if len(set(sizes)) < len(sizes):
        yield mistake("surrogate.hidden_nodes", sizes, "numbers that differ")
    if chosen != "auto" and chosen not in sizes:
        allowed = f"auto or one of {', '.join(map(str, sizes))} (surrogate.hidden_nodes)"
        yield mistake("surrogate.selected_hidden_nodes", chosen, allowed)
    held_out = surrogate.validation_experiments + surrogate.test_experiments
    if count - held_out < 2:
        allowed = f"at most {count - 2} experiments for validation and test together, of {count}"
        yield mistake("surrogate.validation_experiments", surrogate.validation_experiments, allowed)
    elif surrogate.split == "experiments":
        yield from _split(study, count, held_out)


def _split(study, count, held_out):
    """Enough whole experiments to train on, and for the cross-validation."""
    surrogate = study.surrogate
    if surrogate.selected_hidden_nodes == "auto" and count - surrogate.test_experiments < FOLDS:
        allowed = f"auto only with {FOLDS} experiments or more that are not the test's"
        yield mistake("surrogate.selected_hidden_nodes", "auto", allowed)
    # Two experiments for each factor can always hold its extremes, whichever the draw takes away.
    if count - held_out < 2 * len(study.factors):
        # Slow to import, and rarely needed.
        from hopperopt.files import InputError
        from hopperopt.surrogate import split

        designs = [[design[name] for name in study.factors] for _, design in study.experiments()]
        try:
            split.split_experiments(
                designs, surrogate.validation_experiments, surrogate.test_experiments, surrogate.seed
            )
        except InputError as error:
            yield f"surrogate.validation_experiments: {error}"


def _explicit(study):
    """An explicit choice is a design within the factors' ranges."""
    if study.optimise.select != "explicit":
        return
    chosen = study.optimise.explicit
    if set(chosen) != set(study.factors):
        yield mistake("optimise.explicit", chosen, f"a number for each of {', '.join(study.factors)}")
        return
    for name, levels in study.levels.items():
        low, high = plans.bounds(levels)
        if not low <= chosen[name] <= high:
            yield mistake(f"optimise.explicit.{name}", chosen[name], f"{low:g} to {high:g} (its levels)")


def _cases(study):
    """Verification cases that fix a design fix all factors; their names are no experiment's."""
    for name, case in study.verification.cases.items():
        if isinstance(case, dict) and set(case) != set(study.factors):
            allowed = f"a number for each of {', '.join(study.factors)}"
            yield mistake(f"verification.cases.{name}", case, allowed)


def _names(study):
    """No case bears the name of an experiment, whose seeds it would share."""
    taken = {name for name, _ in study.experiments()}
    for name in study.verification.cases:
        if name in taken or re.fullmatch(r"exp_\d+", name):
            yield mistake(f"verification.cases.{name}", name, "a name that no experiment has")


def _plan_values(study):
    """Each value of the plan is allowed where its factor's key stands."""
    for name, design in study.experiments():
        try:
            study.with_design(design)
        except ConfigError as error:
            yield f"{error} (in {name})"


def _case_values(study):
    """Each value of a fixed case, or of the explicit choice, is allowed where its factor's key stands."""
    fixed = {"factors (the middle levels)": plans.centre(study.levels)}
    fixed |= {f"verification.cases.{name}": case for name, case in study.cases().items()}
    if study.optimise.select == "explicit":
        fixed["optimise.explicit"] = study.optimise.explicit
    for place, design in fixed.items():
        if not isinstance(design, dict):
            continue
        try:
            study.with_design(design)
        except ConfigError as error:
            yield f"{place}: {error}"


def _designs(study):
    """(name, labels, setup) of every simulation whose design the configuration knows."""
    designs = dict(study.experiments())
    if study.optimise.select == "explicit":
        designs["optimise.explicit"] = study.optimise.explicit
    designs |= {name: case for name, case in study.cases().items() if case != "derived"}
    return [
        (name, design or {}, study.without_insert() if design is None else study.with_design(design))
        for name, design in designs.items()
    ]


def warnings(study):
    """Sentences for what is allowed but unusual, in the designs and at the corners of the optimiser's box."""
    found = list(_grouped(_designs(study), _unusual))
    corners = plans.corners(study.levels) if 2 ** len(study.factors) <= MOST_CORNERS else []
    extremes = [("a corner", corner, study.with_design(corner)) for corner in corners]
    refused = _grouped(extremes, _refused)
    found += _narrow_plan(study)
    return found + [f"the optimiser may propose designs that are refused: {sentence}" for sentence in refused]


def _narrow_plan(study):
    """Factors whose levels reach beyond an own plan: there the optimiser would trust an extrapolation."""
    if study.design.plan != "csv":
        return
    for name, levels in study.levels.items():
        values = [design[name] for _, design in study.experiments()]
        (least, most), (low, high) = (min(values), max(values)), plans.bounds(levels)
        if least > low or most < high:
            yield (
                f"factors.{name}.levels: the optimiser searches {low:g} to {high:g}, but the experiments "
                f"of the plan hold only {least:g} to {most:g}"
            )
