"""The verification's table says what was predicted, what was simulated, and how much of it is noise."""

import json

import numpy as np
import pytest

from hopperopt import files, outflow, verify
from hopperopt.surrogate import prediction
from hopperopt.surrogate.network import Network, Scaling

CENTRE = {"theta_deg": 55.0, "length_mm": 40.0}
PARAMS = {"cases": ["selected", "bare"], "incomplete": "refuse"}


@pytest.fixture
def study(tmp_path, make_run):
    """A network that predicts m_f 0.01 and m_i 0.02 above the batch everywhere, and a run of each case."""
    batch = np.array([8, 27]) / 99
    network = Network(
        np.zeros((1, 4)), np.zeros((2, 2)), Scaling(np.zeros(3), np.ones(3)), Scaling(batch, np.ones(2))
    )
    network.output[:, 1] = [0.01, 0.02]
    predictor = prediction.Predictor(tuple(CENTRE), outflow.GRID, batch, network)
    prediction.save(tmp_path / "network.nc", predictor, {}, {})
    for case, design in {"selected": CENTRE, "bare": {}}.items():
        save_run(tmp_path, make_run(seed=1), case, design)
    return tmp_path


def save_run(folder, run, case, design, replicate=1):
    run.attrs["case"] = json.dumps({"design": design})
    files.write_netcdf(run, folder / f"{case}_rep_{replicate}.nc")


def table(study, **params):
    verify.verify(PARAMS | params, study.glob("*_rep_*.nc"), study / "network.nc", study / "summary.csv")
    return files.read_table(study / "summary.csv").set_index(["case", "objective"])


def test_prediction_stands_beside_simulation(study):
    summary = table(study)
    assert list(summary.index) == [(c, o) for c in ("selected", "bare") for o in ("fine", "intermediate")]
    assert summary.loc["selected", "predicted_J"].tolist() == pytest.approx([0.01, 0.02])
    assert summary.loc["selected", "length_mm"].tolist() == [40, 40]
    assert summary.loc["bare", ["predicted_J", "theta_deg"]].isna().all(axis=None)
    # A well mixed outflow: raw J is about its counting floor, little is left once that is taken off.
    ratio = summary["simulated_J_raw"] / summary["counting_floor"]
    assert ratio.between(0.6, 1.4).all()
    corrected = np.sign(summary["simulated_J_corrected"]) * summary["simulated_J_corrected"] ** 2
    expected = summary["simulated_J_raw"] ** 2 - summary["counting_floor"] ** 2
    np.testing.assert_allclose(corrected, expected, atol=1e-10)
    assert (summary["discharge_time_s"] > 0).all()


def test_replicates_enter_as_their_mean(study, make_run):
    alone = table(study)
    for replicate in (2, 3, 4):
        save_run(study, make_run(seed=replicate), "selected", CENTRE, replicate)
    summary = table(study)
    assert summary.loc["selected", "replicates"].tolist() == [4, 4]
    fewer = summary.loc["selected", "counting_floor"] / alone.loc["selected", "counting_floor"]
    np.testing.assert_allclose(fewer, 0.5, rtol=0.05)
    assert (summary.loc["selected", "simulated_J_raw"] < alone.loc["selected", "simulated_J_raw"]).all()


def test_a_run_that_did_not_end_well_is_refused_or_left_empty(study, make_run):
    save_run(study, make_run(status="jammed", stayed=100), "selected", CENTRE)
    with pytest.raises(files.InputError, match="selected_rep_1: jammed"):
        table(study)
    summary = table(study, incomplete="drop")
    assert summary.loc["selected", "simulated_J_raw"].isna().all()
    assert summary.loc["selected", "predicted_J"].tolist() == pytest.approx([0.01, 0.02])
    assert summary.loc["bare", "simulated_J_raw"].notna().all()
