rule optimise:
    """Pareto front of the surrogate, and the design selected from it."""
    input:
        surrogate=result("surrogate/model.nc"),
    output:
        front=report(result("optimum/front.csv"), caption="../report/front_table.rst", category="Tables"),
        history=result("optimum/history.nc"),
        selected=result("optimum/selected.yaml"),
    log:
        log_of("optimise"),
    params:
        settings=stage("optimise"),
    threads: 1
    resources:
        mem_mb=surrogate_memory(),
        runtime=15,
    shell:
        "python -m hopperopt optimise --params {params.settings:q} --surrogate {input.surrogate:q} "
        "--output {output.front:q} {output.history:q} {output.selected:q} > {log:q} 2>&1"
