"""The data set holds every run at its place, and no run that did not end well."""

import csv
import json
import weakref

import numpy as np
import pandas as pd
import pytest

from hopperopt import dataset, design, files, indices

PLAN = pd.DataFrame(
    {
        "experiment": ["exp_01", "exp_02", "exp_100"],
        "theta_deg": [60.0, 57.5, 50.0],
        "length_mm": [20, 30, 40],
        "theta_deg_level": [1, 2, 5],
        "length_mm_level": [1, 2, 3],
    }
)
PARAMS = {"factors": ["theta_deg", "length_mm"], "incomplete": "refuse"}


@pytest.fixture
def study(tmp_path, make_run):
    """Three experiments of two replicates each, told apart by their discharge rate."""
    files.write_table(PLAN, tmp_path / "design.csv")
    for row, experiment in enumerate(PLAN["experiment"]):
        for replicate in (1, 2):
            run = make_run(seed=10 * row + replicate, discharge_rate=row + replicate / 10)
            files.write_netcdf(run, tmp_path / f"{experiment}_rep_{replicate}.nc")
    return tmp_path


def gather(study, designs=("design.csv",), **params):
    simulations = sorted(study.glob("*_rep_*.nc"), reverse=True)
    dataset.gather(
        PARAMS | params,
        [study / name for name in designs],
        simulations,
        study / "dataset.nc",
        study / "runs.csv",
        study / "designs.csv",
    )
    return files.read_netcdf(study / "dataset.nc")


def test_rounds_of_infill_follow_the_plan(study, make_run):
    proposed = PLAN.iloc[:1].assign(experiment="infill_1_1", theta_deg=52.25, chosen_as="selected")
    files.write_table(proposed, study / "proposals.csv")
    for replicate in (1, 2):
        files.write_netcdf(make_run(seed=replicate), study / f"infill_1_1_rep_{replicate}.nc")
    data = gather(study, designs=("design.csv", "proposals.csv"))
    assert list(data["experiment"].values) == [*PLAN["experiment"], "infill_1_1"]
    assert float(data.sel(experiment="infill_1_1")["theta_deg"]) == 52.25
    assert set(files.read_table(study / "designs.csv")["experiment"]) == set(data["experiment"].values)


def spoil(study, make_run, name, **changes):
    files.write_netcdf(make_run(**changes), study / name)


LEVELS = {"theta_deg": (60, 57.5, 55, 52.5, 50), "length_mm": (50, 45, 40, 35, 30)}


@pytest.mark.parametrize("plan", [design.l25(LEVELS), design.lhs(LEVELS, 4, 1)])
def test_table_of_the_plan(tmp_path, plan):
    params = {"factors": list(LEVELS), "experiments": [experiment._asdict() for experiment in plan]}
    dataset.write_plan(params, tmp_path / "design.csv")
    rows = list(csv.DictReader((tmp_path / "design.csv").open()))
    numbers = [f"{name}_level" for name in LEVELS]
    assert list(rows[0]) == ["experiment", *LEVELS, *numbers]
    for row, experiment in zip(rows, plan, strict=True):
        assert row["experiment"] == experiment.name
        assert {name: float(row[name]) for name in LEVELS} == experiment.design
        assert [row[name] for name in numbers] == [str(experiment.levels.get(name, "")) for name in LEVELS]


def test_runs_stand_at_their_experiment_and_replicate(study):
    data = gather(study)
    assert data["mass_fraction"].dims == ("experiment", "replicate", "size_class", "M")
    assert data["experiment"].values.tolist() == ["exp_01", "exp_02", "exp_100"]
    np.testing.assert_allclose(data["discharge_rate"], [[0.1, 0.2], [1.1, 1.2], [2.1, 2.2]])
    np.testing.assert_allclose(data["mass_fraction"].sum("size_class"), 1)
    assert data["length_mm"].sel(experiment="exp_02") == 30
    assert "theta_deg_level" not in data.variables
    assert not (data["J"] ** 2 < data["U"]).any()


def test_the_table_of_runs_has_the_indices_of_each_run(study):
    data, table = gather(study), files.read_table(study / "runs.csv").set_index(["experiment", "replicate"])
    run, row = data.sel(experiment="exp_02", replicate=1), table.loc[("exp_02", 1)]
    assert row["residence_order"] == pytest.approx(run["residence_order"].item())
    assert row["lacey_index_fine"] == pytest.approx(run["lacey_index"].sel(size_class="fine").item())
    U = run["U_by_mass"].sel(size_class="coarse").item()
    assert np.sign(row["J_by_mass_coarse"]) * row["J_by_mass_coarse"] ** 2 == pytest.approx(U)


def test_every_number_has_a_unit_and_a_name(study):
    data = gather(study)
    assert data.attrs["Conventions"].startswith("CF-")
    units = {name: data[name].attrs["units"] for name in ("theta_deg", "length_mm", "discharge_time", "M")}
    assert units == {"theta_deg": "degree", "length_mm": "mm", "discharge_time": "s", "M": "1"}
    assert np.allclose(data["target_fraction"], np.array([8, 27, 64]) / 99)


def test_runs_that_did_not_end_well_are_refused_by_name_and_reason(study, make_run):
    spoil(study, make_run, "exp_02_rep_2.nc", status="jammed", stayed=150)
    spoil(study, make_run, "exp_100_rep_1.nc", status="monitor", max_overlap=0.42)
    with pytest.raises(files.InputError) as error:
        gather(study)
    lines = str(error.value).splitlines()
    assert "exp_02_rep_2: jammed, 6.1% of the mass stayed inside" in lines
    assert any(line.startswith("exp_100_rep_1: monitor") and "0.42" in line for line in lines)
    assert len(lines) == 3
    assert not (study / "dataset.nc").exists()


