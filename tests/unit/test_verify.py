"""The verification says what was predicted, what was simulated, and what can be told from the bare hopper."""

import json

import numpy as np
import pandas as pd
import pytest

from hopperopt import files, outflow, verify
from hopperopt.surrogate import gaussian, prediction
from hopperopt.surrogate.network import Ensemble, Network, Scaling
from hopperopt.verdict import COLUMNS

CENTRE = {"theta_deg": 55.0, "length_mm": 40.0}
PARAMS = {
    "cases": [["selected", "selected"], ["plan_best", "plan_best"], ["bare", "bare"]],
    "incomplete": "refuse",
    "seed": 1,
}
DESIGNS = pd.DataFrame(
    {
        "experiment": ["exp_02", "exp_01"],
        "theta_deg": [55.0, 60.0],
        "length_mm": [40.0, 50.0],
        **{
            f"{name}{end}": [0.001, 0.1] for name in ("fine", "intermediate") for end in ("", "_low", "_high")
        },
        "rank": [1, 2],
    }
)


@pytest.fixture
def study(tmp_path, make_run):
    """A network that predicts m_f 0.01 and m_i 0.02 above the batch everywhere, and a run of each case."""
    batch = np.array([8, 27]) / 99
    network = Network(
        np.zeros((1, 4)), np.zeros((2, 2)), Scaling(np.zeros(3), np.ones(3)), Scaling(batch, np.ones(2))
    )
    network.output[:, 1] = [0.01, 0.02]
    predictor = prediction.Predictor(tuple(CENTRE), outflow.GRID, batch, Ensemble((network,)))
    prediction.save(tmp_path / "network.nc", predictor, {}, {})
    files.write_table(DESIGNS, tmp_path / "designs.csv")
    for seed, (case, design) in enumerate({"selected": CENTRE, "plan_best": CENTRE, "bare": {}}.items()):
        save_run(tmp_path, make_run(seed=seed), case, design)
    return tmp_path


def save_run(folder, run, case, design, replicate=1):
    run.attrs["case"] = json.dumps({"design": design})
    files.write_netcdf(run, folder / f"{case}_rep_{replicate}.nc")


def tables(study, **params):
    inputs = study.glob("*_rep_*.nc"), study / "network.nc", study / "designs.csv"
    verify.verify(PARAMS | params, *inputs, study / "verdict.csv", study / "glance.csv")
    return [
        files.read_table(study / f"{name}.csv").set_index(["case", "objective"])
        for name in ("verdict", "glance")
    ]


def with_error(study, error):
    """Give the network an error of its J."""
    predictor = prediction.load(study / "network.nc")._replace(objective_error=np.array(error))
    prediction.save(study / "network.nc", predictor, {}, {})


def test_the_verdict_has_a_row_per_case_and_objective(study):
    verdict, _ = tables(study)
    assert ["case", "objective", *verdict.columns] == list(COLUMNS)
    assert list(verdict.index) == [
        (case, name) for case, _ in PARAMS["cases"] for name in ("fine", "intermediate")
    ]
    assert verdict.loc["selected", "predicted"].tolist() == pytest.approx([0.01, 0.02])
    assert (verdict["n"] == 1).all()
    of_prediction, of_difference = ["predicted", "z"], ["diff_bare", "diff_low", "p_holm", "verdict"]
    assert verdict.loc["bare", of_prediction + of_difference].isna().all(axis=None)
    assert verdict.loc["selected", of_prediction + of_difference].notna().all(axis=None)
    assert verdict[["predicted_low", "predicted_high"]].isna().all(axis=None)
    # Well mixed outflows: no difference, and the raw J is noise that the corrected one has lost.
    assert set(verdict["verdict"].dropna()) == {"not distinguishable"}
    assert (verdict["raw_rms"] > verdict["simulated"]).all()
    assert ((verdict["low"] < 0) & (verdict["high"] > 0)).all()


def test_each_run_is_read_once(study, monkeypatch):
    read = []

    def counted(path, original=files.read_netcdf):
        read.append(path)
        return original(path)

    monkeypatch.setattr(files, "read_netcdf", counted)
    tables(study)
    assert sorted(read) == sorted(study.glob("*_rep_*.nc"))


def test_z_counts_the_errors_of_both(study):
    """Worse than predicted is positive; the network's error makes the same departure a smaller one."""
    alone, _ = tables(study)
    with_error(study, [0.02, 0.04])
    both, _ = tables(study)
    U = np.sign(alone["simulated"]) * alone["simulated"] ** 2
    off = U - alone["predicted"] ** 2
    assert (np.sign(alone["z"]) == np.sign(off))[alone["z"].notna()].all()
    variance = (off / alone["z"]) ** 2
    own = both["predicted"] ** 2 * 4 * np.array([0.02, 0.04] * 3) ** 2 + 2 * np.array([0.02, 0.04] * 3) ** 4
    np.testing.assert_allclose(both["z"], off / np.sqrt(variance + own), rtol=1e-6)
    assert (both.loc["selected", "predicted_low"] == 0).all()
    assert both.loc["selected", "predicted_high"].tolist() == pytest.approx(
        [0.01 + 1.645 * 0.02, 0.02 + 1.645 * 0.04], rel=1e-3
    )


