"""The shipped examples as whole studies of a tiny size."""

import shutil

import pytest

from hopperopt import cli, config, files
from hopperopt.provenance import PACKAGE

pytestmark = [pytest.mark.slow, pytest.mark.full]

ROOT = PACKAGE.parents[1]
EXAMPLES = sorted((ROOT / "config/examples").glob("*.yaml"))
TINY = """\
filling: {particles: 60}
design: {plan: lhs, replicates: 1, lhs: {experiments: 12}}
surrogate:
  hidden_nodes: [2, 3]
  selected_hidden_nodes: 2
  starts: 2
  validation: {starts: 1}
  validation_experiments: 1
  test_experiments: 1
optimise: {population: 8, generations: 3}
verification:
  replicates: 1
  replicates_of: {selected: null, plan_best: null}
figures: {dpi: 50}
"""


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_a_study_by_its_file_alone(new_study, tmp_path, example):
    study = new_study(tmp_path, (ROOT / "config.yaml").read_text(encoding="utf-8"))
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "tiny.yaml").write_text(TINY)
    answer = study.snakemake("--configfile", f"config/examples/{example.name}", "tiny.yaml")
    assert answer.returncode == 0, answer.stdout
    results = tmp_path / "results" / example.stem
    factors = list(config.parse(config.load([ROOT / "config.yaml", example]), ROOT).factors)
    assert list(files.read_yaml(results / "optimum" / "selected.yaml")["design"]) == factors
    assert set(factors) < set(files.read_table(results / "optimum" / "front.csv"))
    cases = set(files.read_table(results / "verification" / "verdict.csv")["case"])
    assert {"selected", "plan_centre", "bare"} <= cases and "paper" not in cases
    assert all((results / "figures" / f"{name}.png").stat().st_size for name in cli.FIGURES)
