"""What is exported runs in LIGGGHTS, and its bed and outflow are those of this solver."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from hopperopt import config, experiment, export
from validation import liggghts_runs

pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(
        shutil.which("liggghts") is None or shutil.which("mpirun") is None,
        reason="LIGGGHTS is not here (Debian: apt-get install --no-install-recommends liggghts)",
    ),
]
ROOT = Path(__file__).resolve().parents[2]
MPI = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-np"]


@pytest.fixture(scope="module")
def case():
    """900 spheres in the reduced study's hopper, with the rolling friction that both codes have."""
    document = config.load([ROOT / "config.yaml", ROOT / "config" / "ci.yaml"])
    document["filling"] |= {"particles": 900, "level_mm": 25}
    document["contact"]["rolling"] = "cdt"
    study = config.parse(document, ROOT)
    design = {"theta_deg": 55.0, "length_mm": 15.0, "height_mm": 24.0}
    return study.simulation_case(design, "by_hand", 1)


@pytest.fixture(scope="module")
def own(case):
    """This solver's run."""
    return experiment.run(case)


def height(position, diameter):
    """Height of the centre of mass, m."""
    return np.average(position[:, 2], weights=diameter**3)


@pytest.mark.parametrize(("processes", "start"), [(1, "column"), (2, "bed")])
def test_the_peer_fills_and_empties_the_same_hopper(case, own, tmp_path, processes, start):
    bed = own["position_opening"].values.astype(float)
    export.write(case, tmp_path, bed if start == "bed" else None)
    command = [*MPI, str(processes), "liggghts", "-in", export.SCRIPT, "-log", "none"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and "ERROR" not in done.stdout, done.stdout[-2000:]
    assert done.stdout.endswith("0 spheres are left.\n")
    position, radius = liggghts_runs.look_file(tmp_path / "opening.txt")
    parts = [liggghts_runs.outflow_file(path) for path in sorted(tmp_path.glob("outflow.txt*"))]
    assert len(parts) == processes
    exit_time, diameter = np.concatenate(parts, axis=1)
    assert np.array_equal(np.sort(diameter), np.sort(own["diameter"]))
    # The scatter between fillings is some 0.5 % and 2 %.
    expected = height(bed, own["diameter"].values)
    assert height(position, 2.0 * radius) == pytest.approx(expected, rel=0.02)
    assert np.median(exit_time) == pytest.approx(np.median(own["exit_time"]), rel=0.06)
    assert exit_time.max() == pytest.approx(float(own["discharge_time"]), rel=0.1)
