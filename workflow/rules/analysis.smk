rule effects:
    """Main effects of the factors on the objectives, and the analysis of their variance."""
    input:
        dataset=result("dataset.nc"),
    output:
        effects=report(
            result("analysis/effects.csv"), caption="../report/effects_table.rst", category="Tables"
        ),
        anova=report(result("analysis/anova.csv"), caption="../report/anova.rst", category="Tables"),
    log:
        log_of("effects"),
    params:
        settings=stage("effects"),
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    shell:
        "python -m hopperopt effects --params {params.settings:q} --dataset {input.dataset:q} "
        "--output {output.effects:q} {output.anova:q} > {log:q} 2>&1"


rule sensitivity:
    """Sobol' indices of the surrogate's objectives and of the discharge time."""
    input:
        surrogate=result("surrogate/model.nc"),
        dataset=all_data(),
    output:
        sobol=report(result("analysis/sobol.csv"), caption="../report/sensitivity.rst", category="Tables"),
    log:
        log_of("sensitivity"),
    params:
        settings=stage("sensitivity"),
    threads: 1
    resources:
        mem_mb=500 + surrogate_memory(),
        runtime=10,
    shell:
        "python -m hopperopt sensitivity --params {params.settings:q} --surrogate {input.surrogate:q} "
        "--dataset {input.dataset:q} --output {output.sobol:q} > {log:q} 2>&1"
