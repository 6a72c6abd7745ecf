"""What runs again after a change: everything that depends on it, and nothing else."""

import shutil

import pytest

from hopperopt import config

pytestmark = pytest.mark.slow

FIGURES = {f"figure_{name}" for name in ("hopper", "curves", "fit", "verification", "front", "errors")}
PLAN_RUNS = {f"simulate exp_0{number}_rep_1" for number in range(1, 6)}
FIXED_RUNS = {"verify_simulate plan_centre_rep_1", "verify_simulate bare_rep_1"}
DERIVED = {"optimise", "verify_simulate selected_rep_1", "verify"}
AFTER_TRAINING = DERIVED | {"figure_fit", "figure_verification", "figure_front"}
AFTER_PLAN = AFTER_TRAINING | {"gather", "filter", "train", "figure_curves", "figure_errors"}


def test_nothing_runs_again_unchanged(study):
    assert study.planned() == set()


def test_selected_hidden_size_reruns_training_and_what_is_derived_from_it(study):
    study.edit("config.yaml", "selected_hidden_nodes: 2", "selected_hidden_nodes: 3")
    assert study.planned() == AFTER_TRAINING | {"train", "figure_errors"}


def test_changed_design_reruns_its_experiment(study):
    study.edit("plan.csv", "exp_05,55,40,29.6", "exp_05,55,40,30")
    assert study.planned() == AFTER_PLAN | {"design", "simulate exp_05_rep_1"}


def test_resolution_of_the_figures_reruns_the_figures(study):
    study.edit("config.yaml", "dpi: 50", "dpi: 60")
    assert study.planned() == FIGURES


def test_code_of_one_figure_reruns_that_figure(edited):
    assert edited({"figures/errors.py": "\nEXTRA = 1\n"}).planned() == {"figure_errors"}


def test_code_of_the_solver_reruns_all_simulations(edited):
    planned = edited({"dem/laws.py": "\nEXTRA = 1\n"}).planned()
    assert planned == AFTER_PLAN | PLAN_RUNS | FIXED_RUNS | {"figure_hopper"}


def test_docstring_and_comment_in_the_solver_rerun_nothing(edited):
    comment, docstring = "\n# A comment.\n", '\n"""More words."""\n'
    study = edited({"dem/laws.py": comment, "dem/contacts.py": docstring, "experiment.py": docstring})
    assert study.planned() == set()


def test_one_more_replicate_runs_only_the_new_fillings(study):
    study.edit("config.yaml", "design: {plan: csv}", "design: {plan: csv, replicates: 2}")
    new = {f"simulate exp_0{number}_rep_2" for number in range(1, 6)}
    assert study.planned() == AFTER_PLAN | new


def test_more_replicates_of_the_verification_run_only_the_new_fillings(study):
    study.edit("config.yaml", "verification:\n", "verification:\n  replicates: 2\n")
    new = {f"verify_simulate {case}_rep_2" for case in ("selected", "plan_centre", "bare")}
    assert study.planned() == new | {"verify", "figure_verification", "figure_front"}


def test_one_more_case_runs_only_that_case(study):
    case = "bare: bare, paper: {theta_deg: 56.7, length_mm: 32.4, height_mm: 33.0}"
    study.edit("config.yaml", "bare: bare", case)
    assert study.planned() == {"verify_simulate paper_rep_1", "verify", "figure_front"}


def test_material_reruns_all_simulations_by_an_override(study):
    (study.directory / "my.yaml").write_text("wall: {poisson_ratio: 0.3}\n")
    planned = study.planned("--configfile", "my.yaml")
    assert planned == AFTER_PLAN | PLAN_RUNS | FIXED_RUNS | {"figure_hopper"}


def test_another_directory_is_another_study(study):
    planned = study.planned("--config", "results_dir=elsewhere")
    assert planned == AFTER_PLAN | PLAN_RUNS | FIXED_RUNS | FIGURES | {"design"}


FACTORS = """
factors:
  theta_deg: {key: insert.cone.slope_deg, levels: [60, 57.5, 55, 52.5, 50]}
  length_mm: {key: insert.cone.length_mm, levels: [50, 45, 40, 35, 30]}
  height_mm: {key: insert.height_mm, levels: [34, 32, 29.6, 28, 26]}
"""
NO_SOLVER = {"cli.py": "\ndef _simulate(given):\n    given.output.touch()\n"}


def test_one_level_of_the_orthogonal_array_reruns_its_experiments(new_study, tmp_path):
    """Each level of the L25 stands in five experiments; which ones is no matter of what they compute."""
    study = new_study(tmp_path, FACTORS, NO_SOLVER)
    plan = config.parse(config.load([tmp_path / "config.yaml"])).experiments()
    with_level = [name for name, design in plan if design["length_mm"] == 30]
    without = [name for name, design in plan if design["length_mm"] == 35]
    assert len(with_level) == 5
    targets = [f"results/simulations/{experiment}_rep_1.nc" for experiment in [*with_level, without[0]]]
    assert study.snakemake(*targets).returncode == 0
    study.edit("config.yaml", "35, 30]", "35, 31]")
    assert study.planned(*targets) == {f"simulate {experiment}_rep_1" for experiment in with_level}


def test_forced_training_reruns_what_follows(study):
    assert study.planned("--forcerun", "train") == AFTER_TRAINING | {"train", "figure_errors"}


def test_the_plans_table_is_no_input_of_the_simulations(study):
    assert not {job for job in study.planned("--forcerun", "design") if job in PLAN_RUNS | FIXED_RUNS}


def test_a_file_as_the_target_runs_what_it_needs(study):
    shutil.rmtree(study.directory / "results")
    planned = study.planned("results/optimum/selected.yaml")
    assert planned == PLAN_RUNS | {"design", "gather", "filter", "train", "optimise"}
