"""`python -m hopperopt status` knows the files of the workflow."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow


def status(study):
    command = [sys.executable, "-m", "hopperopt", "status"]
    return subprocess.check_output(command, cwd=study.directory, env=study.environment, text=True)


def test_of_a_finished_study_and_after_an_edit(study):
    assert status(study).splitlines()[-1] == "everything is done"
    (study.directory / "results" / "figures" / "front.pdf").unlink()
    assert "figures 13 of 14" in status(study)
    study.edit("plan.csv", "exp_05,55,40,29.6", "exp_05,55,40,30")
    text = status(study)
    assert "4 of   5 done" in text and "1 of other settings, to be repeated" in text
