"""The study as the rules see it: names, paths, and what each job depends on beside its files.

A job's parameters are one JSON string with sorted keys: the resolved settings of its stage and a digest of the
stage's code. When neither changes, nothing is computed anew.
"""

import functools
import json
import math
import re
from pathlib import Path

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

from hopperopt import cli, cost, provenance
from hopperopt import config as configuration

try:
    # Snakemake has read these files, and says nothing of keys that are there twice and of numbers like 010.
    configuration.load(workflow.configfiles)
    STUDY = configuration.parse(config, Path.cwd())
except configuration.ConfigError as error:
    raise WorkflowError(f"the configuration cannot be used:\n{error}") from None
if workflow.is_main_process:
    for warning in STUDY.warnings():
        logger.warning(f"Warning: {warning}")

DESIGNS = dict(STUDY.experiments())
EXPERIMENTS = list(DESIGNS)
REPLICATES = range(1, STUDY.design.replicates + 1)
CASES = STUDY.cases()
SIMULATION = cli.SIMULATION if STUDY.simulation.snapshot_interval_s is None else cli.RECORDED
PROPOSALS = STUDY.proposals()  # of each round of infill


def some(names):
    """At most a hundred of the names, to stand for all of a large plan."""
    return names[:: math.ceil(len(names) / 100)]


SAMPLE = some(EXPERIMENTS)
LEFT_OUT = some(EXPERIMENTS + sum(PROPOSALS, []))  # one at a time, in the surrogates' validation


def result(path):
    """Path of an output, below the study's directory."""
    return f"{STUDY.results_dir}/{path}"


def log_of(path):
    """Path of a job's log, below the study's directory."""
    return result(f"logs/{path}.log")


def one_of(names):
    """Regular expression that matches any of the names."""
    return "|".join(re.escape(name) for name in names)


def figures():
    """All figures as PNG and PDF."""
    return expand(result("figures/{name}.{format}"), name=cli.FIGURES, format=["png", "pdf"])


@functools.cache
def code(module):
    """Digest of the code of a stage, a module of the package."""
    return provenance.code_digest(f"hopperopt.{module}")


def as_json(settings, module):
    """Parameters of a job: its settings and the digest of its code as one string."""
    return json.dumps({**settings, "code": code(module)}, sort_keys=True)


# Stages whose settings differ in a round of infill.
INFILL = {"infill_filter": "filter", "infill_model": "choose", "infill_front": "optimise"}


def stage(name):
    """Parameters of a stage."""
    return as_json(STUDY.stage_params(name), cli.STAGES[INFILL.get(name, name)].module)


def fold_params(wildcards):
    """Parameters of the surrogates' validation without one experiment."""
    settings = STUDY.stage_params("validate_fold") | {"experiment": wildcards.experiment}
    return as_json(settings, cli.STAGES["validate_fold"].module)


def validation_folds():
    """Files of the surrogates' validation, one for each experiment; each trains them all anew."""
    return expand(result("surrogate/validation/{experiment}.nc"), experiment=LEFT_OUT)


def compared_surrogates():
    """File of the surrogates' comparison, where that chooses one of them."""
    return [result("surrogate/validation.nc")] if STUDY.surrogate.model == "auto" else []


def report_params():
    """Parameters of the report, with a digest of its page's parts that are no Python modules."""
    folder = provenance.PACKAGE / "report"
    parts = sorted(path.name for path in folder.iterdir() if path.suffix in (".html", ".css", ".js"))
    page = provenance.files_digest(folder, *parts)
    return as_json(STUDY.stage_params("report") | {"page": page}, cli.STAGES["report"].module)


def figure(name):
    """Parameters of a figure."""
    return as_json(STUDY.stage_params("figures"), f"figures.{name}")


@functools.cache
def case_of(design, name, replicate):
    """Case of a run; design: JSON of the factor values, or null without an insert."""
    return STUDY.simulation_case(json.loads(design), name, replicate)


def experiment_case(wildcards):
    """Case of a run of the plan."""
    return case_of(json.dumps(DESIGNS[wildcards.experiment]), wildcards.experiment, int(wildcards.replicate))


def is_derived(case):
    """Whether a verification case has a design that the study finds."""
    return isinstance(CASES[case], str)


def verification_case(wildcards):
    """Case of a run of the verification; all but the design where that is yet to be found."""
    name, replicate = wildcards.case, int(wildcards.replicate)
    if is_derived(name):
        return {**STUDY.derived_params(name, replicate), "found": CASES[name]}
    return case_of(json.dumps(CASES[name]), name, replicate)