def test_dropped_runs_are_nan_and_listed(study, make_run):
    spoil(study, make_run, "exp_02_rep_2.nc", status="jammed", stayed=150)
    data = gather(study, incomplete="drop")
    bad = data.sel(experiment="exp_02", replicate=2)
    assert all(
        bad[name].isnull().all()
        for name in ("mass_fraction", "J", "U", "discharge_time", *indices.LONG_NAMES)
    )
    assert bad["residual_count"] == 150 and bad["status"] == "jammed"
    assert int(data["J"].isnull().sum()) == 3
    assert "exp_02_rep_2" in data.attrs["dropped_runs"]
    table = files.read_table(study / "runs.csv")
    assert table.loc[table["status"] == "jammed", ["experiment", "replicate"]].values.tolist() == [
        ["exp_02", 2]
    ]


def test_a_residual_within_the_limit_is_a_data_point(study, make_run):
    spoil(study, make_run, "exp_01_rep_1.nc", stayed=2)
    data = gather(study)
    assert data["residual_count"].sel(experiment="exp_01", replicate=1) == 2
    assert data["mass_fraction"].notnull().all()


def test_beds_that_miss_their_level_are_named_in_one_warning(study, make_run, caplog):
    case = {"filling": {"level": 0.074}, "particles": {"diameters": [0.002, 0.003, 0.004]}}
    for name, level in (("exp_01", 0.0695), ("exp_02", 0.0701), ("exp_100", 0.080)):
        run = make_run(filling_level=level).assign_attrs(case=json.dumps(case))
        files.write_netcdf(run, study / f"{name}_rep_1.nc")
    gather(study)
    (record,) = caplog.records
    said = record.getMessage()
    assert (
        "by -4.5 to +6.0 mm in " in said and "exp_01" in said and "exp_100" in said and "exp_02" not in said
    )


def test_batches_of_other_composition_are_refused(study, make_run):
    run = make_run()
    files.write_netcdf(run.isel(particle=slice(1, None)), study / "exp_01_rep_1.nc")
    with pytest.raises(files.InputError, match="differ in composition"):
        gather(study)


def test_a_missing_run_is_named(study):
    (study / "exp_100_rep_2.nc").unlink()
    with pytest.raises(files.InputError, match="exp_100_rep_2"):
        gather(study)


def test_a_damaged_file_among_the_runs_is_named(study):
    path = study / "exp_02_rep_1.nc"
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(files.InputError, match=r"exp_02_rep_1\.nc: is damaged .* delete it"):
        gather(study)
    assert not (study / "dataset.nc").exists()


def test_a_file_that_is_no_run_is_named(study, make_run):
    files.write_netcdf(make_run().drop_vars(["status", "exit_time"]), study / "exp_02_rep_1.nc")
    with pytest.raises(files.InputError, match=r"exp_02_rep_1\.nc: is no run .* exit_time, status"):
        gather(study)


def test_no_more_than_a_few_runs_are_held_at_a_time(study, monkeypatch):
    """Thousands of runs would not fit: at any time nearly all that were read have been dropped."""
    read, held = [], []

    def watched(path, original=files.read_netcdf):
        run = original(path)
        if "exit_time" in run:
            held.append(sum(kept() is not None for kept in read))
            read.append(weakref.ref(run["exit_time"].values))
        return run

    monkeypatch.setattr(files, "read_netcdf", watched)
    gather(study)
    assert len(read) >= 6 and max(held) <= 2


def test_designs_are_ranked_by_what_is_left_without_noise(study, make_run):
    """exp_02 leaves its fine particles first, in exp_01 half of them; exp_100 is well mixed."""
    for experiment, share in (("exp_01", 0.5), ("exp_02", 1.0)):
        for replicate in (1, 2):
            run = make_run(seed=replicate)
            early = np.arange(200) < share * 200
            run["exit_time"][:200] = np.where(early, 0.3, 1.0) * run["exit_time"][:200]
            files.write_netcdf(run, study / f"{experiment}_rep_{replicate}.nc")
    data = gather(study)
    table = files.read_table(study / "designs.csv")
    assert table["experiment"].tolist() == ["exp_100", "exp_01", "exp_02"]
    assert table["rank"].tolist() == [1, 2, 3]
    assert table["length_mm"].tolist() == [40, 20, 30] and table["runs"].tolist() == [2, 2, 2]
    U = data["U_design"].sel(size_class="fine", experiment=table["experiment"].tolist()).values
    np.testing.assert_allclose(np.sign(table["fine"]) * table["fine"] ** 2, U, rtol=1e-6)
    assert table["fine"].between(table["fine_low"], table["fine_high"]).all()


def test_a_design_without_a_run_has_no_rank_and_a_plan_without_one_is_refused(study, make_run):
    for replicate in (1, 2):
        spoil(study, make_run, f"exp_02_rep_{replicate}.nc", status="jammed", stayed=150)
    data = gather(study, incomplete="drop")
    assert data["runs"].values.tolist() == [2, 0, 2]
    assert data["U_design"].sel(experiment="exp_02").isnull().all()
    table = files.read_table(study / "designs.csv")
    assert table["experiment"].tolist()[-1] == "exp_02" and np.isnan(table["rank"].iloc[-1])
    for experiment in ("exp_01", "exp_100"):
        for replicate in (1, 2):
            spoil(study, make_run, f"{experiment}_rep_{replicate}.nc", status="jammed", stayed=150)
    with pytest.raises(files.InputError, match="no experiment has a complete run"):
        gather(study, incomplete="drop")
