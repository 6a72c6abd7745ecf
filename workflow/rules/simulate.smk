rule simulate:
    """One run of an experiment of the plan."""
    output:
        result("simulations/{experiment}_rep_{replicate}.nc"),
    log:
        log_of("simulate/{experiment}_rep_{replicate}"),
    benchmark:
        result("logs/simulate/{experiment}_rep_{replicate}.tsv")
    params:
        case=experiment_params,
        running=running,
    threads: STUDY.simulation.threads
    resources:
        **simulation_resources(),
    shell:
        "python -m hopperopt simulate --case {params.case:q} {params.running:q} "
        "--output {output:q} > {log:q} 2>&1"