def test_members_that_differ_are_the_error_of_a_prediction(study):
    """Two networks, one with the batch's fractions 0.01 and 0.02 above, one with three times that."""
    one = prediction.load(study / "network.nc")
    member = one.model.members[0]
    other = member._replace(output=3 * member.output)
    said = verify.predict(one._replace(model=Ensemble((member, other))), CENTRE, 1)
    np.testing.assert_allclose(said.low, [0.01, 0.02])
    np.testing.assert_allclose(said.high, [0.03, 0.06])
    np.testing.assert_allclose(said.J**2, [5e-4, 20e-4])
    np.testing.assert_allclose(said.squared.variance, [16e-8, 16 * 16e-8], rtol=0.02)
    alone = verify.predict(one._replace(objective_error=np.array([0.001, 0.002])), CENTRE, 1)
    np.testing.assert_allclose(alone.high - alone.low, 2 * 1.645 * np.array([0.001, 0.002]), rtol=1e-3)


def test_limits_of_the_processes_hold_nine_of_ten_true_objectives(synthetic):
    """Wider away from the plan's designs than on them, and right for both in the mean."""
    model = gaussian.fit(synthetic.training(3))
    predictor = prediction.Predictor(tuple(synthetic.factors), outflow.GRID, synthetic.batch, model)
    designs = synthetic.anywhere(40, np.random.default_rng(1))
    truth = outflow.objective(synthetic.curves(designs), synthetic.batch)
    said = [verify.predict(predictor, dict(zip(synthetic.factors, row, strict=True)), 1) for row in designs]
    low, high = (np.array([getattr(one, end) for one in said]) for end in ("low", "high"))
    assert 0.8 <= np.mean((low <= truth) & (truth <= high)) <= 0.98
    z = (truth**2 - [one.J**2 for one in said]) / np.sqrt([one.squared.variance for one in said])
    assert abs(z.mean()) < 0.4 and 0.6 < z.std() < 1.3


def test_more_runs_know_more(study, make_run):
    alone, _ = tables(study)
    for case, design in (("selected", CENTRE), ("bare", {})):
        for replicate in range(2, 9):
            save_run(study, make_run(seed=10 * replicate + len(case)), case, design, replicate)
    more, _ = tables(study)
    assert more["n"].tolist() == [8, 8, 1, 1, 8, 8]
    width = (alone["diff_high"] - alone["diff_low"]) / (more["diff_high"] - more["diff_low"])
    assert (width.loc["selected"] > 3).all()
    assert (more.loc["selected", "raw_rms"] < alone.loc["selected", "raw_rms"]).all()


def test_the_plans_own_estimate_stands_beside_the_fresh_one(study):
    with_error(study, [0.02, 0.04])
    verdict, glance = tables(study)
    assert glance.loc["plan_best", "J_in_plan"].tolist() == ["0.0010 (0.0010 to 0.0010)"] * 2
    assert glance.loc[["selected", "bare"], "J_in_plan"].isna().all()
    assert glance.loc[("plan_best", "fine"), "J_simulated"].startswith(
        f"{verdict.loc[('plan_best', 'fine'), 'simulated']:.4f} ("
    )
    assert glance.loc[("selected", "fine"), "J_predicted"] == "0.0100 (0.0000 to 0.0429)"
    assert list(glance.columns[:2]) == list(CENTRE) and glance.loc["selected", "length_mm"].tolist() == [
        40,
        40,
    ]
    assert (glance["discharge_time_s"] > 0).all()
    assert "would be told" in glance.loc[("selected", "fine"), "against_bare"]


def test_a_run_that_did_not_end_well_is_refused_or_left_empty(study, make_run):
    save_run(study, make_run(status="jammed", stayed=100), "selected", CENTRE)
    with pytest.raises(files.InputError, match="selected_rep_1: jammed"):
        tables(study)
    verdict, glance = tables(study, incomplete="drop")
    assert verdict.loc["selected", ["simulated", "raw_rms", "z", "verdict"]].isna().all(axis=None)
    assert verdict.loc["selected", "n"].tolist() == [0, 0]
    assert verdict.loc["selected", "predicted"].tolist() == pytest.approx([0.01, 0.02])
    assert verdict.loc["bare", "simulated"].notna().all()
    assert glance.loc["selected", ["J_simulated", "against_bare"]].isna().all(axis=None)


def test_without_a_bare_hopper_there_is_no_verdict(study):
    verdict, _ = tables(study, cases=PARAMS["cases"][:2])
    assert verdict[["diff_bare", "better_than_bare", "verdict"]].isna().all(axis=None)
    assert verdict["z"].notna().all()


def test_designs_are_found_where_the_study_writes_them(study):
    front = pd.DataFrame(
        {
            "theta_deg": [50, 51, 52],
            "length_mm": [30, 31, 32],
            "J_fine": [3, 1, 2],
            "J_intermediate": [2, 3, 1],
        }
    )
    files.write_table(front, study / "front.csv")
    files.write_yaml({"design": CENTRE}, study / "selected.yaml")
    found = {
        kind: verify.found_design(kind, study / place, list(CENTRE))
        for kind, place in (
            ("selected", "selected.yaml"),
            ("best_f", "front.csv"),
            ("best_i", "front.csv"),
            ("plan_best", "designs.csv"),
        )
    }
    assert found == {
        "selected": CENTRE,
        "best_f": {"theta_deg": 51, "length_mm": 31},
        "best_i": {"theta_deg": 52, "length_mm": 32},
        "plan_best": CENTRE,
    }
