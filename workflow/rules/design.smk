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
        "printf %s {params.settings:q} | "
        "python -m hopperopt design --params - --output {output:q} > {log:q} 2>&1"
