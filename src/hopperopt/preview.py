"""What a study will be, before anything runs: its numbers in a table, its extreme inserts in a drawing.

Works on a study's attributes alone.
"""

import os
import textwrap
from pathlib import Path

import numpy as np

from hopperopt import checks, cost, findings, geometry
from hopperopt.figures import extremes, style
from hopperopt.progress import duration

MM = 1000.0
WIDTH = 110  # characters of a line


class Designs:
    """The designs that the configuration knows: the plan's, fixed cases, an explicit choice."""

    def __init__(self, study):
        self.known = checks.designs(study)
        self.gaps = np.array([setup.wall_gap / setup.particles.diameters[-1] for *_, setup in self.known])
        tops = [
            -np.inf if s.insert_profile is None else MM * s.insert_profile[:, 1].max() for *_, s in self.known
        ]
        self.above = np.array(tops) - [setup.filling.level_mm for *_, setup in self.known]
        openings = [np.inf if s.insert_profile is None else _opening(s) for *_, s in self.known]
        self.openings = np.array(openings)
        self.counts = np.array([setup.particle_count for *_, setup in self.known])
        self.steps = np.array([s.time_step / s.particles.rayleigh_time for *_, s in self.known])

    def named(self, index):
        """A design in words: its name and the values of its factors."""
        name, labels, _ = self.known[index]
        return ": ".join(filter(None, [name, ", ".join(f"{key} {value:g}" for key, value in labels.items())]))


def _opening(setup):
    """Width of the opening through an insert in coarse diameters, infinite where there is none."""
    return 2 * geometry.opening_radius(setup.insert_profile) / setup.particles.diameters[-1] or np.inf


def table(study, directory):
    """The lines of the table: key, value; then a line for each warning."""
    designs = Designs(study)
    rows = {
        "study": os.path.normpath(Path(directory) / study.results_dir),
        **_runs(study),
        **_geometry(study, designs),
        **_time_step(designs),
        **_cost(study, designs),
    }
    lines = []
    for key, value in rows.items():
        lines += textwrap.wrap(value, WIDTH, initial_indent=f"{key:<20}", subsequent_indent=" " * 20)
    for warning in study.warnings():
        lines += textwrap.wrap(warning, WIDTH, initial_indent="warning: ", subsequent_indent=" " * 9)
    return lines


def _runs(study):
    fillings, cases = study.design.replicates, study.verification.cases
    plan, again = len(study.plan), sum(map(study.verification.replicates_in, cases))
    parts = ", ".join(f"{name} {study.verification.replicates_in(name)}" for name in cases)
    each = f"{fillings} {'filling' if fillings == 1 else 'fillings'} of each"
    infill = fillings * sum(map(len, study.proposals()))
    infilled = (
        f"{infill} of infill ({study.infill.rounds} x {study.infill.batch} designs), " if infill else ""
    )
    return {
        "plan": f"{study.design.plan}, {plan} designs of {', '.join(study.factors)}, {each}",
        "simulations": f"{plan * fillings + infill + again}: {plan * fillings} of the plan, {infilled}"
        f"{again} of the verification ({parts})",
    }


def _geometry(study, designs):
    few, many = designs.counts.argmin(), designs.counts.argmax()
    count = f"{designs.counts[few]:,}"
    if designs.counts[many] > designs.counts[few]:
        count += f" ({designs.named(few)}) to {designs.counts[many]:,} ({designs.named(many)})"
    found = {"particles": count}
    if not np.isfinite(designs.gaps).any():
        return found
    tight, high = designs.gaps.argmin(), designs.above.argmax()
    gap = f"{designs.gaps[tight]:.2f} coarse diameters ({designs.named(tight)})"
    if np.isfinite(designs.openings).any():
        narrow = designs.openings.argmin()
        opening = f"{designs.openings[narrow]:.2f} coarse diameters ({designs.named(narrow)})"
        least = f"at least {findings.SMALLEST_GAP}, usual {findings.USUAL_OUTLET[0]} or more"
        found["smallest opening"] = f"{opening}; {least}"
    above = designs.above[high]
    place = (
        f"{abs(above):.1f} mm {'above' if above > 0 else 'below'} the bed's surface ({designs.named(high)})"
    )
    usual = f"at least {findings.SMALLEST_GAP}, usual {findings.USUAL_GAP} or more"
    return found | {"smallest gap": f"{gap}; {usual}", "highest insert": place}


def _time_step(designs):
    worst = designs.steps.argmax()
    setup, share = designs.known[worst][2], designs.steps[worst]
    text = f"{setup.time_step:.3g} s, {share:.2f} Rayleigh times of the smallest particles"
    if share > findings.USUAL_STEP:
        tested = ", tested for materials like these" if findings.tested(setup, share) else ""
        text += f": above the usual {findings.USUAL_STEP}{tested} (time_step_s: auto takes 0.2)"
    return {"time step": text}


def _cost(study, designs):
    """Expected time and memory; runs of designs yet to be found cost the plan's mean."""
    plan = len(study.plan)
    interval = study.simulation.snapshot_interval_s
    costs = [cost.expected(setup.case(labels, 0), interval) for _, labels, setup in designs.known]
    of_name = {name: each for (name, *_), each in zip(designs.known, costs, strict=True)}
    mean = np.mean([each.seconds for each in costs[:plan]], axis=0)
    total = (plan + sum(map(len, study.proposals()))) * study.design.replicates * mean
    for name in study.verification.cases:
        each = of_name[name].seconds if name in of_name else mean
        total = total + study.verification.replicates_in(name) * np.array(each)
    cores = len(os.sched_getaffinity(0))
    memory = max(each.memory_mb for each in costs)
    dearest = max(each.seconds for each in costs)
    between = " to ".join
    return {
        "one simulation": f"{between(map(duration, dearest))} on a core, "
        f"{max(each.steps for each in costs):,.0f} steps, {memory:.0f} MB",
        "all simulations": f"{between(duration(seconds / cores) for seconds in total)} on this machine's "
        f"{cores} cores (fast to slow or busy machine), {memory * cores / MM:.1f} GB; the solver's "
        "compilation, once, the surrogate's training and the figures come on top",
    }


def draw(study, output):
    """Draw the hopper with the extreme inserts of what the configuration knows; output: PNG or PDF."""
    style.save(extremes.draw(sketches(study)), [output], study.figures.dpi)


def sketches(study):
    """Sketches of the designs with the smallest and largest gap, the highest and lowest top."""
    designs = Designs(study)
    reasons = {}
    if (inserts := np.flatnonzero(np.isfinite(designs.gaps))).size:
        gaps, above = designs.gaps[inserts], designs.above[inserts]
        extreme = {"smallest gap": gaps.argmin(), "largest gap": gaps.argmax()}
        extreme |= {"highest top": above.argmax(), "lowest top": above.argmin()}
        for reason, index in extreme.items():
            reasons.setdefault(inserts[index], []).append(reason)
    found = []
    for index, why in (reasons or {0: []}).items():
        name, labels, setup = designs.known[index]
        heading = ": ".join(filter(None, [name, ", ".join(why)]))
        gap, coarse = designs.gaps[index], MM * setup.particles.diameters[-1]
        found.append(
            extremes.Sketch(
                heading, labels, setup.case(labels, 0)["walls"], setup.filling.level_mm, gap, coarse
            )
        )
    return found
