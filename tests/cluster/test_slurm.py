"""The study on a Slurm cluster: the results of one machine to the bit, also after every fault. See run.sh."""

import os
import shutil
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest

from tests.workflow.conftest import CLONE, Study
from tests.workflow.test_kills import PATIENCE, TO_DO, Killed, finish, same_data
from tests.workflow.test_reproducible import data, same

pytestmark = pytest.mark.skipif("CLUSTER" not in os.environ, reason="make test-cluster starts a cluster")

# This cluster has no accounts and no data base of its jobs, and need not be asked so seldom.
HERE = ["--slurm-no-account", "--slurm-status-command=squeue", "--slurm-init-seconds-before-status-checks=3"]
RESUMED = "resumed from a checkpoint at 0.190 s of the filling"


class OnSlurm(Study):
    """A study whose jobs go to the cluster."""

    def start_snakemake(self, *options, profile="slurm"):
        """Start Snakemake as on the login node of a cluster."""
        program = [CLONE / ".venv/bin/snakemake", "--snakefile", self.clone / "Snakefile"]
        profile = ["--workflow-profile", self.clone / "profiles" / profile]
        return self.start([*program, "--directory", self.directory, *profile, *HERE, *options])


class Struck(OnSlurm, Killed):
    """A finished study but for two simulations, which are held after their twentieth checkpoint."""

    targets = tuple(f"results/simulations/{run}.nc" for run in TO_DO)

    def environment_of(self, process):
        """Environment of a simulation, by its process number."""
        entries = Path(f"/proc/{process}/environ").read_bytes().split(b"\0")
        return dict(entry.decode().split("=", 1) for entry in entries if entry)

    def kill_all(self, **variables):
        """Kill all processes of the study that have these environment variables."""
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                own = (process / "cwd").resolve() == self.directory.resolve()
                if own and variables.items() <= self.environment_of(process.name).items():
                    os.kill(int(process.name), signal.SIGKILL)

    def check_simulations(self, finished):
        """The two simulations have the bits of the undisturbed ones, and nothing else has run."""
        for path, before in self.done.items():
            assert path.stat().st_mtime_ns == before.st_mtime_ns, path
        for target in self.targets:
            same_data(self.directory / target, finished.directory / target)
        assert not (self.results / ".state").exists()


