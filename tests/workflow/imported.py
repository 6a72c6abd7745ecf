"""What every reading of the workflow takes: imported once, and all digests of the package's code made."""

import snakemake.cli  # noqa: F401

from hopperopt import cli, config, cost, provenance  # noqa: F401

for module in [cli.SIMULATION, *(stage.module for stage in cli.STAGES.values())]:
    provenance.code_digest(f"hopperopt.{module}")
for figure in cli.FIGURES:
    provenance.code_digest(f"hopperopt.figures.{figure}")
