"""The command line: what it refuses and how it says so, and what a simulation by hand is."""

import io
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from hopperopt import cli, experiment, files, heartbeat, provenance


@pytest.fixture
def simulated(monkeypatch, tmp_path, make_run):
    """Function that runs `simulate` with a solver that only writes down its case; returns case and file."""
    cases, used = [], []

    def run(case, progress=None, threads=1, checkpoint=None):
        cases.append(case)
        used.append(threads)
        progress(SimpleNamespace(stage="filling", time=0.1, particles=60, rate=1e6, remaining=None))
        simulate.beats += heartbeat.read(Path("results/.state"))
        if stop := simulate.stops.pop() if simulate.stops else None:
            checkpoint.save({"counters": np.arange(3)})
            raise stop
        simulate.found.append(checkpoint.load())
        return make_run(status="jammed", stayed=20, filling_level=0.060).assign_attrs(wall_time_s=1.0)

    monkeypatch.setattr(experiment, "run", run)
    monkeypatch.setattr(provenance, "compile_solver", lambda threads: None)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("filling: {particles: 60}\n")

    def simulate(*options):
        assert cli.main(["simulate", *options, "--output", "out/run.nc"]) == 0
        return cases[-1], files.read_netcdf(tmp_path / "out" / "run.nc")

    simulate.threads, simulate.stops, simulate.found, simulate.beats = used, [], [], []
    return simulate


def test_an_interrupted_simulation_leaves_its_state_to_the_next(simulated, tmp_path, capsys):
    """In the study's folder of results or where it is told; another seed does not use it."""
    for options, folder in ([], "results/.state"), (["--state-dir", "elsewhere"], "elsewhere"):
        simulated.stops.append(KeyboardInterrupt())
        assert cli.main(["simulate", "--seed", "1", *options, "--output", "out/run.nc"]) == 130
        assert "the same command, or `make resume`, goes on" in capsys.readouterr().err
        assert [path.suffix for path in sorted((tmp_path / folder).iterdir())] == [".lock", ".npz"]
        simulated("--seed", "1", "--threads", "2", "--checkpoint-minutes", "null", *options)
        assert simulated.found[-1]["counters"].tolist() == [0, 1, 2]
        assert not (tmp_path / folder).exists()
    simulated.stops.append(KeyboardInterrupt())
    assert cli.main(["simulate", "--seed", "1", "--output", "out/run.nc"]) == 130
    simulated("--seed", "2")
    assert simulated.found[-1] is None
    with pytest.raises(SystemExit):
        simulated("--checkpoint-minutes", "0")
    assert "0 is not allowed; allowed: a number above 0 or null" in capsys.readouterr().err


def test_a_simulation_has_a_heartbeat_and_a_log_while_it_runs(simulated, capsys, monkeypatch):
    monkeypatch.setattr(heartbeat, "INTERVAL", 0)
    simulated()
    assert [(beat.output, beat.stage) for beat in simulated.beats] == [("../../out/run.nc", "filling")]
    assert "filling     0.100 s simulated,     60 particles left" in capsys.readouterr().err
    assert not Path("results/.state").exists()


def test_a_simulation_that_waits_for_the_compiler_says_so(simulated, capsys, monkeypatch, tmp_path):
    """Its heartbeat and its log: that is a silent minute otherwise, once in each new environment."""
    monkeypatch.setattr(provenance, "_mark", lambda threads: tmp_path / "compiled")
    simulated()
    assert [beat.stage for beat in simulated.beats] == ["compiling"]
    (tmp_path / "compiled").touch()
    simulated()
    assert [beat.stage for beat in simulated.beats[1:]] == ["starting"]


def test_the_log_begins_with_versions_and_the_resolved_case(simulated, caplog):
    caplog.set_level("INFO")
    case, _ = simulated("--theta", "57.5")
    heading, settings = caplog.text.split("settings:\n")
    assert "hopperopt" in heading and "numpy" in heading
    text = settings.partition("WARNING")[0]
    assert yaml.safe_load(text)["walls"] == case["walls"]
    assert caplog.text.count("settings:\n") == 1


