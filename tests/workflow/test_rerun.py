"""What runs again after a change: everything that depends on it, and nothing else."""

import shutil

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
    study = edited("figures/errors.py", "import numpy as np\n", "import numpy as np\n\nEXTRA = 1\n")
    assert study.planned() == {"figure_errors"}


def test_style_of_all_figures_reruns_all_figures(edited):
    assert edited("figures/style.py", "COLUMN, PAGE = ", "EXTRA = 1\nCOLUMN, PAGE = ").planned() == FIGURES


def test_code_of_the_solver_reruns_all_simulations(edited):
    study = edited("dem/laws.py", "\nimport ", "\nEXTRA = 1\nimport ")
    assert study.planned() == AFTER_PLAN | PLAN_RUNS | FIXED_RUNS | {"figure_hopper"}


def test_docstring_and_comment_in_the_solver_rerun_nothing(edited):
    study = edited("dem/laws.py", "\nimport ", "\n# A comment.\nimport ")
    for module in ("dem/laws.py", "experiment.py"):
        path = study.package / "hopperopt" / module
        path.write_text(path.read_text().replace('"""', '"""Another word: ', 1))
    assert study.planned() == set()


def test_code_of_the_surrogate_reruns_no_run_of_the_plan(edited):
    study = edited("surrogate/training.py", "\nFOLDS = ", "\nEXTRA = 1\nFOLDS = ")
    assert study.planned() == AFTER_TRAINING | {"train", "figure_errors"}


def test_one_more_replicate_runs_only_the_new_fillings(study):
    study.edit("config.yaml", "design: {plan: csv}", "design: {plan: csv, replicates: 2}")
    new = {f"simulate exp_0{number}_rep_2" for number in range(1, 6)}
    assert study.planned() == AFTER_PLAN | new


def test_more_replicates_of_the_verification_run_only_the_new_fillings(study):
    study.edit("config.yaml", "figures:", "verification: {replicates: 2}\nfigures:")
    new = {f"verify_simulate {case}_rep_2" for case in ("selected", "plan_centre", "bare")}
    assert study.planned() == new | {"verify", "figure_verification", "figure_front"}


def test_one_more_case_runs_only_that_case(study):
    case = "verification: {cases: {paper: {theta_deg: 56.7, length_mm: 32.4, height_mm: 33.0}}}\n"
    study.edit("config.yaml", "figures:", f"{case}figures:")
    assert study.planned() == {"verify_simulate paper_rep_1", "verify", "figure_front"}


def test_material_reruns_all_simulations_by_an_override(study):
    (study.directory / "my.yaml").write_text("wall: {poisson_ratio: 0.3}\n")
    planned = study.planned("--configfile", "my.yaml")
    assert planned == AFTER_PLAN | PLAN_RUNS | FIXED_RUNS | {"figure_hopper"}


def test_incomplete_runs_dropped_or_refused_is_no_matter_of_the_simulations(study):
    study.edit("config.yaml", "figures:", "discharge: {incomplete: drop}\nfigures:")
    assert study.planned() == AFTER_PLAN


def test_another_directory_is_another_study(study):
    planned = study.planned("--config", "results_dir=elsewhere")
    assert planned == AFTER_PLAN | PLAN_RUNS | FIXED_RUNS | FIGURES | {"design"}


def test_one_level_of_the_orthogonal_array_reruns_its_experiments(finished, new_study, tmp_path):
    """Each level of the L25 stands in five experiments. The runs are empty files, accepted by `--touch`."""
    plain = (finished.directory / "config.yaml").read_text().replace("plan: csv", "plan: l25")
    study = new_study(tmp_path, plain)
    listed = study.snakemake("--dry-run", "--quiet", "rules", "--summary").stdout
    for line in listed.splitlines():
        if line.startswith("results/"):
            path = tmp_path / line.split("\t")[0]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
    assert study.snakemake("--touch").returncode == 0
    assert study.planned() == set()
    levels = "factors: {length_mm: {key: insert.cone.length_mm, levels: [50, 45, 40, 35, 32]}}\n"
    (tmp_path / "config.yaml").write_text(plain + levels)
    simulated = {job for job in study.planned() if "simulate" in job}
    assert len(simulated) == 6
    assert simulated >= {"verify_simulate selected_rep_1"}


def test_forced_training_reruns_what_follows(study):
    assert study.planned("--forcerun", "train") == AFTER_TRAINING | {"train", "figure_errors"}


def test_the_plans_table_is_no_input_of_the_simulations(study):
    assert not {job for job in study.planned("--forcerun", "design") if job in PLAN_RUNS | FIXED_RUNS}


def test_a_file_as_the_target_runs_what_it_needs(study):
    shutil.rmtree(study.directory / "results")
    planned = study.planned("results/optimum/selected.yaml")
    assert planned == PLAN_RUNS | {"design", "gather", "filter", "train", "optimise"}
