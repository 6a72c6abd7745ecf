"""A tiny study, run once; its copies are changed in one thing and asked what would run again."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CLONE = Path(__file__).resolve().parents[2]
SIMULATIONS = ("simulate", "verify_simulate")
CONFIG = """\
filling: {particles: 60}
design: {plan: csv}
surrogate:
  hidden_nodes: [2, 3]
  selected_hidden_nodes: 2
  starts: 2
  validation_experiments: 1
  test_experiments: 1
optimise: {population: 8, generations: 3}
verification:
  cases: {selected: selected, plan_centre: plan_centre, bare: bare}
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
        self.directory, self.package = directory, package
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
        program = [sys.executable, "-m", "snakemake", "--snakefile", CLONE / "Snakefile"]
        return self.start([*program, "--directory", self.directory, "--cores", "2", *options])

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

    def planned(self, *options):
        """Names of the jobs that a dry run plans: the rule, for a simulation its run as well."""
        answer = self.snakemake("--dry-run", *options)
        assert answer.returncode == 0, answer.stdout
        jobs = re.findall(r"^(?:local)?rule (\w+):\n((?:    .*\n)*)", answer.stdout, re.MULTILINE)
        outputs = [(rule, re.search(r"output: \S*/(\S+)\.nc", block)) for rule, block in jobs]
        return {f"{rule} {found[1]}" if rule in SIMULATIONS else rule for rule, found in outputs} - {"all"}

    def edit(self, name, old, new):
        """Replace text that stands once in a file of the study."""
        path = self.directory / name
        text = path.read_text()
        assert text.count(old) == 1, f"{old!r} is {text.count(old)} times in {path}"
        path.write_text(text.replace(old, new))


@pytest.fixture(scope="session")
def new_study():
    """Function that makes a study of a directory and the text of its configuration, or of edited code."""

    def make(directory, config, additions=None):
        (directory / "config.yaml").write_text(config)
        package = CLONE / "src" if additions is None else copied_package(directory / "src", additions)
        return Study(directory, package)

    return make


@pytest.fixture(scope="session")
def finished(tmp_path_factory, new_study):
    """The tiny study after its one run; not to be changed."""
    directory = tmp_path_factory.mktemp("study")
    (directory / "plan.csv").write_text(PLAN)
    study = new_study(directory, CONFIG)
    answer = study.snakemake()
    assert answer.returncode == 0, answer.stdout
    return study


@pytest.fixture
def study(finished, tmp_path):
    """A copy of the finished study."""
    shutil.copytree(finished.directory, tmp_path / "study")
    return Study(tmp_path / "study")


@pytest.fixture
def edited(study, tmp_path):
    """Function that returns the copied study with a copy of the package; text is added to its modules."""

    def edit(additions):
        return Study(study.directory, copied_package(tmp_path / "src", additions))

    return edit


def copied_package(folder, additions):
    """Copy the package and add text to the ends of modules; return the copy's folder."""
    shutil.copytree(CLONE / "src" / "hopperopt", folder / "hopperopt")
    for module, text in additions.items():
        with (folder / "hopperopt" / module).open("a") as file:
            file.write(text)
    return folder
