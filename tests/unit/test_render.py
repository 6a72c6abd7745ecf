"""Movies, stills and files for ParaView of a run with snapshots, and of one without."""

import base64
import json
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from hopperopt import cli, dataset, files, moments
from hopperopt.figures import hopper, movie

CASE = {
    "walls": {
        "hopper": [[0.012, 0], [0.03, 0.018], [0.03, 0.2]],
        "gate": [[0, 0], [0.012, 0]],
        "insert": [[0, 0.02], [0.01, 0.02], [0, 0.03]],
    },
    "particles": {"diameters": [0.002, 0.003, 0.004]},
    "filling": {"level": 0.03},
    "discharge": {"sensor": -0.012},
    "design": {"theta_deg": 45.0},
}
TIMES = np.array([0.0, 0.3, 0.6, 1.0])


@pytest.fixture
def run(make_run):
    """90 particles that leave one after the other within a second."""
    run = make_run(30)
    rng = np.random.default_rng(2)
    position = np.stack([*rng.uniform(-0.02, 0.02, (2, 90)), rng.uniform(0.035, 0.06, 90)], axis=1)
    half = np.where(run["exit_time"].values[:, None] < 0.5, np.nan, position)
    run = run.assign(
        position_opening=(("particle", "xyz"), position.astype(np.float32)),
        position_half=(("particle", "xyz"), half.astype(np.float32)),
    )
    return run.assign_attrs(case=json.dumps(CASE), wall_time_s=1.0)


@pytest.fixture
def recorded(run):
    """The same with snapshots, in which the particles stand still until they leave."""
    inside = run["exit_time"].values > TIMES[:, None]
    position = np.where(inside[..., None], run["position_opening"].values, np.nan)
    speed = np.where(inside, np.linspace(0, 2, 90, dtype=np.float32), np.nan)
    return run.assign(
        position=(("snapshot", "particle", "xyz"), position), speed=(("snapshot", "particle"), speed)
    ).assign_coords(snapshot_time=("snapshot", TIMES))


@pytest.fixture
def render(tmp_path, monkeypatch):
    """Function that renders a run in a folder and returns the names of what was written."""
    monkeypatch.setattr(movie, "DPI", 40)

    def call(run, *options, status=0):
        files.write_netcdf(run, tmp_path / "run.nc")
        assert cli.main(["render", str(tmp_path / "run.nc"), *options]) == status
        return sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.name != "run.nc")

    return call


def test_a_movie_has_a_frame_for_each_snapshot(recorded, render, tmp_path, capsys):
    assert render(recorded) == ["run.gif", "run_half.png", "run_opening.png"]
    assert capsys.readouterr().out.splitlines()[0] == str(tmp_path / "run.gif")
    with Image.open(tmp_path / "run.gif") as image:
        assert image.n_frames == len(TIMES)
        first = np.asarray(image.convert("RGB"), float)
        image.seek(3)
        assert np.abs(np.asarray(image.convert("RGB"), float) - first).max() > 100


def test_without_snapshots_there_are_stills_and_what_to_do(run, render, caplog):
    assert render(run) == ["run_half.png", "run_opening.png"]
    assert (
        "holds no snapshots; for a movie, simulate it with `simulation: {snapshot_interval_s" in caplog.text
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--colour", "speed"], "holds no snapshots and so no speeds; for a movie"),
        (["--format", "mp4"], "ffmpeg is not found, which an MP4 takes: install it, or ask for --format gif"),
    ],
)
def test_what_cannot_be_drawn_is_a_sentence(run, render, capsys, monkeypatch, options, said):
    monkeypatch.setattr(movie.shutil, "which", lambda name: None)
    assert render(run, *options, status=2) == []
    assert said in capsys.readouterr().err


def test_another_file_is_refused(run, render, capsys):
    assert render(run.drop_vars("position_opening"), status=2) == []
    assert "is no run of a simulation" in capsys.readouterr().err


def test_a_run_that_never_half_discharged_has_one_still(run, render):
    assert render(run.assign(position_half=run["position_half"] * np.nan)) == ["run_opening.png"]


def drawn_colours(run, moment, colour, monkeypatch):
    """Colours that the particles of a moment are drawn with, (n, 3)."""
    given = []
    keep = hopper.draw_particles
    monkeypatch.setattr(hopper, "draw_particles", lambda *a: given.append(a[3]) or keep(*a))
    movie.draw(run, moment, colour)
    return given[-1]


def test_colours_tell_size_speed_or_height(recorded, monkeypatch):
    moment = moments.snapshots(recorded)[0]
    by_size = drawn_colours(recorded, moment, "size", monkeypatch)
    assert by_size[0] == pytest.approx(to_rgb(hopper.COLOURS["fine"]))
    assert len(np.unique(by_size, axis=0)) == 3

    # Both maps go from dark to bright; the speeds here rise with the particle's number.
    for colour, order in {"speed": np.arange(90), "height": np.argsort(moment.position[:, 2])}.items():
        bright = drawn_colours(recorded, moment, colour, monkeypatch)[order] @ [0.3, 0.6, 0.1]
        assert (np.diff(bright) >= -0.02).all() and np.ptp(bright) > 0.4