def test_a_full_disk_is_a_sentence_with_what_to_do(simulated, monkeypatch, capsys, tmp_path):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    assert cli.main(["simulate", "--no-insert", "--output", "out/run.nc"]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("hopperopt: out/run.nc: No space left on device; free some space, then ")
    assert "make resume" in said
    assert list((tmp_path / "out").iterdir()) == []


def test_threads_are_the_configurations_unless_typed(simulated, tmp_path, capsys):
    case, _ = simulated("--no-insert")
    (tmp_path / "config.yaml").write_text("filling: {particles: 60}\nsimulation: {threads: 3}\n")
    threaded, _ = simulated("--no-insert")
    assert threaded == case  # no part of what a run depends on
    simulated("--no-insert", "--threads", "2")
    simulated("--case", json.dumps(case))
    assert simulated.threads == [1, 3, 2, 1]
    with pytest.raises(SystemExit):
        simulated("--no-insert", "--threads", "none")
    assert "--threads: none is not allowed; allowed: a whole number from 1" in capsys.readouterr().err


def test_a_simulation_by_hand_has_the_design_that_was_typed(simulated):
    case, run = simulated("--theta", "57.5", "--length", "45", "--factor", "height_mm=28", "--seed", "7")
    assert case["design"] == {"theta_deg": 57.5, "length_mm": 45.0, "height_mm": 28.0}
    assert case["walls"]["insert"][0] == [0.0, 0.028]
    assert sum(case["particles"]["counts"]) == 60
    assert case["seed"] == run.attrs["seed"] == 7
    assert json.loads(run.attrs["case"]) == json.loads(json.dumps(case))
    assert {"code_digest", "git", "versions", "host", "created", "wall_time_s"} <= set(run.attrs)


def test_factors_that_are_not_typed_are_those_of_the_configuration(simulated, tmp_path):
    (tmp_path / "more.yaml").write_text("insert: {cone: {length_mm: 32}}\n")
    case, _ = simulated("--configfile", "config.yaml", "more.yaml", "--theta", "60")
    assert case["design"] == {"theta_deg": 60.0, "length_mm": 32.0, "height_mm": 29.6}


def test_the_bare_hopper_has_no_insert(simulated):
    case, _ = simulated("--no-insert")
    assert case["walls"]["insert"] is None and case["design"] == {}


def test_a_jammed_simulation_is_a_result(simulated, capsys, caplog):
    _, run = simulated()
    assert run["status"] == "jammed"
    assert "run.nc: jammed, 0.8% of the mass stayed inside" in capsys.readouterr().err
    assert "60.0 mm high, not 74 mm" in caplog.text


def test_the_workflows_case_runs_as_it_is(simulated):
    by_hand, _ = simulated("--theta", "60", "--seed", "3")
    case, run = simulated("--case", json.dumps(by_hand | {"code": "0123"}), "--design")
    assert case == json.loads(json.dumps(by_hand))
    assert "0123" not in run.attrs["case"] and run.attrs["code_digest"] != "0123"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--theta", "steep"], "theta_deg: steep is not allowed; allowed: a number"),
        (["--theta", "nan"], "theta_deg: nan is not allowed; allowed: a number"),
        (["--theta", "1_0"], "theta_deg: 1_0 is not allowed; allowed: a number"),
        (["--length", "90"], "insert"),
        (["--factor", "width_mm=3"], "allowed: theta_deg, length_mm, height_mm"),
        (["--factor", "theta_deg"], "allowed: NAME=VALUE"),
        (["--no-insert", "--theta", "55"], "--no-insert goes without"),
        (["--configfile", "missing.yaml"], "missing.yaml"),
        (["--configfile", "config.yaml", "typo.yaml"], "filling.particels"),
        (["--configfile", "broken.yaml"], "broken.yaml"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_status_2(tmp_path, monkeypatch, capsys, options, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("seed: 1\n")
    (tmp_path / "typo.yaml").write_text("filling: {particels: 60}\n")
    (tmp_path / "broken.yaml").write_text("filling: {particles: 60\n")
    assert cli.main(["simulate", *options, "--output", "run.nc"]) == 2
    message = capsys.readouterr().err
    assert said in message and message.startswith("hopperopt: ")
    assert message.count("\n") == 1
    assert not (tmp_path / "run.nc").exists()


@pytest.mark.parametrize("output", ["file/run.nc", "folder", "/proc/run.nc"])
def test_an_output_that_cannot_be_written_is_said_before_the_work(tmp_path, monkeypatch, capsys, output):
    def work(*_, **__):
        raise AssertionError("the simulation has begun")

    monkeypatch.setattr(provenance, "compile_solver", work)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("filling: {particles: 60}\n")
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    assert cli.main(["simulate", "--no-insert", "--output", output]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"hopperopt: {output.removesuffix('/run.nc')}: ") and message.count("\n") == 1


@pytest.mark.parametrize("seed", ["-1", "1.5", "one", str(2**63)])
def test_seed_that_is_not_allowed(tmp_path, capsys, seed):
    with pytest.raises(SystemExit) as stopped:
        cli.main(["simulate", "--seed", seed, "--output", str(tmp_path / "run.nc")])
    assert stopped.value.code == 2
    assert f"--seed: {seed} is not allowed; allowed: a whole number" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "key", "levels"),
    [
        ("count", "filling.particles", [900, 1200, 1500, 1800, 2100]),
        ("step_s", "simulation.time_step_s", [1e-5, 1.5e-5, 2e-5, 2.5e-5, 3e-5]),
    ],
)
def test_a_factor_whose_key_holds_no_number_must_be_typed(simulated, tmp_path, capsys, name, key, levels):
    simulation = "simulation: {time_step_s: auto}\nfilling: {particles: null}\n"
    factor = f"factors: {{{name}: {{key: {key}, levels: {levels}}}}}\n"
    (tmp_path / "config.yaml").write_text(simulation + factor)
    assert cli.main(["simulate", "--output", "run.nc"]) == 2
    assert f"{name} has no value: give --factor {name}=VALUE" in capsys.readouterr().err
    case, _ = simulated("--factor", f"{name}={levels[0]}")
    assert case["design"] == {name: levels[0]}


def test_a_missing_input_and_bad_json_are_said_plainly(tmp_path, capsys):
    output = ["--output", str(tmp_path / "training.nc")]
    missing = ["--dataset", str(tmp_path / "dataset.nc"), *output]
    assert cli.main(["filter", "--params", "{}", *missing]) == 2
    assert "dataset.nc" in capsys.readouterr().err
    with pytest.raises(SystemExit) as stopped:
        cli.main(["filter", "--params", "{", *missing])
    assert stopped.value.code == 2
    assert "no JSON" in capsys.readouterr().err


def test_what_is_longer_than_an_argument_comes_from_standard_input(tmp_path, make_run, monkeypatch):
    """A plan of 5,000 experiments; the paths of runs."""
    plan = [{"name": f"exp_{n}", "design": {"length_mm": n / 7}, "levels": {}} for n in range(5000)]
    text = json.dumps({"factors": ["length_mm"], "experiments": plan})
    assert len(text) > 128 * 1024
    design, *outputs = (str(tmp_path / name) for name in ("design.csv", "d.nc", "runs.csv", "designs.csv"))
    monkeypatch.setattr("sys.stdin", io.StringIO(text))
    assert cli.main(["design", "--params", "-", "--output", design]) == 0
    assert len(files.read_table(design)) == 5000
    plan = [{**row, "design": {"length_mm": 7.0}} for row in plan[:2]]
    text = json.dumps({"factors": ["length_mm"], "experiments": plan})
    assert cli.main(["design", "--params", text, "--output", design]) == 0
    runs = [tmp_path / f"exp_{n}_rep_1.nc" for n in range(2)]
    for run in runs:
        files.write_netcdf(make_run(), run)
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{run}\n" for run in runs)))
    params = '{"factors": ["length_mm"], "incomplete": "refuse"}'
    options = ["--params", params, "--design", design, "--simulations", "-", "--output", *outputs]
    assert cli.main(["gather", *options]) == 0
    assert files.read_table(outputs[1])["experiment"].tolist() == ["exp_0", "exp_1"]


def test_every_stage_and_figure_has_its_function():
    """The command line names modules by text: each must exist, as must the function in it."""
    for stage in cli.STAGES.values():
        assert provenance.code_digest(f"hopperopt.{stage.module}")
        module = cli.importlib.import_module(f"hopperopt.{stage.module}")
        assert callable(getattr(module, stage.function))
    for name in cli.FIGURES:
        assert provenance.code_digest(f"hopperopt.figures.{name}")
