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
