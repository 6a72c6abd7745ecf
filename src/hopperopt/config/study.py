"""The whole study: all sections, the designs and cases that follow from them, the seeds of its runs."""

import hashlib
import json
from functools import cached_property
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field, PrivateAttr

from hopperopt import checks
from hopperopt import design as plans
from hopperopt.config.fields import Name
from hopperopt.config.sections import Design, Factor, Figures, Infill, Optimise, Surrogate, Verification
from hopperopt.config.setup import Setup
from hopperopt.config.stages import STAGES
from hopperopt.document import ConfigError, NotAllowed, mistake


def _results_dir(value):
    if not value.strip() or set(value) & set("{}\\") or not value.isprintable():
        raise NotAllowed("the path of a folder, without braces or backslashes")
    return Path(value).as_posix()


def _paper_factors():
    return {
        "theta_deg": Factor(key="insert.cone.slope_deg", levels=(60, 57.5, 55, 52.5, 50)),
        "length_mm": Factor(key="insert.cone.length_mm", levels=(50, 45, 40, 35, 30)),
        "height_mm": Factor(key="insert.height_mm", levels=(34, 32, 29.6, 28, 26)),
    }


class Study(Setup):
    """The whole study."""

    results_dir: Annotated[str, AfterValidator(_results_dir)] = "results"
    """Folder of everything that the study writes."""
    factors: Annotated[dict[Name, Factor], Field(min_length=1)] = Field(default_factory=_paper_factors)
    """What the designs vary, by name."""
    design: Design = Design()
    infill: Infill = Infill()
    surrogate: Surrogate = Surrogate()
    optimise: Optimise = Optimise()
    verification: Verification = Verification()
    figures: Figures = Figures()
    _own_plan: list = PrivateAttr(default_factory=list)
    _unused_columns: list = PrivateAttr(default_factory=list)

    @property
    def state_dir(self):
        """Where the states of unfinished simulations are kept."""
        return f"{self.results_dir}/.state"

    @property
    def levels(self):
        """The levels of each factor, by name."""
        return {name: factor.levels for name, factor in self.factors.items()}

    @property
    def bounds(self):
        """Smallest and largest level of each factor, by name: lists, as plain JSON has them."""
        return {name: list(plans.bounds(levels)) for name, levels in self.levels.items()}

    def with_design(self, design):
        """The study at one design (factor values by name); raises ConfigError when a value is not allowed."""
        if unknown := [name for name in design if name not in self.factors]:
            raise ConfigError("\n".join(mistake("factor", name, ", ".join(self.factors)) for name in unknown))
        return self.with_values({self.factors[name].key: value for name, value in design.items()})

    def without_insert(self):
        """The study in the bare hopper."""
        return self.with_values({"insert.shape": "none"})

    @cached_property
    def plan(self):
        """The experiments (name, design, level numbers) of the plan."""
        match self.design.plan:
            case "l25":
                return plans.l25(self.levels)
            case "lhs":
                return plans.lhs(self.levels, self.design.lhs.experiments, self.design.lhs.seed)
            case "sobol":
                return plans.sobol(self.levels, self.design.sobol.experiments, self.design.sobol.seed)
            case "csv":
                return self._own_plan

    @property
    def unused_columns(self):
        """Columns of an own plan that are no factor's."""
        return self._unused_columns

    def experiments(self):
        """(name, design) of each experiment of the plan, in its order."""
        return [(experiment.name, experiment.design) for experiment in self.plan]

    def proposals(self):
        """Names of the designs of each round of infill, from the first on: a list for each."""
        infill = self.infill
        return [plans.proposals(number, infill.batch) for number in range(1, infill.rounds + 1)]

    def cases(self):
        """Verification cases by name: a word of DERIVED (to be found), a design, or None (no insert)."""
        meaning = {"plan_centre": plans.centre(self.levels), "bare": None}
        return {
            name: meaning.get(case, case) if isinstance(case, str) else case
            for name, case in self.verification.cases.items()
        }

    def simulation_case(self, design, name, replicate):
        """The case (plain JSON, SI) of one run of a design, None for the bare hopper.

        Its seed follows from the study's seed, the run's name and replicate alone.
        """
        setup = self.without_insert() if design is None else self.with_design(design)
        return setup.case(design or {}, run_seed(self.seed, name, replicate))

    def derived_params(self, name, replicate):
        """What `derived_case` needs, beside the design that is found later, for one run (plain JSON)."""
        centre = self.with_design(plans.centre(self.levels)).document
        setup = json.loads(json.dumps({key: centre[key] for key in Setup.model_fields if key != "seed"}))
        # Without what no case depends on, which would only rerun the simulation.
        used = ("shape",) if self.insert.shape == "none" else ("shape", "height_mm", self.insert.shape)
        setup["insert"] = {key: value for key, value in setup["insert"].items() if key in used}
        setup["discharge"].pop("incomplete")
        for unused in ("threads", "checkpoint_minutes"):
            setup["simulation"].pop(unused)
        if setup["simulation"]["snapshot_interval_s"] is None:  # as in the case
            setup["simulation"].pop("snapshot_interval_s")
        if setup["filling"]["particles"] is not None:
            setup["filling"].pop("bed_solid_fraction")
        keys = {name: factor.key for name, factor in self.factors.items()}
        return {"setup": setup, "keys": keys, "seed": run_seed(self.seed, name, replicate)}

    def warnings(self):
        """One sentence for each thing that is allowed but unusual."""
        return checks.warnings(self)

    def stage_params(self, stage):
        """The settings of one stage as plain JSON values; KeyError for an unknown stage."""
        return STAGES[stage](self)


def run_seed(seed, name, replicate):
    """Seed (48 bits) of one run, from the study's seed, the run's name and its replicate's number."""
    digest = hashlib.sha256(json.dumps([seed, name, replicate]).encode()).digest()
    return int.from_bytes(digest[:6], "big")
