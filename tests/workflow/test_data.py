"""The data of a study as others find them: described, by the conventions, and easy to draw."""

import re
import shutil
import subprocess
import sys

import netCDF4
import numpy as np
import pytest

from hopperopt import provenance
from hopperopt.figures import movie

pytestmark = pytest.mark.slow

DOCS = provenance.PACKAGE.parents[1] / "docs"
DATASET, RUN = "dataset.nc", "simulations/exp_01_rep_1.nc"
SNAPSHOTS = {"snapshot_time", "position", "speed"}


def described(section):
    """The variables of a section of docs/data.md: {name: (dimensions, units)}."""
    text = (DOCS / "data.md").read_text(encoding="utf-8")
    body = re.search(rf"^## {section}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)[1]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) ?\| ", body, re.MULTILINE)
    return {name: (tuple(filter(None, dims.split(", "))), units) for name, dims, units in rows}


def stored(path):
    """What a file holds in the same form, flags without units."""
    with netCDF4.Dataset(path) as file:
        return {
            name: (variable.dimensions, getattr(variable, "units", ""))
            for name, variable in file.variables.items()
        }


def test_every_variable_of_the_data_set_is_on_the_page(finished):
    found = stored(finished.directory / "results" / DATASET)
    factors = ("theta_deg", "length_mm", "height_mm")
    assert {name: found[name] for name in found if name not in factors} == described("dataset.nc")


def test_every_variable_of_a_run_is_on_the_page(finished):
    found, page = stored(finished.directory / "results" / RUN), described("A run")
    scalars = {name: ((), units) for name, (_, units) in described("dataset.nc").items()}
    expected = page | {name: scalars[name] for name in found if name not in page}
    assert {name: row for name, row in expected.items() if name not in SNAPSHOTS} == found


@pytest.mark.parametrize("name", [DATASET, RUN])
def test_every_variable_says_what_it_is(finished, name):
    """Text needs no units, flags have their meanings instead."""
    with netCDF4.Dataset(finished.directory / "results" / name) as file:
        assert file.Conventions == "CF-1.11"
        assert file.title and file.history and file.source
        for variable in file.variables.values():
            assert variable.long_name
            if "flag_values" in variable.ncattrs():
                assert variable.flag_values.dtype == variable.dtype
                assert len(variable.flag_meanings.split()) == np.size(variable.flag_values)
            else:
                assert variable.dtype is str or variable.units


@pytest.mark.parametrize("name", [DATASET, RUN])
def test_the_cf_checker_finds_nothing(finished, tmp_path, name):
    """By the checker of IOOS, which the locked environment does not hold."""
    checker = shutil.which("compliance-checker")
    if checker is None:
        pytest.skip("compliance-checker is not installed (pip install compliance-checker)")
    path = finished.directory / "results" / name
    answer = subprocess.run([checker, "--test=cf:1.11", path], capture_output=True, text=True)
    assert "All tests passed!" in answer.stdout, answer.stdout


def test_the_example_draws_figure_3(finished, tmp_path):
    example = DOCS / "examples" / "figure3.py"
    command = [sys.executable, example, finished.directory / "results" / DATASET, tmp_path / "figure3.png"]
    subprocess.run(
        command, check=True, capture_output=True, env={**finished.environment, "MPLBACKEND": "agg"}
    )
    assert (tmp_path / "figure3.png").stat().st_size > 10_000
    assert len([line for line in example.read_text().splitlines() if line.strip()]) <= 24


def test_a_run_of_the_study_can_be_drawn(finished, tmp_path):
    stills = movie.write(finished.directory / "results" / RUN, tmp_path / "run", "height", "gif")
    # Its few particles fall so fast that no sample of the run sees the half of them.
    assert [path.name for path in stills] == ["run_opening.png"]
