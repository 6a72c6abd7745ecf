"""A tiny study, run once; its copies are changed in one thing and asked what would run again."""

import fcntl
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from .forked import forked_python, snakemake_in_fork

CLONE = Path(__file__).resolve().parents[2]
SIMULATIONS = ("simulate", "verify_simulate")
CONFIG = """\
filling: {particles: 60}
design: {plan: csv, replicates: 1}
surrogate:
  hidden_nodes: [2, 3]
  selected_hidden_nodes: 2
  starts: 2
  validation: {starts: 1}
  validation_experiments: 1
  test_experiments: 1
optimise: {population: 8, generations: 3}
verification:
  replicates: 1
  replicates_of: {}
  cases: {selected: selected, best_f: best_f, plan_best: plan_best, plan_centre: plan_centre, bare: bare}
figures: {dpi: 50}
"""
# Both extremes of every factor twice: whatever two experiments are held out, or one level is changed.
PLAN = """\
experiment,theta_deg,length_mm,height_mm
exp_01,60,50,34
exp_02,50,30,26
exp_03,60,50,34
exp_04,50,30,26
exp_05,55,40,29.6
"""


class Study:
    """A directory with a study, and Snakemake in it."""

    def __init__(self, directory, package=CLONE / "src"):
        self.directory, self.clone = directory, CLONE
        told = ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")  # by a make that runs the tests
        inherited = {name: value for name, value in os.environ.items() if name not in told}
        self.environment = {**inherited, "PYTHONPATH": str(package)}

    def snakemake(self, *options):
        """Run Snakemake; return the completed process with its output as text."""
        process = self.start_snakemake(*options)
        output, _ = process.communicate()
        return subprocess.CompletedProcess(process.args, process.returncode, output)

    def start_snakemake(self, *options):
        """Start Snakemake; return the process, of a group of its own."""
        return self.start([sys.executable, "-m", "snakemake", *self._options, *options])

    def ask(self, *options, **python):
        """What Snakemake answers where nothing is to run, or where forks do; as `snakemake`, and cheaper."""
        with tempfile.NamedTemporaryFile() as output:
            options = [*self._options, *options]
            return snakemake_in_fork(options, self.directory, self.environment, output.name, **python)

    @property
    def _options(self):
        return ["--snakefile", self.clone / "Snakefile", "--directory", self.directory, "--cores", "2"]

    def start(self, command):
        """Start a command; return the process, of a group of its own, with its output as text."""
        return subprocess.Popen(
            command,
            env=self.environment,
            cwd=self.directory,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def jobs(self, *options):
        """(rule, paths of its outputs) of each job that a dry run plans."""
        answer = self.ask("--dry-run", *options)
        assert answer.returncode == 0, answer.stdout
        job = r"^(?:local)?rule (\w+):\n(?:    .*\n)*?    output: (.*)\n"
        found = re.findall(job, answer.stdout, re.MULTILINE)
        return [(rule, outputs.split(", ")) for rule, outputs in found]

    def planned(self, *options):
        """Names of the jobs that a dry run plans: the rule, for a simulation its run as well."""
        return {
            f"{rule} {Path(outputs[0]).stem}" if rule in SIMULATIONS else rule
            for rule, outputs in self.jobs(*options)
        }

    def edit(self, name, old, new):
        """Replace text that stands once in a file of the study."""
        _replace(self.directory / name, old, new)

    def edit_code(self, name, old, new):
        """Replace text that stands once in a file of the clone; of a copy of it, from here on."""
        self._own_clone()
        _replace(self.clone / name, old, new)

    def add_code(self, module, text):
        """Add text to the end of a module of the package."""
        self._own_clone()
        with (self.clone / "src" / "hopperopt" / module).open("a") as file:
            file.write(text)

    def _own_clone(self):
        if self.clone != CLONE:
            return
        self.clone = self.directory.parent / "clone"
        for name in ("workflow", "profiles", "src"):
            shutil.copytree(CLONE / name, self.clone / name)
        shutil.copy(CLONE / "Snakefile", self.clone)
        self.environment["PYTHONPATH"] = str(self.clone / "src")

    def pretend(self):
        """Make every file of the study without computing anything, and have Snakemake take them for done."""
        for _, outputs in self.jobs():
            for path in outputs:
                (self.directory / path).parent.mkdir(parents=True, exist_ok=True)
                (self.directory / path).write_text(path)
        answer = self.ask("--touch", "--forceall")
        assert answer.returncode == 0, answer.stdout


def _replace(path, old, new):
    text = path.read_text()
    assert text.count(old) == 1, f"{old!r} is {text.count(old)} times in {path}"
    path.write_text(text.replace(old, new))


@pytest.fixture(scope="session")
def new_study():
    """Function that makes a study of a directory and the texts of its files, config.yaml first."""

    def make(directory, config, **files):
        directory.mkdir(exist_ok=True)
        (directory / "config.yaml").write_text(config)
        for name, text in files.items():
            (directory / f"{name}.csv").write_text(text)
        return Study(directory)

    return make


@pytest.fixture(scope="session")
def finished(tmp_path_factory, worker_id, new_study):
    """The tiny study after its one run, which parallel processes of pytest share; not to be changed."""
    shared = tmp_path_factory.getbasetemp()
    if worker_id != "master":
        shared = shared.parent
    with (shared / "study.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if (shared / "study.complete").exists():
            return Study(shared / "study")
        shutil.rmtree(shared / "study", ignore_errors=True)
        study = new_study(shared / "study", CONFIG, plan=PLAN)
        answer = study.ask(python=forked_python(tmp_path_factory.mktemp("python")))
        assert answer.returncode == 0, answer.stdout
        (shared / "study.complete").touch()
        return study


@pytest.fixture
def study(finished, tmp_path):
    """A copy of the finished study."""
    shutil.copytree(finished.directory, tmp_path / "study")
    return Study(tmp_path / "study")
