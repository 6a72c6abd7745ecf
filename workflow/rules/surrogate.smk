rule filter:
    """Targets of the surrogate: split, and clipped where they train."""
    input:
        dataset=all_data(),
    output:
        training=result("surrogate/training.nc"),
    log:
        log_of("filter"),
    params:
        settings=stage("filter"),
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    shell:
        "python -m hopperopt filter --params {params.settings:q} --dataset {input.dataset:q} "
        "--output {output.training:q} > {log:q} 2>&1"


rule train:
    """Networks of all hidden sizes, the selected one and the errors of each."""
    input:
        training=result("surrogate/training.nc"),
    output:
        network=result("surrogate/network.nc"),
        errors=report(result("surrogate/errors.csv"), caption="../report/errors_table.rst", category="Tables"),
    log:
        log_of("train"),
    params:
        settings=stage("train"),
    threads: 1
    resources:
        mem_mb=1500,
        runtime=training_time(STUDY.surrogate.starts),
    shell:
        "python -m hopperopt train --params {params.settings:q} --training {input.training:q} "
        "--output {output.network:q} {output.errors:q} > {log:q} 2>&1"


rule validate_fold:
    """One experiment predicted by every surrogate from all others."""
    input:
        training=result("surrogate/training.nc"),
    output:
        fold=result("surrogate/validation/{experiment}.nc"),
    wildcard_constraints:
        experiment=one_of(LEFT_OUT),
    log:
        log_of("validate_fold/{experiment}"),
    params:
        settings=fold_params,
    threads: 1
    resources:
        mem_mb=surrogate_memory(),
        runtime=training_time(STUDY.surrogate.validation.starts, ensembles=2),
    shell:
        "python -m hopperopt validate_fold --params {params.settings:q} --training {input.training:q} "
        "--output {output.fold:q} > {log:q} 2>&1"


rule validate:
    """All surrogates compared at experiments that they have not seen."""
    input:
        training=result("surrogate/training.nc"),
        folds=validation_folds(),
    output:
        table=report(
            result("surrogate/validation.csv"), caption="../report/validation.rst", category="Tables"
        ),
        predictions=result("surrogate/validation.nc"),
    log:
        log_of("validate"),
    params:
        settings=stage("validate"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    shell:
        "printf '%s\\n' {input.folds:q} | "
        "python -m hopperopt validate --params {params.settings:q} --training {input.training:q} --folds - "
        "--output {output.table:q} {output.predictions:q} > {log:q} 2>&1"


rule choose:
    """The surrogate that the study goes on with."""
    input:
        training=result("surrogate/training.nc"),
        network=result("surrogate/network.nc"),
        validation=compared_surrogates(),
    output:
        model=result("surrogate/model.nc"),
    log:
        log_of("choose"),
    params:
        settings=stage("choose"),
    threads: 1
    resources:
        mem_mb=surrogate_memory(),
        runtime=10,
    shell:
        "python -m hopperopt choose --params {params.settings:q} --training {input.training:q} "
        "--network {input.network:q} --validation {input.validation:q} --output {output.model:q} > {log:q} 2>&1"
