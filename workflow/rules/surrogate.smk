rule filter:
    """Targets of the surrogate: split, and clipped where they train."""
    input:
        dataset=result("dataset.nc"),
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
        errors=report(
            result("surrogate/errors.csv"), caption="../report/errors_table.rst", category="Tables"
        ),
    log:
        log_of("train"),
    params:
        settings=stage("train"),
    threads: 1
    resources:
        mem_mb=1500,
        runtime=30,
    shell:
        "python -m hopperopt train --params {params.settings:q} --training {input.training:q} "
        "--output {output.network:q} {output.errors:q} > {log:q} 2>&1"
