"""What a study may not be, and what is only unusual: the rules that no single value can break.

Works on the models' attributes alone. A refusal or warning about designs is said once, for the worst of them.
"""

import bisect
import difflib
import re
from contextlib import suppress

from hopperopt import design as plans
from hopperopt import findings
from hopperopt.document import ConfigError, dotted_keys, mistake

SIMULATED = {"hopper", "insert", "particles", "wall", "contact", "filling", "discharge", "simulation"}
MOST_RUNS = 10_000  # of the plan, and of the verification
MOST_CORNERS = 256
HEIGHTS = range(1, 100_000)  # mm
FOLDS = 5  # of the cross-validation


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
        yield findings.sentence(finding, where)


def mistakes(study, faulty):
    """Sentences for all that is wrong with a study; `faulty` names the sections that could not be read."""
    found, blocked = [], set(faulty)
    rules = (
        ("keys", SIMULATED | {"factors"}, _factor_keys),
        ("plan", {"factors", "design"}, _plan),
        ("runs", {"design", "infill", "verification", "plan", "keys"}, _runs),
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
        return found + findings.refusals(study.without_insert())
    return found + list(_grouped(designs(study), findings.refused))


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
    """Plan, infill and verification have no more runs each than Snakemake can take."""
    verification = study.verification
    numbers = {"design.replicates": (study.design.replicates, study.plan)}
    numbers["verification.replicates"] = (verification.replicates, verification.cases)
    for name, replicates in verification.replicates_of.items():
        numbers[f"verification.replicates_of.{name}"] = (replicates, verification.cases)
    proposed = sum(map(len, study.proposals()))
    if proposed * study.design.replicates > MOST_RUNS:
        allowed = f"at most {MOST_RUNS // proposed} for {proposed} designs of infill ({MOST_RUNS} runs)"
        yield mistake("design.replicates", study.design.replicates, allowed)
        return
    for key, (replicates, designs) in numbers.items():
        if len(designs) * replicates > MOST_RUNS:
            allowed = f"at most {MOST_RUNS // len(designs)} for {len(designs)} designs ({MOST_RUNS} runs)"
            yield mistake(key, replicates, allowed)


def _network(study):
    """The surrogate's settings go with each other and with the number of experiments."""
    surrogate, count = study.surrogate, len(study.plan)
    chosen, sizes = surrogate.selected_hidden_nodes, surrogate.hidden_nodes
    if len(set(sizes)) < len(sizes):
        yield mistake("surrogate.hidden_nodes", sizes, "numbers that differ")
    if chosen != "auto" and chosen not in sizes and surrogate.model != "paper":
        allowed = f"auto or one of {', '.join(map(str, sizes))} (surrogate.hidden_nodes)"
        yield mistake("surrogate.selected_hidden_nodes", chosen, allowed)
    held_out = surrogate.validation_experiments + surrogate.test_experiments
    if count - held_out < 2:
        allowed = f"at most {count - 2} experiments for validation and test together, of {count}"
        yield mistake("surrogate.validation_experiments", surrogate.validation_experiments, allowed)
        return
    # The comparison of the surrogates leaves one experiment out, whatever the split.
    judging = surrogate.test_experiments if surrogate.split == "experiments" else 1
    if surrogate.networks["selected_hidden_nodes"] == "auto" and count - judging < FOLDS:
        allowed = f"auto only with {FOLDS} experiments or more that are not the test's"
        yield mistake("surrogate.selected_hidden_nodes", "auto", allowed)
    if surrogate.split == "experiments":
        yield from _split(study, count, held_out)


def _split(study, count, held_out):
    """Enough whole experiments to train on."""
    surrogate = study.surrogate
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
            allowed = f"a number for each of {', '.join(study.factors)}, or null to leave the case out"
            yield mistake(f"verification.cases.{name}", case, allowed)


def _names(study):
    """No case bears the name of an experiment, whose seeds it would share, or of what another case is."""
    verification, taken = study.verification, {name for name, _ in study.experiments()}
    for name, case in verification.cases.items():
        if name in taken or re.fullmatch(r"exp_\d+", name) or name.startswith(plans.PROPOSED):
            yield mistake(f"verification.cases.{name}", name, "a name that no experiment has")
        elif name in verification.words and case != name:
            yield mistake(f"verification.cases.{name}", case, f"{name} (a case of this name is that)")
    # The number of runs of a word is no mistake where its case is left out.
    known = dict.fromkeys([*verification.cases, *verification.words])
    for name in verification.replicates_of:
        if name not in known:
            yield mistake(f"verification.replicates_of.{name}", name, ", ".join(known))


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


def designs(study):
    """(name, labels, setup) of every simulation whose design the configuration knows."""
    known = dict(study.experiments())
    if study.optimise.select == "explicit":
        known["optimise.explicit"] = study.optimise.explicit
    known |= {name: case for name, case in study.cases().items() if not isinstance(case, str)}
    return [
        (name, design or {}, study.without_insert() if design is None else study.with_design(design))
        for name, design in known.items()
    ]


def warnings(study):
    """Sentences for what is allowed but unusual, in the designs and at the corners of the optimiser's box."""
    found = list(_grouped(designs(study), findings.unusual))
    corners = plans.corners(study.levels) if 2 ** len(study.factors) <= MOST_CORNERS else []
    extremes = [("a corner", corner, study.with_design(corner)) for corner in corners]
    refused = _grouped(extremes, findings.refused)
    found += _other_level(study)
    found += _unused_columns(study)
    found += _narrow_plan(study)
    found += _far_cases(study)
    return found + [f"the optimiser may propose designs that are refused: {sentence}" for sentence in refused]


def _other_level(study):
    """A fixed number of particles that fills the hopper to quite another level than the one that is named."""
    *_, setup = designs(study)[0]
    count, level = setup.filling.particles, setup.filling.level_mm
    if count is None:
        return
    reached = bisect.bisect(HEIGHTS, count, key=lambda height: setup.particles_up_to(height / findings.MM))
    if abs(reached - level) > 2 * setup.particles.diameters_mm[-1]:
        yield (
            f"filling.level_mm: {count} particles fill the hopper to about {reached} mm, not {level:g} mm; "
            "the height of their fall, drawing, warnings and logs go by that level"
        )


def _unused_columns(study):
    """Columns of an own plan from which nothing follows."""
    file = study.design.csv.file
    for column in study.unused_columns:
        yield f"design.csv.file: {file} has a column {column}, which is no factor and not used"


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


def _far_cases(study):
    """Fixed cases outside the factors' ranges, of which the surrogate knows nothing."""
    for case, design in study.verification.cases.items():
        if isinstance(design, dict):
            for name, (low, high) in study.bounds.items():
                if not low <= design[name] <= high:
                    yield (
                        f"verification.cases.{case}.{name}: {design[name]:g} lies outside the factor's "
                        f"range, {low:g} to {high:g}, where the surrogate's prediction means little"
                    )
