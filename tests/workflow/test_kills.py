"""Whatever is killed and how: the study goes on from its checkpoints and ends as the undisturbed one."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from hopperopt import files

from .conftest import CLONE, CONFIG, Study

pytestmark = pytest.mark.slow

PATIENCE = 900.0  # s for what must come in the end
TO_DO = ("exp_04_rep_1", "exp_05_rep_1")
# While the study has a file `hold`, a simulation waits after its twentieth save, and says so by a file: a
# test meets it there at any speed.
HOLD = """

def _save_and_wait(self, state, save=Checkpoint.save, saves=[]):
    save(self, state)
    saves.append(state)
    if len(saves) == 20 and Path("hold").exists():
        Path(f"held-{self._path.stem}.{os.getpid()}").touch()
        while Path("hold").exists():
            time.sleep(0.02)


Checkpoint.save = _save_and_wait
"""


class Killed(Study):
    """A finished study but for two simulations, which save their states at every sample and can be held."""

    def __init__(self, finished, folder):
        shutil.copytree(finished.directory, folder / "study")
        super().__init__(folder / "study", overlaid_package(folder / "src"))
        (self.directory / "config.yaml").write_text(CONFIG + "simulation: {checkpoint_minutes: 1.0e-9}\n")
        self.results = self.directory / "results"
        for name in ("dataset.nc", *(f"simulations/{run}.nc" for run in TO_DO)):
            (self.results / name).unlink()
        # The designs of the other cases follow from all of the plan.
        fixed = ("simulations/*", "verification/plan_centre_*", "verification/bare_*")
        self.done = {path: path.stat() for name in fixed for path in self.results.glob(f"{name}.nc")}
        assert len(self.done) == 5
        self.hold = self.directory / "hold"
        self.hold.touch()
        self.started = []

    def start(self, command):
        """Start a command and remember it."""
        self.started.append(super().start(command))
        return self.started[-1]

    def make(self, target):
        """Start make; the process is the head of a group with all that it starts."""
        return self.start(["make", "-C", CLONE, f"STUDY={self.directory}", "CORES=2", target])

    def wait(self, met):
        """Wait until a condition is met, as long as what was started last goes on."""
        end = time.monotonic() + PATIENCE
        while not met():
            assert self.started[-1].poll() is None, self.started[-1].communicate()[0]
            assert time.monotonic() < end, "nothing came of it"
            time.sleep(0.05)

    def wait_until_held(self, runs=TO_DO):
        """Wait until the simulations are held at their checkpoints; return their process numbers."""
        held = [f"held-{run}-*" for run in runs]
        self.wait(lambda: all(list(self.directory.glob(name)) for name in held))
        return [int(next(self.directory.glob(name)).suffix[1:]) for name in held]

    def log(self, run):
        """What the log of a simulation says, empty where there is none."""
        path = self.results / f"logs/simulate/{run}.log"
        return path.read_text() if path.exists() else ""

    def wait_for_log(self, text, runs=TO_DO):
        """Wait until the logs of the simulations contain a text."""
        self.wait(lambda: all(text in self.log(run) for run in runs))

    def check_results(self, finished):
        """All results are those of the undisturbed study; what was done has not been touched."""
        for path, before in self.done.items():
            after = path.stat()
            assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns), path
        originals = finished.directory / "results"
        for suffix, read in (
            (".nc", files.read_netcdf),
            (".csv", files.read_table),
            (".yaml", files.read_yaml),
        ):
            for original in originals.rglob(f"*{suffix}"):
                one, other = read(original), read(self.results / original.relative_to(originals))
                if suffix == ".nc":
                    one, other = one.drop_attrs(deep=False), other.drop_attrs(deep=False)
                    assert one.identical(other), original
                else:
                    assert one.equals(other) if suffix == ".csv" else one == other, original
        assert not (self.results / ".state").exists()
        assert not list(self.results.rglob(".*")), "temporary files are left"


def overlaid_package(folder):
    """The package with one module in another place; the solver stays in its own, where it is compiled."""
    package, original = folder / "hopperopt", CLONE / "src" / "hopperopt"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(f"__path__.append({str(original)!r})\n")
    (package / "checkpoint.py").write_text((original / "checkpoint.py").read_text() + HOLD)
    return folder


def same_data(*paths):
    """Two netCDF files hold the same variables, bit for bit."""
    one, other = (files.read_netcdf(path).drop_attrs(deep=False) for path in paths)
    assert one.identical(other), paths


@pytest.fixture
def killed(finished, tmp_path):
    """A study to be killed; nothing of it runs on when the test ends."""
    study = Killed(finished, tmp_path)
    yield study
    for process in study.started:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()


@pytest.fixture
def made(killed):
    """The same, with make as a user types it."""
    if not (CLONE / ".venv").samefile(sys.prefix):
        pytest.skip("make works in the environment .venv, the tests do not")
    return killed


def finish(process, patience=PATIENCE):
    """Wait (s) for a process that must end well; return what it said."""
    output, _ = process.communicate(timeout=patience)
    assert process.returncode == 0, output
    return output


def snakemake_of(process):
    """Process number of the Snakemake that make has started."""
    (child,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    return int(child)


def test_the_orphan_of_a_killed_snakemake_is_waited_for(killed, finished):
    """Snakemake is killed and the simulation lives on; what takes its place waits, and goes on when it is
    killed as well."""
    run = TO_DO[1]
    target = f"results/simulations/{run}.nc"
    first = killed.start_snakemake(target)
    (orphan,) = killed.wait_until_held([run])
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    assert killed.ask("--unlock").returncode == 0
    second = killed.start_snakemake("--rerun-incomplete", target)
    killed.wait_for_log(f"process {orphan} is still simulating {target}; waiting for it to end", [run])
    assert not (killed.directory / target).exists()
    os.kill(orphan, signal.SIGKILL)
    killed.wait_for_log("resumed from a checkpoint at 0.190 s of the filling, 60 particles left", [run])
    killed.hold.unlink()
    finish(second)
    same_data(killed.directory / target, finished.directory / target)
    assert not (killed.results / ".state").exists()


@pytest.mark.full
def test_orphans_that_finish_are_the_result(made, finished):
    first = made.make("study")
    orphans = made.wait_until_held()
    os.kill(snakemake_of(first), signal.SIGKILL)
    first.wait()
    second = made.make("resume")
    made.wait_for_log("waiting for it to end")
    made.hold.unlink()
    finish(second)
    assert len(set(orphans)) == 2
    assert all("is what that process has just written" in made.log(run) for run in TO_DO)
    made.check_results(finished)


def kill_a_simulation(process, simulations):
    os.kill(simulations[0], signal.SIGKILL)


def terminate_a_simulation(process, simulations):
    os.kill(simulations[0], signal.SIGTERM)


def kill_everything(process, simulations):
    os.killpg(process.pid, signal.SIGKILL)


def terminate_everything(process, simulations):
    os.killpg(process.pid, signal.SIGTERM)


def terminate_snakemake(process, simulations):
    os.kill(snakemake_of(process), signal.SIGTERM)


def interrupt_everything(process, simulations):
    os.killpg(process.pid, signal.SIGINT)


@pytest.mark.full
@pytest.mark.parametrize(
    "strike",
    [
        kill_a_simulation,
        terminate_a_simulation,
        kill_everything,
        terminate_everything,
        terminate_snakemake,
        interrupt_everything,
    ],
)
def test_make_resume_finishes_the_study(made, finished, strike):
    process = made.make("study")
    simulations = made.wait_until_held()
    strike(process, simulations)
    made.hold.unlink()
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode != 0, output
    finish(made.make("resume"))
    made.check_results(finished)
    if strike is kill_everything:
        assert all("resumed from a checkpoint" in made.log(run) for run in TO_DO)


@pytest.mark.full
def test_two_makes_do_not_work_on_one_study(made, finished):
    first = made.make("study")
    made.wait_until_held()
    for target in ("study", "resume"):
        second = made.make(target)
        output, _ = second.communicate(timeout=PATIENCE)
        assert second.returncode != 0
        assert "another make is at work on this study" in output and "snakemake" not in output
    made.hold.unlink()
    finish(first)
    made.check_results(finished)


@contextmanager
def small_disk(folder, megabytes):
    """A small file system of its own in place of a folder, with what the folder holds."""
    mount = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", folder]
    held = folder.with_name("held")
    folder.rename(held)
    folder.mkdir()
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("no small file system can be mounted here")
    try:
        shutil.copytree(held, folder, dirs_exist_ok=True)
        yield
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


@pytest.mark.full
def test_a_full_disk_is_said_and_leaves_no_half_file(made, finished):
    """The states and the results do not fit; with some space freed the study is finished."""
    made.hold.unlink()
    with small_disk(made.results, 16):
        made.done = {path: path.stat() for path in made.done}
        filler = made.results / "filler"
        with filler.open("wb", buffering=0) as file, pytest.raises(OSError, match="No space left"):
            while True:
                file.write(bytes(4096))
        os.truncate(filler, filler.stat().st_size - 40 * 1024)
        process = made.make("study")
        output, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode != 0
        log = made.log(TO_DO[0]) + made.log(TO_DO[1])
        assert "could not be saved (No space left on device); the simulation goes on" in log
        said = "No space left on device; free some space, then the same command, or `make resume`, goes on"
        assert f"{TO_DO[0]}.nc: {said}" in output
        assert not any((made.results / f"simulations/{run}.nc").exists() for run in TO_DO)
        assert not list(made.results.glob("simulations/.*"))
        filler.unlink()
        finish(made.make("resume"))
        made.check_results(finished)
