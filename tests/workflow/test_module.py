"""The workflow as a module of another one."""

import pytest

pytestmark = pytest.mark.slow

IMPORTER = """\
configfile: "mine.yaml"


module hopperopt:
    snakefile:
        "{clone}/workflow/Snakefile"
    config:
        config["hopper"]


use rule * from hopperopt as hopperopt_*


rule all:
    input:
        rules.hopperopt_all.input,
        "glance.csv",
    default_target: True


rule own:
    input:
        "results/verification/glance.csv",
    output:
        "glance.csv",
    shell:
        "cp {{input}} {{output}}"
"""


def test_another_workflow_takes_its_rules_and_a_finished_study(study):
    """Each under the other's prefix, none but the other's own to run, and run in its place."""
    text = (study.directory / "config.yaml").read_text()
    (study.directory / "mine.yaml").write_text(
        "hopper:\n" + "".join(f"  {line}\n" for line in text.splitlines())
    )
    (study.directory / "config.yaml").unlink()
    (study.directory / "Snakefile").write_text(IMPORTER.format(clone=study.clone))
    study.clone = study.directory
    everything = {rule for rule, _ in study.jobs("--forceall")}
    assert {"hopperopt_simulate", "hopperopt_verify", "own"} <= everything
    assert all(rule.startswith("hopperopt_") for rule in everything - {"own"})
    assert {rule for rule, _ in study.jobs()} == {"own"}
    answer = study.snakemake()
    assert answer.returncode == 0, answer.stdout
    glance = (study.directory / "results" / "verification" / "glance.csv").read_text()
    assert (study.directory / "glance.csv").read_text() == glance
    study.edit("mine.yaml", "generations: 3", "generations: 4")
    planned = {rule for rule, _ in study.jobs()}
    assert {"hopperopt_optimise", "own"} <= planned and "hopperopt_simulate" not in planned
