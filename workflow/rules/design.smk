rule design:
    """The plan's table; for people and for `gather`, the simulations do not wait for it."""
    output:
        report(result("design.csv"), caption="../report/design.rst", category="Tables"),
    log:
        log_of("design"),
    params:
        settings=stage("design"),
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    shell:
        "python -m hopperopt design --params {params.settings:q} --output {output:q} > {log:q} 2>&1"
