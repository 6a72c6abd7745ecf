"""The same configuration and seed give the same data, whatever the machine is asked to do it with."""

import shutil

import pytest

from hopperopt import files

pytestmark = pytest.mark.slow

# What is recorded of machine and moment.
RECORDED = {"git", "host", "versions", "created", "history", "wall_time_s", "particle_steps_per_s"}
SUFFIXES = ("nc", "csv", "yaml", "png", "pdf")
SURROUNDINGS = {
    "PYTHONHASHSEED": "12345",
    "TZ": "Pacific/Auckland",
    # Plain ASCII, which Python would otherwise replace by UTF-8.
    "LC_ALL": "C",
    "PYTHONCOERCECLOCALE": "0",
    "PYTHONUTF8": "0",
}


def data(path):
    """All that a file of the study holds but what is recorded of machine and moment."""
    if path.suffix != ".nc":
        return path.read_bytes()
    content = files.read_netcdf(path)
    content.attrs = {name: value for name, value in content.attrs.items() if name not in RECORDED}
    return content


def differing(results, others):
    """Names of the files of a study that another does not hold in the same way."""
    paths = [path for suffix in SUFFIXES for path in results.rglob(f"*.{suffix}")]
    assert len(paths) == 53
    return [
        str(path.relative_to(results))
        for path in paths
        if not same(data(path), data(others / path.relative_to(results)))
    ]


def same(one, other):
    """Equal to the bit, missing numbers in the same places."""
    return one == other if isinstance(one, bytes) else one.identical(other)


RUN_TO_NETWORK = ["--forcerun", "results/simulations/exp_01_rep_1.nc", "--", "results/surrogate/network.nc"]


@pytest.mark.parametrize(
    "again",
    [
        pytest.param(RUN_TO_NETWORK, id="a run with what follows up to the networks"),
        pytest.param(["--forceall"], id="everything", marks=pytest.mark.full),
    ],
)
def test_other_surroundings_change_no_bit(finished, tmp_path, again):
    """On one core, in a folder with a space, with another order of sets, time zone and locale."""
    folder = tmp_path / "another place"
    shutil.copytree(finished.directory, folder)
    study = type(finished)(folder)
    study.environment |= SURROUNDINGS
    answer = study.snakemake("--cores", "1", *again)
    assert answer.returncode == 0, answer.stdout
    before, after = (place / "results" for place in (finished.directory, folder))
    assert newer(before / "surrogate" / "network.nc", after / "surrogate" / "network.nc")
    assert differing(before, after) == []


def newer(one, other):
    """Whether the other file was written after the one."""
    return one.stat().st_mtime < other.stat().st_mtime
