rule figure_hopper:
    """Hopper with particles before and during the discharge, front and side view."""
    input:
        run=shown_run(),
    output:
        png=report(result("figures/hopper.png"), caption="../report/hopper.rst", category="Figures"),
        pdf=result("figures/hopper.pdf"),
    log:
        log_of("figures/hopper"),
    params:
        settings=figure("hopper"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure hopper --params {params.settings:q} --run {input.run:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_curves:
    """Simulated mass fractions in the outflow against M, all experiments."""
    input:
        dataset=result("dataset.nc"),
    output:
        png=report(result("figures/curves.png"), caption="../report/curves.rst", category="Figures"),
        pdf=result("figures/curves.pdf"),
    log:
        log_of("figures/curves"),
    params:
        settings=figure("curves"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure curves --params {params.settings:q} --dataset {input.dataset:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_indices:
    """Indices of segregation and of the flow, all designs by their rank."""
    input:
        dataset=result("dataset.nc"),
    output:
        png=report(result("figures/indices.png"), caption="../report/indices.rst", category="Figures"),
        pdf=result("figures/indices.pdf"),
    log:
        log_of("figures/indices"),
    params:
        settings=figure("indices"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure indices --params {params.settings:q} --dataset {input.dataset:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_effects:
    """Main effects of the factors on the objectives."""
    input:
        effects=result("analysis/effects.csv"),
    output:
        png=report(result("figures/effects.png"), caption="../report/effects.rst", category="Figures"),
        pdf=result("figures/effects.pdf"),
    log:
        log_of("figures/effects"),
    params:
        settings=figure("effects"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure effects --params {params.settings:q} --effects {input.effects:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_fit:
    """Targets and network, all experiments."""
    input:
        training=result("surrogate/training.nc"),
        network=result("surrogate/network.nc"),
    output:
        png=report(result("figures/fit.png"), caption="../report/fit.rst", category="Figures"),
        pdf=result("figures/fit.pdf"),
    log:
        log_of("figures/fit"),
    params:
        settings=figure("fit"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure fit --params {params.settings:q} --training {input.training:q} --network {input.network:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_verification:
    """Predicted and simulated outflow at the optimum."""
    input:
        simulations=verification_runs(shown_case()),
        surrogate=result("surrogate/model.nc"),
    output:
        png=report(
            result("figures/verification.png"), caption="../report/verification.rst", category="Figures"
        ),
        pdf=result("figures/verification.pdf"),
    log:
        log_of("figures/verification"),
    params:
        settings=figure("verification"),
    threads: 1
    resources:
        mem_mb=surrogate_memory(),
        runtime=5,
    shell:
        "python -m hopperopt figure verification --params {params.settings:q} --simulations {input.simulations:q} --surrogate {input.surrogate:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_verdict:
    """Objectives of the cases simulated anew, predicted and simulated, and the verdicts."""
    input:
        verdict=result("verification/verdict.csv"),
        designs=result("designs.csv"),
    output:
        png=report(result("figures/verdict.png"), caption="../report/verdict.rst", category="Figures"),
        pdf=result("figures/verdict.pdf"),
    log:
        log_of("figures/verdict"),
    params:
        settings=figure("verdict"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure verdict --params {params.settings:q} --verdict {input.verdict:q} "
        "--designs {input.designs:q} --output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_front:
    """Pareto front with the selected point, among what was simulated."""
    input:
        front=result("optimum/front.csv"),
        dataset=all_data(),
        verdict=result("verification/verdict.csv"),
    output:
        png=report(result("figures/front.png"), caption="../report/front.rst", category="Figures"),
        pdf=result("figures/front.pdf"),
    log:
        log_of("figures/front"),
    params:
        settings=figure("front"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure front --params {params.settings:q} --front {input.front:q} "
        "--dataset {input.dataset:q} --verdict {input.verdict:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_sensitivity:
    """Sobol' indices of the surrogate."""
    input:
        sobol=result("analysis/sobol.csv"),
    output:
        png=report(result("figures/sensitivity.png"), caption="../report/sensitivity.rst", category="Figures"),
        pdf=result("figures/sensitivity.pdf"),
    log:
        log_of("figures/sensitivity"),
    params:
        settings=figure("sensitivity"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure sensitivity --params {params.settings:q} --sobol {input.sobol:q} "
        "--output {output.png:q} {output.pdf:q} > {log:q} 2>&1"


rule figure_errors:
    """The surrogates compared at experiments that they have not seen."""
    input:
        validation=result("surrogate/validation.csv"),
        surrogate=result("surrogate/model.nc"),
    output:
        png=report(result("figures/errors.png"), caption="../report/errors.rst", category="Figures"),
        pdf=result("figures/errors.pdf"),
    log:
        log_of("figures/errors"),
    params:
        settings=figure("errors"),
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    shell:
        "python -m hopperopt figure errors --params {params.settings:q} --validation {input.validation:q} "
        "--surrogate {input.surrogate:q} --output {output.png:q} {output.pdf:q} > {log:q} 2>&1"
