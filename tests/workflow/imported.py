"""What readings of the workflow and jobs take: imported once, and all digests of the package's code made."""

import importlib

import snakemake.cli  # noqa: F401

from hopperopt import cli, config, cost, provenance  # noqa: F401

provenance.compile_solver()  # before numba is imported
for module in [cli.SIMULATION, *(stage.module for stage in cli.STAGES.values())]:
    provenance.code_digest(f"hopperopt.{module}")
    importlib.import_module(f"hopperopt.{module}")
for figure in cli.FIGURES:
    provenance.code_digest(f"hopperopt.figures.{figure}")
    importlib.import_module(f"hopperopt.figures.{figure}")
