"""The designs that rounds of infill propose, from Gaussian processes of curves of a known shape."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pymoo.indicators.hv import HV

from hopperopt import config, files, infill, outflow, verify
from hopperopt.surrogate import gaussian, prediction
from validation import infill as campaigns

CORNER = np.array([1.0, 2.0])
NOTHING = np.empty((0, 3))  # no design


@pytest.fixture(scope="module")
def model(synthetic):
    return gaussian.fit(synthetic.training(3))


@pytest.fixture(scope="module")
def predictor(synthetic, model):
    return prediction.Predictor(tuple(synthetic.factors), outflow.GRID, synthetic.batch, model)


@pytest.fixture(scope="module")
def bounds(synthetic):
    return np.column_stack([synthetic.designs.min(axis=0), synthetic.designs.max(axis=0)])


def anything(_design):
    return True


@pytest.mark.parametrize("number", [0, 1, 7])
def test_improvement_is_what_the_hypervolume_gains(number):
    rng = np.random.default_rng(number)
    incumbents = rng.uniform(0.2, 1.2, (number, 2)) * CORNER  # some of them beyond the corner
    points = rng.uniform(0, 1.1, (40, 2)) * CORNER
    volume = HV(ref_point=CORNER)
    before = float(volume(incumbents)) if number else 0.0
    gained = [float(volume(np.vstack([incumbents, point]))) - before for point in points]
    np.testing.assert_allclose(infill.improvement(points, incumbents, CORNER), gained, atol=1e-12)
    assert number == 0 or (np.array(gained) == 0).any()


def test_believed_runs_change_no_prediction_and_leave_less_to_be_learnt(predictor, synthetic):
    """Neither beyond the ranges of the plan, by which the processes scale their inputs."""
    designs = synthetic.anywhere(20, np.random.default_rng(0))
    for design in (np.array([51.0, 48.0, 33.0]), np.array([65.0, 52.0, 25.0])):
        believing = predictor.model.believing(design, 3)
        before, after = (one.moments(designs, outflow.GRID) for one in (predictor.model, believing))
        np.testing.assert_allclose(after[0], before[0], atol=1e-8)
        assert (after[1] <= before[1] + 1e-12).all()
        own = [one.moments(design[None], outflow.GRID)[1].sum() for one in (predictor.model, believing)]
        assert own[1] < 0.99 * own[0]
        assert believing.noise[-1] == pytest.approx(1 / 3) and len(believing.designs) == 26


def test_a_batch_holds_the_selected_design_and_others_apart_from_all(predictor, synthetic, bounds):
    corner = infill.CORNER * predictor.objectives(synthetic.designs).max(axis=0)
    candidates = np.vstack([[51.0, 44.0, 27.0], synthetic.anywhere(300, np.random.default_rng(1))])
    search = infill.Search(bounds, corner, 3, anything, NOTHING)
    chosen = infill.batch(predictor, candidates, 4, search, seed=1)
    assert [row.reason for row in chosen] == ["selected", *["improvement"] * 3]
    assert chosen[0].candidate == 0
    designs = candidates[[row.candidate for row in chosen]]
    for place in range(4):
        known = np.vstack([synthetic.designs, designs[:place]])
        assert infill.separation(designs[place][None], known, bounds) >= infill.APART
    # Of those, what is proposed first promises most.
    free = infill.separation(candidates, synthetic.designs, bounds) >= infill.APART
    gain = infill.expected_improvement(predictor, candidates, corner, np.random.default_rng(1))
    assert infill.batch(predictor, candidates[1:], 1, search, seed=1)[0].reason == "selected"
    near = np.vstack([synthetic.designs[3] + 0.01, candidates])  # was simulated
    first = infill.batch(predictor, near, 1, search, seed=1)[0]
    best = infill.expected_improvement(predictor, near, corner, np.random.default_rng(1))
    assert first.reason == "improvement" and first.improvement == pytest.approx(
        best[1:][free].max(), rel=1e-9
    )
    assert gain.max() > 0


def test_what_cannot_be_built_is_never_proposed(predictor, synthetic, bounds):
    candidates = synthetic.anywhere(60, np.random.default_rng(1))
    search = infill.Search(bounds, np.array([0.1, 0.1]), 3, lambda design: design[0] < 55, NOTHING)
    chosen = infill.batch(predictor, candidates, 4, search, seed=1)
    assert (candidates[[row.candidate for row in chosen], 0] < 55).all()
    with pytest.raises(files.InputError, match="only 0 can be built, a round needs 2"):
        infill.batch(predictor, candidates, 2, search._replace(can_be_built=lambda design: False), seed=1)


def test_the_expected_improvement_is_largest_where_the_true_one_is(predictor, synthetic):
    """Among many designs, those that it likes best gain more hypervolume, truly, than nine of ten."""
    designs = synthetic.anywhere(400, np.random.default_rng(2))
    corner = infill.CORNER * predictor.objectives(synthetic.designs).max(axis=0)
    expected = infill.expected_improvement(predictor, designs, corner, np.random.default_rng(0))
    incumbents = outflow.objective(synthetic.curves(synthetic.designs), synthetic.batch)
    true = infill.improvement(
        outflow.objective(synthetic.curves(designs), synthetic.batch), incumbents, corner
    )
    assert true[np.argsort(expected)[-10:]].mean() > np.quantile(true, 0.9)


@pytest.fixture
def propose(tmp_path, predictor, bounds):
    """Function that runs the stage; returns the path of the table."""
    names = predictor.factors
    prediction.save(tmp_path / "model.nc", predictor, {}, {})
    front = pd.DataFrame([[50.5, 45, 27], [51, 46, 28]], columns=list(names))
    front["selected"] = [False, True]
    files.write_table(front, tmp_path / "front.csv")

    def stage(before=(), **changes):
        params = {"round": 2, "replicates": 3, "seed": 1, "case_of": lambda design: {}}
        params["names"] = ["infill_2_1", "infill_2_2", "infill_2_3"]
        params["bounds"] = dict(zip(names, bounds.tolist(), strict=True))
        inputs = [tmp_path / name for name in ("model.nc", "model.nc", "front.csv")]
        infill.propose(params | changes, *inputs, before, tmp_path / "proposals.csv")
        return tmp_path / "proposals.csv"

    return stage


def test_the_table_names_each_design_and_a_simulation_finds_it_there(propose, predictor, bounds):
    table = pd.read_csv(propose())
    assert list(table["experiment"]) == ["infill_2_1", "infill_2_2", "infill_2_3"]
    assert list(table["chosen_as"]) == ["selected", "improvement", "improvement"]
    factors = list(predictor.factors)
    assert list(table.loc[0, factors]) == [51, 46, 28]
    J = table[["J_fine", "J_intermediate"]].to_numpy()
    np.testing.assert_allclose(J, predictor.objectives(table[factors].to_numpy()), rtol=1e-8)
    inside = (bounds[:, 0] <= table[factors]) & (table[factors] <= bounds[:, 1])
    assert inside.to_numpy().all()
    found = verify.found_design("infill_2_2", propose(), factors)
    assert found == table.loc[1, factors].to_dict()
    with pytest.raises(files.InputError, match="has no infill_2_9"):
        verify.found_design("infill_2_9", propose(), factors)


def test_what_was_proposed_before_is_not_proposed_again(propose, predictor, bounds, tmp_path):
    """Not even where all its runs jammed and were dropped, so that the surrogate knows nothing of it."""
    factors = list(predictor.factors)
    path = propose().rename(tmp_path / "earlier.csv")
    first, second = pd.read_csv(path), pd.read_csv(propose(before=[path]))
    assert first["chosen_as"][0] == "selected" and second["chosen_as"][0] != "selected"
    apart = infill.separation(second[factors].to_numpy(), first[factors].to_numpy(), bounds)
    assert (apart >= infill.APART).all()


def test_same_seed_same_proposals_and_another_round_others(propose):
    first, again, other = propose().read_text(), propose().read_text(), propose(round=3).read_text()
    assert first == again
    assert first.split(",")[8:] != other.split(",")[8:]


def test_the_shipped_race_has_as_many_designs_on_both_sides():
    root = Path(__file__).parents[2]

    def designs(name):
        study = config.parse(config.load([root / "config.yaml", root / f"config/{name}.yaml"]), root)
        return len(study.plan) + sum(map(len, study.proposals()))

    assert designs("infill") == designs("hypercube") == 33


@pytest.mark.full
def test_in_a_known_hopper_infill_sees_better_than_a_hypercube():
    """Of few campaigns only what is plain: the front that is reached, no better than the best there is."""
    known = campaigns.Truth.load()
    ends = [campaigns.campaign(known, seed) for seed in range(1, 7)]
    reached = {name: np.mean([end[name]["reached"] for end in ends]) for name in ("infill", "hypercube")}
    assert reached["hypercube"] < reached["infill"] < 1.01
    assert min(end["infill"]["score"] for end in ends) > known.least - 0.01
