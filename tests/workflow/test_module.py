"""The workflow as a module of another one."""

import re

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
    """Each under the other's prefix; of a study that is finished, the other's own rule alone runs."""
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
    answer = study.snakemake()
    assert answer.returncode == 0, answer.stdout
    assert set(re.findall(r"^(?:local)?rule (\w+):$", answer.stdout, re.MULTILINE)) == {"own", "all"}
    glance = (study.directory / "results" / "verification" / "glance.csv").read_text()
    assert (study.directory / "glance.csv").read_text() == glance
