"""What each stage gets of the configuration, and nothing else: a change of the rest reruns nothing."""

from hopperopt import design as plans

# Lists keep the order of factors and cases, which the sorted keys of a job's JSON would not.
SHOWN = ("filter", "train", "validate", "choose", "optimise", "verify", "figures")  # in the report
STAGES = {
    "design": lambda study: {
        "factors": list(study.factors),
        "experiments": [experiment._asdict() for experiment in study.plan],
    },
    "gather": lambda study: {"factors": list(study.factors), "incomplete": study.discharge.incomplete},
    "effects": lambda study: {"factors": list(study.factors)},
    "filter": lambda study: {
        "factors": list(study.factors),
        **study.surrogate.targets,
    },
    "train": lambda study: study.surrogate.networks,
    "validate_fold": lambda study: study.surrogate.networks | {"starts": study.surrogate.validation.starts},
    "validate": lambda study: study.surrogate.networks | {"starts": study.surrogate.validation.starts},
    "choose": lambda study: {"model": study.surrogate.model, **study.surrogate.networks},
    "sensitivity": lambda study: {
        "bounds": study.bounds,
        "seed": study.surrogate.seed,
    },
    "optimise": lambda study: {
        **study.optimise.model_dump(exclude={"explicit"}),
        "explicit": study.optimise.explicit if study.optimise.select == "explicit" else None,
        "bounds": study.bounds,
        "centre": plans.centre(study.levels),
    },
    # Rounds of infill follow Gaussian processes, whatever surrogate the study goes on with: clip and split
    # are nothing to these.
    "infill_filter": lambda study: {
        "factors": list(study.factors),
        "clip_sigma": None,
        "split": "points",
        "validation_experiments": 1,
        "test_experiments": 1,
        "seed": study.surrogate.seed,
    },
    "infill_model": lambda study: {"model": "gaussian", "seed": study.surrogate.seed},
    "infill_front": lambda study: study.stage_params("optimise") | {"select": "knee", "explicit": None},
    "propose": lambda study: {
        "bounds": study.bounds,
        "replicates": study.design.replicates,
        "seed": study.optimise.seed,
        "derived": study.derived_params("propose", 1),
    },
    "verify": lambda study: {
        "cases": [
            [name, case if isinstance(case, str) else "design"]
            for name, case in study.verification.cases.items()
        ],
        "incomplete": study.discharge.incomplete,
        "seed": study.surrogate.seed,
    },
    "figures": lambda study: study.figures.model_dump(),
    "report": lambda study: {
        "cases": study.stage_params("verify")["cases"],
        "factors": list(study.factors),
        "derived": study.derived_params("report", 1),
        # Nothing that the files it is made of do not depend on.
        "settings": {stage: study.stage_params(stage) for stage in SHOWN},
    },
}
