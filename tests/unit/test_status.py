"""How far a study is, from hand-made files and heartbeats."""

import io
import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

from hopperopt import cli, config, files, heartbeat, status
from hopperopt.heartbeat import Beat


@pytest.fixture(scope="module")
def runs():
    return status.planned(config.parse({"filling": {"particles": 60}, "design": {"replicates": 1}}))


def test_rounds_of_infill_are_simulations_of_designs_to_be_found():
    found = config.parse({"infill": {"rounds": 2, "batch": 1}, "design": {"replicates": 2}})
    runs = [run for run in status.planned(found) if run.purpose == "infill"]
    assert [str(run.file) for run in runs] == [
        f"results/infill/round_{number}/infill_{number}_1_rep_{replicate}.nc"
        for number in (1, 2)
        for replicate in (1, 2)
    ]
    assert {run.case for run in runs} == {None}
    assert "infill       [" in status.screen(runs, status.Seen(["done"] * 4, {}, []), Path("results"), [], 20)


@pytest.fixture
def study(tmp_path, monkeypatch, make_run, runs):
    """The study's simulations and functions that pretend that one has ended or runs."""

    class Made:
        state_dir = Path("results/.state")

        def finish(self, number, wall_time=100.0, case=None):
            run = self.runs[number]
            data = make_run(filling_time=0.5, discharge_time=1.0)
            data.attrs |= {"case": case or run.case or "{}", "wall_time_s": wall_time}
            files.write_netcdf(data, run.file)

        def beat(self, number, age=0.0, **said):
            file = self.runs[number].file if isinstance(number, int) else Path(number)
            self.state_dir.mkdir(parents=True, exist_ok=True)
            path = heartbeat._file(file, self.state_dir)
            values = {"stage": "discharge", "time": 0.4, "discharged": 0.4, "rate": 7.1e6, "remaining": 30.0}
            place = os.path.relpath(file, self.state_dir)
            path.write_text(json.dumps(values | said | {"output": place, "host": "node3", "pid": 4711}))
            os.utime(path, (time.time() - age,) * 2)

        def screen(self, lines=50):
            seen = status.look(self.runs, self.state_dir)
            return status.screen(self.runs, seen, Path("results"), [Path("results/figures/a.png")], lines)

        def left(self):
            return status.left(status.look(self.runs, self.state_dir))

    monkeypatch.chdir(tmp_path)
    Made.runs = runs
    return Made()


def test_before_anything_ran(study):
    text = study.screen()
    assert "0 of  25 done" in text and "25 to come" in text
    assert "0 of  90 done" in text and "90 to come" in text
    assert "figures 0 of 1" in text and "verdict -" in text
    assert "no simulation is running" in text and "`make resume`" in text
    assert not Path("results").exists(), "looking makes no file"


def test_some_done_some_running(study):
    for number in range(10):
        study.finish(number)
    study.beat(10)
    study.beat(11, stage="filling", time=0.25, discharged=0.0, remaining=None)
    text = study.screen()
    assert "10 of  25 done    2 running   13 to come" in text
    rows = [line.split() for line in text.splitlines() if "node3" in line]
    assert " ".join(rows[0]) == "simulations/exp_11_rep_1 discharge 0.400 s 40% 7.1 30 s node3:4711"
    # Filled half, which is half of half of the work of a run of 0.5 s of filling and 1 s of discharge.
    assert " ".join(rows[1]) == "simulations/exp_12_rep_1 filling 0.250 s 0% 7.1 1 min 15 s node3:4711"
    # 30 s and 75 s of these two, 100 s of each of the 13 + 90 others, two at a time
    assert study.left() == pytest.approx((30 + 75 + 103 * 100) / 2)
    assert "about 1 h 26 min to go for all simulations, 2 at a time" in text


def test_one_that_was_killed_is_told_and_counted_as_to_come(study):
    study.finish(0)
    study.beat(1, age=190)
    study.beat(2)
    text = study.screen()
    assert "1 without a sign of life" in text
    (row,) = [line for line in text.splitlines() if "exp_02_rep_1" in line]
    assert "no sign of life for 3 min 1" in row
    assert study.left() == pytest.approx(30 + (22 + 1 + 90) * 100)


def test_a_compilation_is_given_ten_minutes(study):
    study.beat(0, age=190, stage="compiling", rate=0.0, remaining=None)
    assert "1 running" in study.screen()
    study.beat(0, age=700, stage="compiling", rate=0.0, remaining=None)
    assert "no sign of life" in study.screen()


def test_in_the_middle_of_a_resume(study):
    """A killed run that goes on is running again; what was left of a finished one is not told."""
    study.finish(0)
    study.beat(0, age=500)
    study.beat(1, age=500)
    study.beat(1, stage="discharge", remaining=20.0)
    text = study.screen()
    assert "1 of  25 done    1 running   23 to come" in text
    assert "no sign of life" not in text and "exp_01" not in text


def test_a_run_of_other_settings_is_not_done(study):
    study.finish(0)
    study.finish(1, case='{"seed": 0}')
    text = study.screen()
    assert "1 of  25 done" in text and "1 of other settings, to be repeated" in text


def test_a_run_that_is_made_anew_is_running(study):
    study.finish(0)
    study.beat(0)
    assert "0 of  25 done    1 running" in study.screen()


def test_the_time_is_not_guessed_before_a_run_has_ended(study):
    study.beat(0, remaining=None)
    assert "time to go: known when" in study.screen()


def test_a_run_that_is_damaged_or_empty_is_to_come(study):
    study.finish(0)
    study.runs[0].file.write_bytes(study.runs[0].file.read_bytes()[:300])
    study.finish(1, wall_time=np.nan)
    files.write_netcdf(files.read_netcdf(study.runs[1].file).drop_attrs(), study.runs[2].file)
    assert "1 of  25 done" in study.screen()


def test_a_simulation_by_hand_is_shown_but_not_counted(study):
    study.finish(0)
    study.beat("run.nc")
    text = study.screen()
    assert "../run" in text and "0 running" in text


def test_it_fits_on_one_screen(study):
    for number in range(60):
        study.beat(number)
    text = study.screen(lines=24)
    assert len(text.splitlines()) < 24
    assert "and 47 more" in text


def test_watching_redraws_until_all_is_done():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    stream, waits = Terminal(), []
    answers = iter([("one\n", False), ("two\n", False), ("three\n", True)])
    status.watch(lambda: next(answers), stream, waits.append)
    assert stream.getvalue() == "".join(f"{status.CLEAR}{text}\n" for text in ("one", "two", "three"))
    assert waits == [status.REDRAW] * 2


def test_a_beat_tells_its_own_time_first():
    beat = Beat("a.nc", "discharge", 0.4, 0.1, 1e6, 12.0, "h", 1)
    assert status.to_go(beat, [status.Finished("", 1e3, 0.5, 1.0)]) == 12.0
    assert status.to_go(beat._replace(remaining=None), []) is None


def test_the_command_from_another_folder(study, tmp_path, monkeypatch, capsys):
    study.finish(0)
    Path("config.yaml").write_text("filling: {particles: 60}\ndesign: {replicates: 1}\n")
    Path("elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert cli.main(["status", "--directory", ".."]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"{tmp_path / 'results'}, ") and "1 of  25 done" in text
    assert cli.main(["status"]) == 2
    assert "config.yaml: cannot be read" in capsys.readouterr().err
