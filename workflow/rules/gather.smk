rule gather:
    """One data set of all runs of the plan, and its designs by rank."""
    input:
        design=result("design.csv"),
        simulations=plan_runs(),
    output:
        dataset=result("dataset.nc"),
        runs=report(result("runs.csv"), caption="../report/runs.rst", category="Tables"),
        designs=report(result("designs.csv"), caption="../report/designs.rst", category="Tables"),
    log:
        log_of("gather"),
    params:
        settings=stage("gather"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    shell:
        "printf '%s\\n' {input.simulations:q} | "
        "python -m hopperopt gather --params {params.settings:q} --design {input.design:q} --simulations - "
        "--output {output.dataset:q} {output.runs:q} {output.designs:q} > {log:q} 2>&1"
