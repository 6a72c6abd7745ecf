"""`python -m hopperopt status` knows the files of the workflow."""

import subprocess
import sys

import pytest

from hopperopt import cli

pytestmark = pytest.mark.slow


def status(study):
    command = [sys.executable, "-m", "hopperopt", "status"]
    return subprocess.check_output(command, cwd=study.directory, env=study.environment, text=True)


def test_of_a_finished_study_and_after_an_edit(study):
    assert status(study).splitlines()[-1] == "everything is done"
    study.edit("plan.csv", "exp_05,55,40,29.6", "exp_05,55,40,30")
    (study.directory / "results" / "figures" / "front.pdf").unlink()
    count = 2 * len(cli.FIGURES)
    text = status(study)
    assert f"figures {count - 1} of {count}" in text
    assert "4 of   5 done" in text and "1 of other settings, to be repeated" in text