def found_design(wildcards):
    """File of the design that a verification run needs; none for the designs that the configuration fixes."""
    places = {
        "selected": "optimum/selected.yaml",
        "best_f": "optimum/front.csv",
        "best_i": "optimum/front.csv",
        "plan_best": "designs.csv",
    }
    return [result(places[CASES[wildcards.case]])] if is_derived(wildcards.case) else []


def experiment_params(wildcards):
    """Parameters of a simulation of the plan."""
    return as_json(experiment_case(wildcards), SIMULATION)


def verification_params(wildcards):
    """Parameters of a simulation of the verification."""
    return as_json(verification_case(wildcards), SIMULATION)


def running(wildcards, threads):
    """Options of how a simulation runs, which rerun nothing: Snakemake compares no parameter made of `threads`."""
    minutes = json.dumps(STUDY.simulation.checkpoint_minutes)
    return ["--threads", str(threads), "--state-dir", STUDY.state_dir, "--checkpoint-minutes", minutes]


def growing(minutes):
    """Run time (minutes) of a job, more at each attempt: one that met its limit goes on from its checkpoint."""
    return lambda wildcards, attempt: attempt * minutes


def surrogate_memory():
    """Memory (MB) of a job that fits or asks surrogates: 0.8 GB at most were measured with 5,000 experiments."""
    return 1000 + len(EXPERIMENTS) // 10


def training_time(starts, ensembles=0):
    """Run time (minutes) of a job that trains networks: 5 ms for each network and experiment, and a margin.

    starts: of each network. All sizes are trained, and five times more in the cross-validation; an ensemble
    has five networks.
    """
    networks = starts * (6 * len(STUDY.surrogate.hidden_nodes) + 5 * ensembles)
    return growing(20 + math.ceil(networks * len(EXPERIMENTS) / (200 * 60)))


def simulation_resources():
    """Memory (MB) and time (minutes) granted to a simulation, a few times what the dearest design takes."""
    interval = STUDY.simulation.snapshot_interval_s
    cases = [case_of(json.dumps(DESIGNS[name]), name, 1) for name in SAMPLE]
    granted = cost.granted([cost.expected(case, interval) for case in cases])
    return granted | {"runtime": growing(granted["runtime"])}


def plan_runs():
    """Files of all runs of the plan."""
    run = result("simulations/{experiment}_rep_{replicate}.nc")
    return expand(run, experiment=EXPERIMENTS, replicate=REPLICATES)


def verification_runs(case):
    """Files of a verification case's runs."""
    replicates = range(1, STUDY.verification.replicates_in(case) + 1)
    return expand(result("verification/{case}_rep_{replicate}.nc"), case=case, replicate=replicates)


def of_round(number, name):
    """A file of a round of infill; round 0 is the plan."""
    return result(f"infill/round_{number}/{name}")


def dataset_after(number):
    """The data set of the plan and the rounds of infill up to a number."""
    return of_round(number, "dataset.nc") if int(number) else result("dataset.nc")


def all_data():
    """The data set of all that is simulated before the verification."""
    return dataset_after(len(PROPOSALS))


def proposals_to(number):
    """Tables of the designs of all rounds up to a number."""
    return [of_round(before, "proposals.csv") for before in range(1, int(number) + 1)]


def infill_runs(number):
    """Files of all runs of the rounds of infill up to a number."""
    runs = [
        expand(of_round(before, "{name}_rep_{replicate}.nc"), name=names, replicate=REPLICATES)
        for before, names in enumerate(PROPOSALS[: int(number)], start=1)
    ]
    return sum(runs, [])


def infill_params(wildcards):
    """Parameters of a simulation of a round; all but the design, which is in the round's table."""
    settings = STUDY.derived_params(wildcards.proposal, int(wildcards.replicate))
    return as_json(settings | {"found": wildcards.proposal}, SIMULATION)


def proposal_params(wildcards):
    """Parameters of the stage that proposes the designs of a round."""
    number = int(wildcards.round)
    settings = STUDY.stage_params("propose") | {"round": number, "names": PROPOSALS[number - 1]}
    return as_json(settings, cli.STAGES["propose"].module)


def shown_case():
    """Verification case that the figures show: the one that the study found, or else the first."""
    return next((case for case in CASES if is_derived(case)), next(iter(CASES)))


def shown_run():
    """Run whose particles the figures show: the plan's centre, or else its first experiment."""
    if "plan_centre" in CASES:
        return verification_runs("plan_centre")[0]
    return result(f"simulations/{EXPERIMENTS[0]}_rep_1.nc")