def slurm(*command):
    """Run a command of Slurm; return what it prints."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def jobs(order):
    """State and time limit of the jobs of the simulations, oldest first, from the number `order` on."""
    listed = slurm("squeue", "--states=all", "--array", "--noheader", "--format=%A|%T|%l|%k").splitlines()
    rows = [line.split("|") for line in listed]
    return [(state, limit) for number, state, limit, comment in sorted(rows, key=lambda row: int(row[0]))
            if int(number) >= order and comment.startswith("rule_simulate")]  # fmt: skip


@pytest.fixture
def struck(finished, tmp_path):
    """A study on the cluster that something happens to; nothing of it runs on when the test ends."""
    study = Struck(finished, tmp_path)
    yield study
    study.hold.unlink(missing_ok=True)
    slurm("scancel", "--user", "root")
    study.kill_all()
    for process in study.started:
        process.wait()
        process.stdout.close()


def ended(process):
    """Whether a process is no more."""
    return not Path(f"/proc/{process}").exists()


def resumed(study):
    """Runs that went on from their checkpoints."""
    return [run for run in TO_DO if RESUMED in study.log(run)]


def test_a_cancelled_job_is_repeated_from_its_checkpoint(struck, finished):
    snakemake = struck.start_snakemake()
    first, _ = struck.wait_until_held()
    job = struck.environment_of(first)["SLURM_JOB_ID"]
    slurm("scancel", job)
    struck.wait(lambda: ended(first))
    struck.hold.unlink()
    finish(snakemake)
    assert resumed(struck) == [TO_DO[0]]
    struck.check_results(finished)


def test_the_jobs_of_a_lost_node_go_to_another(struck, finished):
    snakemake = struck.start_snakemake(*struck.targets)
    first, _ = struck.wait_until_held()
    job, node = (struck.environment_of(first)[name] for name in ("SLURM_JOB_ID", "SLURMD_NODENAME"))
    slurm("scontrol", "update", f"NodeName={node}", "State=DOWN", "Reason=test")
    try:
        struck.kill_all(SLURM_JOB_ID=job)  # as a loss of power does
        struck.wait(lambda: ended(first))
        struck.hold.unlink()
        finish(snakemake)
    finally:
        slurm("scontrol", "update", f"NodeName={node}", "State=RESUME")
    assert resumed(struck) == [TO_DO[0]]
    struck.check_simulations(finished)


def test_a_time_limit_that_is_reached_is_longer_at_the_next_attempt(struck, finished):
    package = struck.environment["PYTHONPATH"]
    struck.edit_code("workflow/rules/common.smk", "attempt * minutes", "attempt * 1")
    struck.environment["PYTHONPATH"] = package
    snakemake = struck.start_snakemake(*struck.targets)
    held = struck.wait_until_held()
    first = min(int(struck.environment_of(process)["SLURM_JOB_ID"]) for process in held)
    struck.wait(lambda: all(map(ended, held)))
    struck.hold.unlink()
    finish(snakemake)
    assert jobs(first) == 2 * [("TIMEOUT", "1:00")] + 2 * [("COMPLETED", "2:00")]
    assert resumed(struck) == list(TO_DO)
    struck.check_simulations(finished)


def test_a_restart_of_the_controller_is_not_noticed(struck, finished):
    snakemake = struck.start_snakemake(*struck.targets)
    held = struck.wait_until_held()
    first = min(int(struck.environment_of(process)["SLURM_JOB_ID"]) for process in held)
    controller = int((Path(os.environ["CLUSTER"]) / "run/slurmctld.pid").read_text())
    os.kill(controller, signal.SIGKILL)
    struck.wait(lambda: ended(controller))
    struck.hold.unlink()
    struck.wait(lambda: all(map(ended, held)))
    time.sleep(5)  # Snakemake asks, and there is no answer
    subprocess.run(["slurmctld"], check=True)
    finish(snakemake)
    assert [state for state, _ in jobs(first)] == 2 * ["COMPLETED"]
    assert resumed(struck) == []
    struck.check_simulations(finished)


def test_a_simulation_has_the_threads_of_its_allocation(struck, finished):
    options = ["--set-threads", "simulate=2", "--default-resources", "slurm_partition=wide"]
    snakemake = struck.start_snakemake(*struck.targets, *options)
    for process in struck.wait_until_held():
        arguments = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
        assert arguments[arguments.index(b"--threads") + 1] == b"2"
        job = struck.environment_of(process)["SLURM_JOB_ID"]
        assert slurm("squeue", "--noheader", "--jobs", job, "--format=%C").strip() == "2"
    struck.hold.unlink()
    finish(snakemake)
    struck.check_simulations(finished)


def test_a_failed_simulation_takes_its_job_along(struck, finished):
    """Of two in a job the first ends well and the second is killed: the first is made anew, from nothing."""
    snakemake = struck.start_snakemake(*struck.targets, profile="slurm-grouped")
    struck.wait(lambda: list(struck.directory.glob("held-*")))
    (first,) = (run for run in TO_DO if list(struck.directory.glob(f"held-{run}-*")))
    (second,) = set(TO_DO) - {first}
    (process,) = struck.wait_until_held([first])
    struck.hold.unlink()
    struck.wait(lambda: ended(process))
    struck.hold.touch()
    (process,) = struck.wait_until_held([second])
    os.kill(process, signal.SIGKILL)
    struck.wait(lambda: ended(process))
    struck.hold.unlink()
    said = finish(snakemake)
    assert f"results/simulations/{first}.nc" in said.partition("since they might be corrupted:")[2]
    assert resumed(struck) == [second]
    struck.check_simulations(finished)


def test_one_of_many_simulations_compiles_the_solver_on_a_node_and_the_others_load_it(tmp_path):
    """In a cache of the node's own, which is empty when eight of them start at once."""
    (tmp_path / "config.yaml").write_text("filling: {particles: 3}\n")
    command = (
        f"XDG_CACHE_HOME=cache/$SLURMD_NODENAME {CLONE}/.venv/bin/python -m hopperopt simulate "
        "--seed $SLURM_ARRAY_TASK_ID --state-dir state --output runs/$SLURM_ARRAY_TASK_ID.nc"
    )
    options = ["--wait", "--partition=wide", "--array=1-16", "--output=log-%a", "--wrap", command]
    environment = os.environ | {"NUMBA_DEBUG_CACHE": "1"}
    subprocess.run(["sbatch", *options], cwd=tmp_path, env=environment, check=True)
    assert len(list(tmp_path.glob("runs/*.nc"))) == 16
    logs = [path.read_text() for path in tmp_path.glob("log-*")]
    assert sum("data saved to" in log for log in logs) == 1
    assert sum("data loaded from" in log and "data saved to" not in log for log in logs) == 15
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["n0"]


def test_the_reduced_study_in_grouped_jobs_has_the_bits_of_one_machine(tmp_path):
    """The one machine's is the clone's own, finished where it is not."""
    options = ["--configfile", CLONE / "config" / "ci.yaml"]
    local = Study(CLONE).snakemake(*options)
    assert local.returncode == 0, local.stdout
    shutil.copy(CLONE / "config.yaml", tmp_path)
    on_cluster = OnSlurm(tmp_path).start_snakemake(*options, profile="slurm-grouped")
    finish(on_cluster, 4 * PATIENCE)
    one, other = (directory / "results" / "ci" for directory in (CLONE, tmp_path))
    paths = [path for suffix in ("nc", "csv", "yaml", "png") for path in one.rglob(f"*.{suffix}")]
    assert len(paths) > 60
    assert [path for path in paths if not same(data(path), data(other / path.relative_to(one)))] == []
