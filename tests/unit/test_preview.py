"""`check`: what a study will be, in a table and a drawing, before anything runs."""

import re
from pathlib import Path

import pytest
from matplotlib.image import imread

from hopperopt import cli, config, cost, preview

ROOT = Path(__file__).parents[2]


def rows(changes=(), files=()):
    """The table of the shipped study with some changes, {key: value}; warnings under their own key."""
    document = config.load([ROOT / "config.yaml", *(ROOT / file for file in files)], dict(changes))
    lines = preview.table(config.parse(document, ROOT), "/somewhere")
    assert max(map(len, lines)) <= preview.WIDTH
    found = re.findall(r"^(\S.*?)(?:  +|: )((?:.|\n +)*)$", "\n".join(lines), re.MULTILINE)
    return {key: re.sub(r"\s+", " ", value) for key, value in found}


def test_table_of_the_shipped_study():
    table = rows()
    assert table["study"] == "/somewhere/results"
    assert table["plan"] == "l25, 25 designs of theta_deg, length_mm, height_mm, 3 fillings of each"
    assert table["simulations"].startswith("165: 75 of the plan, 90 of the verification (selected 20, ")
    assert re.fullmatch(r"14,094 \(exp_21: .*\) to 15,411 \(bare\)", table["particles"])
    worst = "exp_21: theta_deg 50, length_mm 50, height_mm 26"
    assert table["smallest gap"].startswith(f"2.89 coarse diameters ({worst}); at least 2, ")
    assert table["highest insert"].startswith("3.3 mm above the bed's surface (exp_01: ")
    assert table["time step"].startswith("4e-05 s, 0.77 Rayleigh times of the smallest particles: above ")
    assert "tested for materials like these" in table["time step"]
    assert "2.89 coarse diameters" in table["warning"]
    assert "smallest opening" not in table


def test_table_follows_the_configuration():
    table = rows(files=["config/examples/cone_in_cone.yaml"])
    assert table["smallest opening"].startswith("5.00 coarse diameters (")
    assert "opening_radius_mm 10); at least 2, usual 5 or more" in table["smallest opening"]
    assert rows({"simulation": {"time_step_s": "auto"}})["time step"].endswith(
        "s, 0.20 Rayleigh times of the smallest particles"
    )
    harder = rows({"contact": {"particle": {"restitution": 0.8}}})["time step"]
    assert "above the usual 0.4 (time_step_s" in harder and "tested" not in harder
    fixed = rows({"filling": {"particles": 900}, "design": {"replicates": 1}})
    assert fixed["particles"] == "900" and fixed["plan"].endswith("1 filling of each")


@pytest.mark.parametrize(("files", "number"), [([], 165), (["config/infill.yaml"], 189)])
def test_expected_time_is_that_of_all_simulations(monkeypatch, files, number):
    """With every simulation of one cost: their number times that, over the cores."""
    same = cost.Cost(15000, 36000, 3.3e8, 270)
    monkeypatch.setattr(cost, "expected", lambda *_: same)
    monkeypatch.setattr(preview.os, "sched_getaffinity", lambda process: range(3), raising=False)
    monkeypatch.setattr(preview, "duration", lambda seconds: f"{seconds:.1f}")
    table = rows(files=files)
    assert table["simulations"].startswith(f"{number}: 75 of the plan, ")
    assert ("24 of infill (2 x 4 designs), " in table["simulations"]) == (number == 189)
    fast, slow = (number * seconds / 3 for seconds in same.seconds)
    assert table["all simulations"].startswith(f"{fast:.1f} to {slow:.1f} on this machine's 3 cores")
    assert table["one simulation"].startswith(
        f"{same.seconds[0]:.1f} to {same.seconds[1]:.1f} on a core, 36,000 "
    )


@pytest.fixture
def directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text(
        (ROOT / "config.yaml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    return tmp_path


def test_check_prints_and_draws_and_writes_nothing_else(directory, capsys):
    assert cli.main(["check"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"study               {directory / 'results'}"
    assert said[-1] == "drawing             check.png"
    assert imread(directory / "check.png").size
    assert {path.name for path in directory.iterdir()} == {"config.yaml", "check.png"}


def test_check_says_every_mistake_and_draws_nothing(directory, capsys):
    (directory / "wrong.yaml").write_text("insert: {cone: {lenght_mm: 40}}\nparticles: {density_kg_m3: -1}\n")
    assert cli.main(["check", "--configfile", "config.yaml", "wrong.yaml"]) == 2
    captured = capsys.readouterr()
    assert "insert.cone.lenght_mm: unknown key" in captured.err
    assert "particles.density_kg_m3: -1 is not allowed" in captured.err
    assert captured.out == "" and not (directory / "check.png").exists()
