rule verify_simulate:
    """One run of a verification case; only a design that the study finds has a result as its input."""
    input:
        design=found_design,
    output:
        result("verification/{case}_rep_{replicate}.nc"),
    log:
        log_of("verify_simulate/{case}_rep_{replicate}"),
    benchmark:
        result("logs/verify_simulate/{case}_rep_{replicate}.tsv")
    params:
        case=verification_params,
        running=running,
    threads: STUDY.simulation.threads
    resources:
        **simulation_resources(),
    shell:
        "python -m hopperopt simulate --case {params.case:q} --design {input.design:q} "
        "{params.running:q} --output {output:q} > {log:q} 2>&1"


rule verify:
    """What the runs of the verification say of the predictions, and against the bare hopper."""
    input:
        simulations=[verification_runs(case) for case in CASES],
        surrogate=result("surrogate/model.nc"),
        designs=result("designs.csv"),
    output:
        verdict=report(
            result("verification/verdict.csv"), caption="../report/verdict_table.rst", category="Tables"
        ),
        glance=report(result("verification/glance.csv"), caption="../report/glance.rst", category="Tables"),
    log:
        log_of("verify"),
    params:
        settings=stage("verify"),
    threads: 1
    resources:
        mem_mb=surrogate_memory(),
        runtime=5,
    shell:
        "printf '%s\\n' {input.simulations:q} | "
        "python -m hopperopt verify --params {params.settings:q} --simulations - "
        "--surrogate {input.surrogate:q} --designs {input.designs:q} --output {output.verdict:q} {output.glance:q} > {log:q} 2>&1"
