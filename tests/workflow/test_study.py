"""The tiny study's own results, and Snakemake's ways of looking at a workflow."""

import json
import re
import subprocess
import sys

import pytest
import xarray as xr

from hopperopt import files

pytestmark = pytest.mark.slow

OUTPUTS = """
    report.html
    design.csv dataset.nc runs.csv designs.csv surrogate/training.nc surrogate/network.nc surrogate/errors.csv
    optimum/front.csv optimum/history.nc optimum/selected.yaml verification/verdict.csv
    verification/glance.csv simulations/exp_01_rep_1.nc verification/selected_rep_1.nc
    verification/plan_centre_rep_1.nc verification/bare_rep_1.nc
    logs/simulate/exp_01_rep_1.log logs/simulate/exp_01_rep_1.tsv
    analysis/effects.csv analysis/anova.csv analysis/sobol.csv
    surrogate/validation/exp_01.nc surrogate/validation.csv surrogate/validation.nc surrogate/model.nc
"""


def test_every_output_is_there(finished):
    results = finished.directory / "results"
    figures = [
        f"figures/{n}.{f}"
        for n in (
            "hopper",
            "curves",
            "indices",
            "effects",
            "fit",
            "verification",
            "verdict",
            "front",
            "errors",
            "sensitivity",
        )
        for f in ("png", "pdf")
    ]
    assert [name for name in [*OUTPUTS.split(), *figures] if not (results / name).stat().st_size] == []
    assert not list(results.rglob(".*")), "temporary files are left"


def test_the_data_set_has_what_the_plan_says(finished):
    data = files.read_netcdf(finished.directory / "results" / "dataset.nc")
    assert data["mass_fraction"].dims == ("experiment", "replicate", "size_class", "M")
    assert data["length_mm"].values.tolist() == [50, 30, 50, 30, 40]
    assert set(data["status"].values.ravel()) == {"complete"}
    assert data["mass_fraction"].notnull().all()


def test_every_file_says_by_what_it_was_made(finished):
    for path in (finished.directory / "results").rglob("*.nc"):
        with xr.open_dataset(path) as data:
            assert {"git", "host", "versions", "created", "hopperopt_version"} <= set(data.attrs), path


def test_libraries_say_nothing_in_the_logs(finished):
    logs = list((finished.directory / "results" / "logs").rglob("*.log"))
    assert len(logs) > 30
    assert [path.name for path in logs if "glyph" in path.read_text().lower()] == []


def test_each_run_has_a_seed_of_its_own_and_its_code_digest(finished):
    runs = sorted((finished.directory / "results").glob("*/*_rep_*.nc"))
    attributes = [files.read_netcdf(path).attrs for path in runs]
    assert len({run["seed"] for run in attributes}) == len(runs) == 10
    assert len({run["code_digest"] for run in attributes}) == 1
    assert all(json.loads(run["case"])["seed"] == run["seed"] for run in attributes)


def test_the_selected_design_is_the_one_that_is_verified(finished):
    results = finished.directory / "results"
    design = files.read_yaml(results / "optimum" / "selected.yaml")["design"]
    run = files.read_netcdf(results / "verification" / "selected_rep_1.nc")
    assert json.loads(run.attrs["case"])["design"] == pytest.approx(design)
    verdict = files.read_table(results / "verification" / "verdict.csv")
    assert list(zip(verdict["case"], verdict["objective"], strict=True)) == [
        (case, objective)
        for case in ("selected", "best_f", "plan_best", "plan_centre", "bare")
        for objective in ("fine", "intermediate")
    ]
    assert verdict.loc[verdict["case"] == "bare", "predicted"].isna().all()


def test_other_found_designs_are_simulated_as_their_tables_have_them(finished):
    results = finished.directory / "results"
    front, designs = (files.read_table(results / name) for name in ("optimum/front.csv", "designs.csv"))
    best = {"best_f": front.loc[front["J_fine"].idxmin()], "plan_best": designs.loc[designs["rank"].idxmin()]}
    for case, row in best.items():
        run = files.read_netcdf(results / "verification" / f"{case}_rep_1.nc")
        design = json.loads(run.attrs["case"])["design"]
        assert design == pytest.approx({name: row[name] for name in ("theta_deg", "length_mm", "height_mm")})


def test_by_hand_and_by_the_workflow_give_the_same_run(finished, tmp_path):
    run = files.read_netcdf(finished.directory / "results" / "simulations" / "exp_02_rep_1.nc")
    design = ["--theta", "50", "--length", "30", "--height", "26", "--seed", str(run.attrs["seed"])]
    command = [sys.executable, "-m", "hopperopt", "simulate", "--configfile", "config.yaml", *design]
    subprocess.run(
        [*command, "--output", tmp_path / "run.nc"],
        cwd=finished.directory, env=finished.environment, check=True, capture_output=True,
    )  # fmt: skip
    by_hand = files.read_netcdf(tmp_path / "run.nc")
    xr.testing.assert_identical(by_hand.drop_attrs(deep=False), run.drop_attrs(deep=False))


def test_lint_asks_for_nothing_but_a_container(finished):
    said = finished.ask("--lint").stdout
    advice = re.findall(r"^    \* (.*)", said, re.MULTILINE)
    assert set(advice) == {"Specify a conda environment or container for each rule.:"}, said


def test_the_graph_has_every_rule(finished):
    graph = finished.ask("--rulegraph").stdout
    rules = set(re.findall(r'label = "(\w+)"', graph))
    assert {
        "design",
        "simulate",
        "gather",
        "effects",
        "filter",
        "train",
        "validate_fold",
        "validate",
        "choose",
        "sensitivity",
        "optimise",
        "verify_simulate",
        "verify",
    } <= rules
    assert len([rule for rule in rules if rule.startswith("figure_")]) == 10


def test_the_report_holds_tables_and_figures(finished, tmp_path):
    answer = finished.ask("--report", tmp_path / "report.html")
    assert answer.returncode == 0, answer.stdout
    text = (tmp_path / "report.html").read_text()
    assert all(
        name in text for name in ("verdict.csv", "glance.csv", "errors.csv", "hopper.png", "front.png")
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("filling: {particels: 60}", "filling.particels"),
        ("factors: {length_mm: {levels: [90, 45, 40, 35, 30]}}", "length_mm"),
        ("seed: 1\nhopper: {}\nseed: 2", "config.yaml, line 3: seed: is there twice"),
    ],
)
def test_a_mistake_is_a_sentence_while_the_workflow_is_read(new_study, tmp_path, text, said):
    answer = new_study(tmp_path, f"{text}\n").ask("--dry-run")
    assert answer.returncode != 0
    assert said in answer.stdout
    assert "Traceback" not in answer.stdout and "http" not in answer.stdout


def test_a_warning_is_said_once_and_stops_nothing(new_study, tmp_path):
    answer = new_study(tmp_path, "results_dir: results\n").ask("--dry-run")
    assert answer.returncode == 0
    assert answer.stdout.count("2.89 coarse diameters") == 1
