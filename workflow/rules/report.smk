rule report:
    """The study on one page that opens anywhere."""
    input:
        dataset=result("dataset.nc"),
        effects=result("analysis/effects.csv"),
        validation=result("surrogate/validation.csv"),
        comparison=result("surrogate/validation.nc"),
        surrogate=result("surrogate/model.nc"),
        front=result("optimum/front.csv"),
        selected=result("optimum/selected.yaml"),
        verdict=result("verification/verdict.csv"),
        proposals=proposals_to(len(PROPOSALS)),
        designs=[of_round(len(PROPOSALS), "designs.csv")] if PROPOSALS else [],
        simulations=[*plan_runs(), *infill_runs(len(PROPOSALS))],
        verification=[verification_runs(case) for case in CASES],
        figures=[result(f"figures/{name}.png") for name in cli.REPORTED],
    output:
        result("report.html"),
    log:
        log_of("report"),
    params:
        settings=report_params(),
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    shell:
        "printf '%s\n' {input.simulations:q} | "
        "python -m hopperopt report --params {params.settings:q} --dataset {input.dataset:q} "
        "--effects {input.effects:q} --validation {input.validation:q} --comparison {input.comparison:q} "
        "--surrogate {input.surrogate:q} "
        "--front {input.front:q} --selected {input.selected:q} --verdict {input.verdict:q} "
        "--proposals {input.proposals:q} --designs {input.designs:q} "
        "--simulations - --verification {input.verification:q} "
        "--figures {input.figures:q} --output {output:q} > {log:q} 2>&1"
