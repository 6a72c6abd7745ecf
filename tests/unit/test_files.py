"""Files are whole or absent, and come back as they were written."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from hopperopt import files


def sample():
    return xr.Dataset(
        {
            "exit_time": ("particle", np.array([0.5, np.nan, 0.25]), {"units": "s"}),
            "size_class": ("particle", np.array([0, 2, 1], dtype=np.int8)),
            "position": (("particle", "xyz"), np.ones((3, 3), dtype=np.float32)),
            "status": "complete",
            "step_count": np.int64(2**40),
        },
        coords={"M": ("M", [0.0, 0.5])},
        attrs={"case": '{"shear_modulus": Infinity}'},
    )


def test_netcdf_comes_back_identical(tmp_path):
    files.write_netcdf(sample(), tmp_path / "new" / "run.nc")
    back = files.read_netcdf(tmp_path / "new" / "run.nc")
    xr.testing.assert_identical(back, sample())
    assert {name: back[name].dtype for name in back.data_vars if name != "status"} == {
        name: sample()[name].dtype for name in sample().data_vars if name != "status"
    }


def test_files_are_stamped_while_asked_for(tmp_path):
    with files.stamped({"host": "here"}):
        files.write_netcdf(sample(), tmp_path / "with.nc")
    files.write_netcdf(sample(), tmp_path / "without.nc")
    assert files.read_netcdf(tmp_path / "with.nc").attrs == sample().attrs | {"host": "here"}
    assert files.read_netcdf(tmp_path / "without.nc").attrs == sample().attrs


def test_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "run.nc"
    files.write_netcdf(sample(), path)
    before = path.read_bytes()
    with pytest.raises(RuntimeError), files.atomic(path) as temporary:
        temporary.write_text("half a file")
        raise RuntimeError
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_yaml_holds_plain_numbers_in_order(tmp_path):
    path = tmp_path / "selected.yaml"
    document = {
        "design": {"theta_deg": np.float64(55.0), "length_mm": 40},
        "warning": None,
        "grid": np.arange(2),
    }
    files.write_yaml(document, path)
    back = files.read_yaml(path)
    assert back == {"design": {"theta_deg": 55.0, "length_mm": 40}, "warning": None, "grid": [0, 1]}
    assert list(back) == list(document)
    assert "!!" not in path.read_text()


def test_table_has_no_index_and_keeps_empty_cells(tmp_path):
    path = tmp_path / "table.csv"
    files.write_table(
        pd.DataFrame({"case": ["bare", "selected"], "predicted_J": [np.nan, 0.0123456789]}), path
    )
    assert path.read_text() == "case,predicted_J\nbare,\nselected,0.0123456789\n"
    assert files.read_table(path)["predicted_J"].isna().tolist() == [True, False]


def _overwritten(whole):
    """The middle of a file lost, its length kept: metadata are whole, compressed arrays are not."""
    middle = len(whole) // 2
    return whole[:middle] + bytes(2000) + whole[middle + 2000 :]


@pytest.mark.parametrize(
    "damage",
    [lambda whole: b"", lambda whole: b"no netCDF", lambda whole: whole[: len(whole) // 2], _overwritten],
)
def test_damaged_netcdf_is_named_with_what_to_do(tmp_path, damage):
    path = tmp_path / "exp_03_rep_1.nc"
    noise = np.random.default_rng(0).random(10_000)
    files.write_netcdf(xr.Dataset({"exit_time": ("particle", noise)}), path)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(files.InputError) as refused:
        files.read_netcdf(path)
    said = str(refused.value)
    assert said.startswith(f"{path}: is damaged") and "delete it, and snakemake makes it anew" in said


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("front.csv", b""),
        ("front.csv", b"J_fine\n"),  # a heading alone
        ("front.csv", b"theta_deg,J_intermediate\n55,0.1\n"),
        ("front.csv", b"J_fine\n0.1,0.2\n0.1,0.2,0.3\n"),
        ("front.csv", b"J_fine\n\xff\xfe\n"),
        ("selected.yaml", b""),
        ("selected.yaml", b"design"),
        ("selected.yaml", b"rule: knee\n"),
        ("selected.yaml", b"design: {theta_deg: 55,"),
        ("selected.yaml", b"design: \xff\n"),
    ],
)
def test_damaged_table_or_yaml_is_named_with_what_to_do(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text)
    with pytest.raises(files.InputError) as refused:
        files.read_table(path, "J_fine") if name == "front.csv" else files.read_yaml(path, "design")
    said = str(refused.value)
    assert said.startswith(f"{path}: is damaged") and said.isprintable()
    assert "delete it, and snakemake makes it anew" in said


def test_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for path, place in (
        (tmp_path / "file" / "run.nc", "file"),
        (tmp_path / "file" / "deep" / "run.nc", "file"),
        (tmp_path, tmp_path.name),
        ("/proc/run.nc", "/proc"),  # read-only, also for root
    ):
        with pytest.raises(OSError, match=place):
            files.check_writable(path)
    files.check_writable(tmp_path / "new" / "run.nc")
    assert list((tmp_path / "new").iterdir()) == []
