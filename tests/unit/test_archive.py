"""A study in one zip file: what it holds, that it can be checked, and that it is the same each time."""

import shutil
import subprocess
import zipfile

import pytest

from hopperopt import cli

HELD = [
    "dataset.nc", "runs.csv", "surrogate/model.nc", "surrogate/validation/exp_01.nc", "figures/front.png",
    "verification/verdict.csv",
]  # fmt: skip
LEFT_OUT = [
    ".state/a.npz", "logs/gather.log", "simulations/exp_01_rep_1.nc", "verification/bare_rep_1.nc",
    ".0123abcd.runs.csv", "ci/dataset.nc", "ci/logs/gather.log",
]  # fmt: skip


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A folder with a study, whose configuration names a table."""
    (tmp_path / "config.yaml").write_text("design: {csv: {file: plan.csv}}\n")
    (tmp_path / "plan.csv").write_text("experiment,theta_deg,length_mm,height_mm\nexp_01,60,50,34\n")
    (tmp_path / "other.yaml").write_text("filling: {particles: 60}\n")
    for name in HELD + LEFT_OUT:
        path = tmp_path / "results" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def archive():
    assert cli.main(["archive", "--configfile", "other.yaml"]) == 0
    return zipfile.ZipFile("results.zip")


def test_it_holds_what_a_reader_needs(study, capsys, caplog):
    with archive() as file:
        names = file.namelist()
        assert file.read("results/surrogate/model.nc") == b"surrogate/model.nc"
    results = [f"results/{name}" for name in HELD]
    others = ["config.yaml", "other.yaml", "plan.csv", "requirements.lock", "MANIFEST.txt"]
    assert sorted(names) == sorted(results + others)
    assert capsys.readouterr().out.startswith(f"results.zip: {len(names)} files, ")
    assert "not in it, as they are not there: design.csv, designs.csv, optimum/front.csv" in caplog.text
    assert "figures/front.pdf" in caplog.text and "figures/front.png" not in caplog.text
    assert "report.html" in caplog.text


def test_its_sums_can_be_checked(study):
    archive().extractall("out")
    command = ["sha256sum", "--check", "--strict", "MANIFEST.txt"]
    if shutil.which(command[0]) is None:
        pytest.skip("sha256sum is not there")
    assert subprocess.run(command, cwd="out", capture_output=True).returncode == 0
    (study / "out" / "plan.csv").write_text("")
    assert subprocess.run(command, cwd="out", capture_output=True).returncode == 1
    first = (study / "out" / "MANIFEST.txt").read_text().splitlines()[0]
    assert first.startswith("# hopperopt ") and ", git " in first


def test_the_same_content_gives_the_same_bytes(study):
    archive().close()
    one = (study / "results.zip").read_bytes()
    for path in study.rglob("*.nc"):
        path.touch()
    with archive() as again:
        assert {entry.date_time for entry in again.infolist()} == {(1980, 1, 1, 0, 0, 0)}, (
            "not of this moment"
        )
    assert (study / "results.zip").read_bytes() == one


def test_without_results_it_says_so(study, capsys):
    shutil.rmtree("results")
    assert cli.main(["archive"]) == 2
    assert "results: is not there; run the study first" in capsys.readouterr().err