def test_a_moment_says_when_it_is_and_how_much_has_left(recorded):
    moment = moments.snapshots(recorded)[1]
    figure = movie.draw(recorded, moment, "size")
    mass = recorded["diameter"].values ** 3
    left = mass[recorded["exit_time"].values <= 0.3].sum() / mass.sum()
    assert figure.axes[0].get_title(loc="left") == f"$t$ = 0.30 s, $M$ = {left:.2f}"


def test_stills_of_a_run_with_snapshots_are_the_nearest_ones(recorded):
    stills = moments.stills(recorded)
    assert [stills[name].time for name in ("opening", "half")] == [0.0, 0.6]
    assert moments.half_time(recorded) == pytest.approx(0.5, abs=0.12)


def test_snapshots_are_left_out_where_runs_are_gathered(recorded, tmp_path):
    """All runs of a plan with them may be larger than the memory."""
    files.write_netcdf(recorded, tmp_path / "a_rep_1.nc")
    (run,) = dataset.read_runs([tmp_path / "a_rep_1.nc"]).values()
    assert "snapshot" not in run.dims and "exit_time" in run


def arrays(path):
    """Data arrays of a PolyData file by name."""
    kinds = {"Float32": np.float32, "Int32": np.int32, "Int8": np.int8}
    found = {}
    for node in ElementTree.parse(path).iter("DataArray"):
        data = base64.b64decode(node.text)
        assert np.frombuffer(data[:4], np.uint32)[0] == len(data) - 4
        values = np.frombuffer(data[4:], kinds[node.get("type")])
        found[node.get("Name")] = values.reshape(-1, int(node.get("NumberOfComponents", 1))).squeeze()
    return found


def test_paraview_gets_particles_and_walls_at_every_time(recorded, render, tmp_path):
    render(recorded, "--vtk")
    series = ElementTree.parse(tmp_path / "run.pvd").findall(".//DataSet")
    assert [float(node.get("timestep")) for node in series] == TIMES.repeat(3).tolist()
    assert all((tmp_path / node.get("file")).exists() for node in series)
    inside = recorded["exit_time"].values > 0.3
    found = arrays(tmp_path / series[3].get("file"))
    np.testing.assert_array_equal(found["number"], np.flatnonzero(inside))
    np.testing.assert_array_equal(found["Points"], recorded["position"][1, inside].astype(np.float32))
    np.testing.assert_array_equal(found["diameter"], recorded["diameter"][inside].astype(np.float32))
    np.testing.assert_array_equal(found["speed"], recorded["speed"][1, inside].astype(np.float32))
    np.testing.assert_array_equal(found["offsets"], np.arange(1, inside.sum() + 1))
    walls = arrays(tmp_path / series[4].get("file"))["Points"]
    assert np.hypot(*walls.T[:2]).max() == pytest.approx(0.03)
    assert walls[:, 2].min() == 0 and walls[:, 2].max() < 0.08
    insert = arrays(tmp_path / series[5].get("file"))["Points"]
    assert sorted({*insert[:, 2].round(6).tolist()}) == pytest.approx([0.02, 0.03])


def test_a_run_without_snapshots_has_its_two_moments_in_paraview(run, render, tmp_path):
    render(run.assign_attrs(case=json.dumps(CASE | {"walls": CASE["walls"] | {"insert": None}})), "--vtk")
    series = ElementTree.parse(tmp_path / "run.pvd").findall(".//DataSet")
    assert len({node.get("timestep") for node in series}) == 2 and len(series) == 4


def test_a_vtk_reader_reads_them(recorded, render, tmp_path):
    """By VTK itself, which the locked environment does not hold."""
    vtk = pytest.importorskip("vtk", reason="vtk is not installed (pip install vtk)")
    render(recorded, "--vtk")
    reader = vtk.vtkXMLPolyDataReader()

    def read(name):
        reader.SetFileName(str(tmp_path / "run_vtk" / name))
        reader.Update()
        return reader.GetOutput()

    particles = read("particles_0001.vtp")
    inside = np.flatnonzero(recorded["exit_time"].values > 0.3)
    assert particles.GetNumberOfPoints() == particles.GetNumberOfVerts() == len(inside)
    assert particles.GetPoint(4) == pytest.approx(recorded["position"].values[1, inside[4]])
    assert particles.GetPointData().GetArray("size_class").GetTuple1(4) == recorded["size_class"][inside[4]]
    walls = read("hopper.vtp")
    mass = vtk.vtkMassProperties()
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputData(read("insert.vtp"))
    mass.SetInputConnection(triangles.GetOutputPort())
    mass.Update()
    assert mass.GetVolume() == pytest.approx(np.pi / 3 * 0.01**2 * 0.01, rel=0.01)
    assert walls.GetNumberOfPolys() == 2 * 72
