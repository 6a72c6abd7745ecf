"""A checkpoint on disk comes back whole, or is not used and says why; one process at a time has it."""

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hopperopt import checkpoint
from hopperopt.checkpoint import Checkpoint

STATE = {
    "spheres.place": np.arange(12.0).reshape(3, 4),
    "counters": np.array([3, -1]),
    "exit_time": np.array([np.nan, 0.25]),
    "settled": np.asarray(True),
    "settings.sensor": np.asarray(-np.inf),
}
STAMP = {"case": "1234", "version of the code": "abcd"}


@pytest.fixture
def kept(tmp_path):
    """A checkpoint that has been saved."""
    kept = Checkpoint(tmp_path / "run.npz", STAMP, 5)
    kept.save(STATE)
    return kept


def test_the_state_comes_back_bit_for_bit(kept):
    back = kept.load()
    assert back.keys() == STATE.keys()
    for name, value in STATE.items():
        assert back[name].dtype == value.dtype and back[name].shape == value.shape
        assert back[name].tobytes() == value.tobytes()
        assert back[name].flags.writeable


def test_the_file_is_a_plain_npz(kept, tmp_path):
    with np.load(tmp_path / "run.npz", allow_pickle=False) as file:
        assert np.array_equal(file["spheres.place"], STATE["spheres.place"])
        assert "abcd" in file["stamp"].item()
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_a_torn_or_altered_file_is_not_used(kept, tmp_path, caplog):
    """Cut anywhere, or with one bit changed anywhere."""
    path = tmp_path / "run.npz"
    whole = path.read_bytes()
    cut = [whole[:length] for length in range(0, len(whole), 97)]
    positions = range(0, len(whole), 101)
    altered = [whole[:k] + bytes([whole[k] ^ 4]) + whole[k + 1 :] for k in positions]
    for data in [*cut, *altered, whole + b"\0"]:
        path.write_bytes(data)
        caplog.clear()
        assert kept.load() is None
        assert "run.npz is not used: it is torn" in caplog.text


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"case": "5678"}, "saved with another case;"),
        ({"version of the code": "ef01"}, "saved with another version of the code;"),
        ({"case": "", "version of the code": ""}, "another case and another version of the code;"),
    ],
)
def test_a_state_of_another_case_or_code_is_not_used(kept, tmp_path, caplog, changes, said):
    assert Checkpoint(tmp_path / "run.npz", STAMP | changes, 5).load() is None
    assert said in caplog.text


def test_without_a_file_nothing_is_said(tmp_path, caplog):
    assert Checkpoint(tmp_path / "run.npz", STAMP, 5).load() is None
    assert caplog.text == ""


def test_it_is_due_after_the_interval_and_never_without_one(tmp_path, monkeypatch):
    now = 100.0
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: now)
    kept, never = (Checkpoint(tmp_path / "run.npz", STAMP, minutes) for minutes in (2, None))
    assert not kept.due() and not never.due()
    now += 121.0
    assert kept.due()
    kept.save(STATE)
    assert not kept.due()
    now += 1.0e9
    assert kept.due() and not never.due()


def test_a_state_that_cannot_be_saved_stops_nothing_and_keeps_the_last(kept, tmp_path, caplog, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint.np, "savez", full)
    kept.save({"counters": np.zeros(2)})
    assert "run.npz could not be saved (No space left on device); the simulation goes on" in caplog.text
    assert kept.load().keys() == STATE.keys()
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_it_is_removed_when_the_work_is_done_and_stays_otherwise(tmp_path):
    arguments = tmp_path / "simulations" / "run.nc", tmp_path / ".state", STAMP, 5
    with pytest.raises(RuntimeError), checkpoint.working_on(*arguments) as (kept, _):
        kept.save(STATE)
        raise RuntimeError
    with checkpoint.working_on(*arguments) as (kept, waited):
        assert kept.load() and not waited
    assert not (tmp_path / ".state").exists()


def test_each_output_has_its_own_state_wherever_the_study_lies(tmp_path, monkeypatch):
    def names(*outputs):
        for output in outputs:
            with checkpoint.working_on(Path(output), Path("results/.state"), STAMP, 5) as (kept, _):
                kept.save(STATE)
                yield next(Path("results/.state").glob("*.npz")).name

    found = []
    for folder in ("here", "there"):
        (tmp_path / folder).mkdir()
        monkeypatch.chdir(tmp_path / folder)
        found.append(list(names("results/simulations/a_1.nc", "results/verification/a_1.nc", "a_1.nc")))
    assert found[0] == found[1]
    assert len(set(found[0])) == 3 and all(name.startswith("a_1-") for name in found[0])


def test_leftovers_of_killed_writers_are_removed(tmp_path):
    output, state = tmp_path / "run.nc", tmp_path / ".state"
    leftover, other = tmp_path / ".0123abcd.run.nc", tmp_path / ".0123abcd.other.nc"
    leftover.touch()
    other.touch()
    with checkpoint.working_on(output, state, STAMP, 5):
        assert not leftover.exists() and other.exists()


HOLDER = """
import sys, time
from pathlib import Path
from hopperopt import checkpoint
with checkpoint.working_on(Path(sys.argv[1]), Path(sys.argv[2]), {}, 5):
    print("held", flush=True)
    sys.stdin.readline()
    Path(sys.argv[1]).write_text("done")
"""


@pytest.mark.parametrize("killed", [True, False])
def test_a_second_process_waits_for_the_first_and_says_so(tmp_path, caplog, killed):
    """Whether the first finishes, and so deletes the lock's file, or is killed."""
    caplog.set_level(logging.INFO)
    output, state = tmp_path / "run.nc", tmp_path / ".state"
    command = [sys.executable, "-c", HOLDER, output, state]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "held\n"

        class Ends(logging.Handler):
            """Ends the holder once the waiting has been announced."""

            def emit(self, record):
                if killed:
                    holder.kill()
                else:
                    holder.communicate("go\n")

        logging.getLogger().addHandler(handler := Ends())
        try:
            with checkpoint.working_on(output, state, STAMP, 5) as (_, waited):
                assert waited
                assert output.exists() == (not killed)
                assert list(state.glob("*.lock")), "the lock that is held is at its place"
        finally:
            logging.getLogger().removeHandler(handler)
    assert f"process {holder.pid} is still simulating {output}; waiting for it to end" in caplog.text
