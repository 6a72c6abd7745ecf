"""Input of LIGGGHTS: the shapes of its walls, its spheres, and what is refused. tests/physics runs it."""

import copy
import json
import re

import numpy as np
import pytest

from hopperopt import cli, config, export, files, geometry

SMALL = {"filling": {"particles": 60}, "contact": {"rolling": "cdt"}}


@pytest.fixture(scope="module")
def case():
    """The case of a design with sixty spheres."""
    study = config.parse(SMALL)
    design = {"theta_deg": 55.0, "length_mm": 40.0, "height_mm": 29.6}
    return study.simulation_case(design, "by_hand", 1)


@pytest.fixture
def own(case):
    """The case, a test's own."""
    return copy.deepcopy(case)


def triangles(path):
    """Corners (n, 3, 3) m of a mesh's triangles."""
    corners = re.findall(r"vertex (\S+) (\S+) (\S+)", path.read_text())
    return np.array(corners, float).reshape(-1, 3, 3)


def atoms(path):
    """Diameters (n,), positions and velocities (n, 3) of the spheres' file."""
    text = path.read_text()
    rows = [np.loadtxt(part.strip().splitlines(), ndmin=2) for part in re.split("Atoms|Velocities", text)[1:]]
    return rows[0][:, 2], rows[0][:, 4:7], rows[1][:, 1:4]


def test_a_mesh_encloses_the_volume_of_its_body(own, tmp_path):
    export.write(own, tmp_path)
    a, b, c = np.moveaxis(triangles(tmp_path / "insert.stl"), 1, 0)
    volume = abs(np.sum(a * np.cross(b, c))) / 6.0
    assert volume == pytest.approx(geometry.solid_volume(np.array(own["walls"]["insert"]), np.inf), rel=1e-6)


@pytest.mark.parametrize("times", [1, 10])
def test_a_mesh_is_round_for_the_smallest_sphere(own, tmp_path, times):
    own["walls"]["hopper"] = [[times * r, z] for r, z in own["walls"]["hopper"]]
    own["walls"]["gate"][-1][0] *= times
    export.write(own, tmp_path)
    corners = triangles(tmp_path / "hopper.stl")
    radius = np.hypot(*np.moveaxis(corners[..., :2], -1, 0))
    wide = corners[(radius > 0.999 * radius.max()).all(axis=1)]  # of the cylinder
    middle = 0.5 * (wide + np.roll(wide, 1, axis=1))[..., :2]
    assert radius.max() - np.hypot(*np.moveaxis(middle, -1, 0)).min() <= 0.05 * 0.001


def test_the_spheres_are_those_of_the_column_or_the_bed(own, tmp_path):
    export.write(own, tmp_path / "column")
    diameter, position, velocity = atoms(tmp_path / "column" / "spheres.data")
    assert np.unique(diameter, return_counts=True)[1].tolist() == [20, 20, 20]
    assert position[:, 2].min() > own["filling"]["column_bottom"] and velocity[:, 2].mean() < -0.4
    bed = position - [0.0, 0.0, 0.01]
    export.write(own, tmp_path / "bed", bed)
    _, placed, still = atoms(tmp_path / "bed" / "spheres.data")
    assert np.allclose(placed, bed, atol=1e-9) and not still.any()


def test_a_wall_that_is_not_there_has_no_mesh(own, tmp_path):
    own["walls"]["insert"] = None
    export.write(own, tmp_path)
    assert not (tmp_path / "insert.stl").exists()
    assert "insert" not in (tmp_path / "in.hopper").read_text()


def test_a_rigid_wall_and_soft_spheres_are_numbers_that_are_meant(own, tmp_path):
    own["wall"]["shear_modulus"], own["particles"]["shear_modulus"] = np.inf, 1.0e6
    export.write(own, tmp_path)
    script = (tmp_path / "in.hopper").read_text()
    assert "inf" not in script
    assert "soft_particles yes\nhard_particles yes" in script


def test_a_restitution_that_liggghts_does_not_take_is_a_sentence(own, tmp_path):
    own["contact"]["wall"]["restitution"] = 0.05
    with pytest.raises(files.InputError, match=r"^contact.wall.restitution: 0.05 is not allowed; allowed: "):
        export.write(own, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_what_liggghts_knows_differently_is_said(own, tmp_path, caplog):
    export.write(own, tmp_path)
    assert caplog.text == ""
    own["contact"]["rolling"] = "edem"
    export.write(own, tmp_path)
    assert "LIGGGHTS does not know edem; cdt takes its place" in caplog.text


def test_a_design_or_a_run_is_exported_by_its_options(tmp_path, monkeypatch, capsys, case, make_run):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("filling: {particles: 60}\n")
    assert cli.main(["export", "--theta", "57.5", "--seed", "3", "--output", "peer"]) == 0
    assert "theta_deg 57.5" in (tmp_path / "peer" / "in.hopper").read_text()
    run = make_run(count=20)
    run = run.assign(position_half=run["position_opening"]).assign_attrs(case=json.dumps(case))
    files.write_netcdf(run, tmp_path / "run.nc")
    assert cli.main(["export", "--run", "run.nc", "--output", "bed"]) == 0
    assert np.allclose(atoms(tmp_path / "bed" / "spheres.data")[1], run["position_opening"])
    capsys.readouterr()
    assert cli.main(["export", "--run", "run.nc", "--theta", "50", "--output", "bed"]) == 2
    assert "--run goes without --theta" in capsys.readouterr().err
    run["position_opening"][0] = np.nan
    files.write_netcdf(run, tmp_path / "run.nc")
    assert cli.main(["export", "--run", "run.nc", "--output", "bed"]) == 2
    assert "run.nc: the simulation did not reach the opening" in capsys.readouterr().err
