rule infill_filter:
    """Targets of a round's surrogate; round 0 is the plan."""
    input:
        dataset=lambda wildcards: dataset_after(wildcards.round),
    output:
        training=result("infill/round_{round}/training.nc"),
    log:
        log_of("infill/round_{round}/filter"),
    params:
        settings=stage("infill_filter"),
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    shell:
        "python -m hopperopt filter --params {params.settings:q} --dataset {input.dataset:q} "
        "--output {output.training:q} > {log:q} 2>&1"


rule infill_model:
    """Gaussian processes of all that is simulated, from which the next round's designs are proposed."""
    input:
        training=result("infill/round_{round}/training.nc"),
    output:
        model=result("infill/round_{round}/model.nc"),
    log:
        log_of("infill/round_{round}/model"),
    params:
        settings=stage("infill_model"),
    threads: 1
    resources:
        mem_mb=surrogate_memory(),
        runtime=10,
    shell:
        "python -m hopperopt choose --params {params.settings:q} --training {input.training:q} "
        "--network --validation --output {output.model:q} > {log:q} 2>&1"


rule infill_front:
    """Their Pareto front, and the design selected from it."""
    input:
        surrogate=result("infill/round_{round}/model.nc"),
    output:
        front=result("infill/round_{round}/front.csv"),
        history=result("infill/round_{round}/history.nc"),
        selected=result("infill/round_{round}/selected.yaml"),
    log:
        log_of("infill/round_{round}/front"),
    params:
        settings=stage("infill_front"),
    threads: 1
    resources:
        mem_mb=surrogate_memory(),
        runtime=15,
    shell:
        "python -m hopperopt optimise --params {params.settings:q} --surrogate {input.surrogate:q} "
        "--output {output.front:q} {output.history:q} {output.selected:q} > {log:q} 2>&1"


rule propose:
    """The designs of a round, from what the rounds before it have shown."""
    input:
        surrogate=lambda wildcards: of_round(int(wildcards.round) - 1, "model.nc"),
        plan=of_round(0, "model.nc"),
        front=lambda wildcards: of_round(int(wildcards.round) - 1, "front.csv"),
        proposals=lambda wildcards: proposals_to(int(wildcards.round) - 1),
    output:
        report(
            result("infill/round_{round}/proposals.csv"),
            caption="../report/proposals.rst",
            category="Tables",
        ),
    log:
        log_of("infill/round_{round}/propose"),
    params:
        settings=proposal_params,
    threads: 1
    resources:
        mem_mb=500 + surrogate_memory(),
        runtime=10,
    shell:
        "python -m hopperopt propose --params {params.settings:q} --surrogate {input.surrogate:q} "
        "--plan {input.plan:q} --front {input.front:q} --proposals {input.proposals:q} --output {output:q} "
        "> {log:q} 2>&1"


rule infill_simulate:
    """One run of a design of a round."""
    input:
        design=result("infill/round_{round}/proposals.csv"),
    output:
        result("infill/round_{round}/{proposal}_rep_{replicate}.nc"),
    log:
        log_of("infill/round_{round}/{proposal}_rep_{replicate}"),
    benchmark:
        result("logs/infill/round_{round}/{proposal}_rep_{replicate}.tsv")
    params:
        case=infill_params,
        running=running,
    threads: STUDY.simulation.threads
    resources:
        **simulation_resources(),
    shell:
        "python -m hopperopt simulate --case {params.case:q} --design {input.design:q} "
        "{params.running:q} --output {output:q} > {log:q} 2>&1"


rule infill_gather:
    """One data set of the plan and all rounds so far."""
    input:
        design=lambda wildcards: [result("design.csv"), *proposals_to(wildcards.round)],
        simulations=lambda wildcards: [*plan_runs(), *infill_runs(wildcards.round)],
    output:
        dataset=result("infill/round_{round}/dataset.nc"),
        runs=result("infill/round_{round}/runs.csv"),
        designs=report(
            result("infill/round_{round}/designs.csv"),
            caption="../report/infill_designs.rst",
            category="Tables",
        ),
    log:
        log_of("infill/round_{round}/gather"),
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
