"""The optimiser on a fixed network, against a dense grid of the same network."""

import numpy as np
import pytest
from pymoo.indicators.hv import HV
from pymoo.indicators.igd_plus import IGDPlus

from hopperopt import files, optimise
from hopperopt.surrogate import prediction
from hopperopt.surrogate.features import factor_grid, violation
from hopperopt.surrogate.network import Ensemble, Network, Scaling

BATCH = np.array([8, 27]) / 99
RANGES = {"theta_deg": [50, 60], "length_mm": [30, 50], "height_mm": [26, 34]}
BOUNDS = np.array(list(RANGES.values()), dtype=float)
PARAMS = {
    "bounds": RANGES,
    "population": 100,
    "generations": 30,
    "crossover_probability": 0.9,
    "mutation_probability": 0.1,
    "seed": 1,
    "seeds": 1,
    "select": "knee",
    "explicit": {},
    "centre": {"theta_deg": 55, "length_mm": 40, "height_mm": 29.6},
}


def predictor(batch=BATCH):
    """A network with fixed weights whose curves swing around `batch`; a tenth of them is impossible."""
    rng = np.random.default_rng(4)
    hidden = np.column_stack([rng.uniform(-2, 2, (7, 4)), rng.uniform(-1, 1, 7)])
    output = 4 * rng.uniform(-1, 1, (2, 7))
    output = np.column_stack([output, -output.sum(axis=1) / 2])
    inputs = Scaling(np.append(BOUNDS.mean(axis=1), 0.5), np.append(np.ptp(BOUNDS, axis=1) / 2, 0.5))
    network = Network(hidden, output, inputs, Scaling(batch, np.array([0.03, 0.05])))
    return prediction.Predictor(tuple(RANGES), np.linspace(0, 1, 21), batch, Ensemble((network,)))


def grid_objectives(model, points=61):
    """Objectives of all grid designs, (n, 2), and which of them are possible, (n,)."""
    parts = np.array_split(factor_grid(BOUNDS, points), 40)
    objectives = np.concatenate([model.objectives(part) for part in parts])
    return objectives, np.concatenate([violation(model.curves(part)) <= 0 for part in parts])


def pareto(objectives):
    """Non-dominated points by rising first objective."""
    ordered = objectives[np.lexsort(objectives.T[::-1])]
    best = np.minimum.accumulate(ordered[:, 1])
    return ordered[np.append(True, best[1:] < best[:-1])]


@pytest.fixture(scope="module")
def grid():
    return grid_objectives(predictor())


@pytest.mark.parametrize("seed", range(5))
def test_front_is_the_dense_grids(grid, seed):
    objectives = grid[0][grid[1]]
    front, _ = optimise.search(predictor(), BOUNDS, PARAMS | {"seed": seed})
    truth = pareto(objectives)
    volume = HV(ref_point=np.quantile(objectives, 0.95, axis=0))
    assert 0.98 <= volume(front.objectives) / volume(truth) <= 1.02
    diagonal = np.linalg.norm(np.ptp(truth, axis=0))
    assert IGDPlus(truth)(front.objectives) / diagonal <= 0.02


def test_impossible_predictions_stay_off_the_front():
    """With next to no fines in the batch the curves that fit it best dip below zero."""
    model = predictor(batch=np.array([0.02, 27 / 99]))
    objectives, possible = grid_objectives(model, points=21)
    everything, allowed = pareto(objectives), pareto(objectives[possible])
    assert not {tuple(point) for point in everything} <= {tuple(point) for point in allowed}
    front, _ = optimise.search(model, BOUNDS, PARAMS)
    assert (violation(model.curves(front.designs)) <= 0).all()
    diagonal = np.linalg.norm(np.ptp(allowed, axis=0))
    assert IGDPlus(allowed)(front.objectives) / diagonal <= 0.02


def test_violation_knows_each_kind_of_impossible_prediction():
    possible = np.tile([[0.1], [0.3]], (4, 1, 21))
    curves = possible.copy()
    curves[1, 0, 5] = -0.01
    curves[2, 1, 20] = -0.02
    curves[3, :, 0] = 0.5, 0.53
    np.testing.assert_allclose(violation(curves), [-0.1, 0.01, 0.02, 0.03], atol=1e-12)


@pytest.fixture
def run(tmp_path):
    """Function that runs the stage and returns the table, the history and the selection."""

    def stage(model=None, **params):
        network, *outputs = (tmp_path / n for n in ("network.nc", "front.csv", "history.nc", "selected.yaml"))
        prediction.save(network, model or predictor(), {}, {})
        optimise.optimise(PARAMS | params, network, *outputs)
        return files.read_table(outputs[0]), files.read_netcdf(outputs[1]), files.read_yaml(outputs[2])

    return stage


def test_outputs_agree_with_each_other_and_with_the_network(run):
    table, history, selected = run()
    model = predictor()
    designs = table[list(RANGES)].to_numpy()
    np.testing.assert_allclose(table[["J_fine", "J_intermediate"]], model.objectives(designs), rtol=1e-8)
    assert table["feasible"].all()
    assert table["J_fine"].is_monotonic_increasing and table["J_intermediate"].is_monotonic_decreasing

    assert selected["rule"] == "knee" and selected["feasible"]
    chosen = table[table["selected"]]
    assert len(chosen) == 1
    np.testing.assert_allclose(chosen[list(RANGES)].iloc[0], list(selected["design"].values()), rtol=1e-8)
    predicted = model.objectives(model.array(selected["design"]))[0]
    assert list(selected["predicted"].values()) == predicted.tolist()
    assert selected["front_points"] == len(table)

    assert history["F"].shape == (1, 30, 100, 2)
    history = history.isel(search=0)
    np.testing.assert_allclose(history["F"][7], model.objectives(history["X"][7].values), rtol=1e-12)
    assert ((history["X"] >= BOUNDS[:, 0]) & (history["X"] <= BOUNDS[:, 1])).all()
    last = history.isel(generation=-1)
    possible = last["F"].values[last["G"].values[:, 0] <= 0]
    np.testing.assert_allclose(pareto(possible)[:, 0], np.unique(table["J_fine"]), rtol=1e-8)
    # The first generation is the random one, before any selection.
    volume = HV(ref_point=[0.1, 0.2])
    assert volume(history["F"][0].values) < volume(history["F"][-1].values)


def test_same_seed_same_result(run):
    first, second, third = (run(seed=seed, generations=10) for seed in (1, 1, 2))
    assert first[1].identical(second[1]) and first[2] == second[2]
    assert not first[1].equals(third[1])


def test_impossible_predictions_of_the_grid_are_counted(run, grid):
    counts = run()[2]["infeasible_grid_predictions"]
    curves = predictor().curves(factor_grid(BOUNDS, counts["points_per_factor"]))
    assert counts["designs"] == len(curves) == 21**3
    fine, intermediate = curves[:, 0], curves[:, 1]
    assert counts["m_f_below_0"] == (fine < 0).sum() > 0
    assert counts["m_i_below_0"] == (intermediate < 0).sum()
    assert counts["m_f_plus_m_i_above_1"] == (fine + intermediate > 1).sum()
    assert counts["infeasible_designs"] / counts["designs"] == pytest.approx(1 - grid[1].mean(), abs=0.02)


def test_explicit_design_is_taken_as_it_is(run):
    design = {"height_mm": 33.0, "theta_deg": 56.7, "length_mm": 32.4}
    table, _, selected = run(select="explicit", explicit=design)
    assert selected["design"] == design and selected["rule"] == "explicit"
    assert selected["beyond_bounds"] is None and selected["choice_over_draws"] is None
    assert not table["selected"].any()
    model = predictor()
    assert list(selected["predicted"].values()) == model.objectives(model.array(design))[0].tolist()


def test_front_shorter_than_the_networks_uncertainty_gives_the_compromise(run, caplog):
    usual = run(generations=10)[2]
    assert usual["rule"] == "knee"
    selected = run(model=predictor()._replace(objective_error=np.array([1.0, 1.0])), generations=10)[2]
    assert selected["rule"] == "compromise"
    assert "shorter than the predictions' uncertainty" in selected["warning"]
    assert selected["warning"] in caplog.text
    assert run(model=predictor()._replace(objective_error=np.array([1e-6, 1e-6])), generations=10)[2] == usual


def test_optimum_on_a_bound_is_warned_of_until_the_range_reaches_beyond(run, caplog):
    shut_in = run()[2]
    value = shut_in["design"]["theta_deg"]
    expected = f"theta_deg = {value:.5g} lies on the bound 50 of its range: the optimum may lie beyond"
    on_bound, outside = shut_in["warning"].split("; ")
    assert on_bound == expected
    assert shut_in["warning"] in caplog.text

    # What a range a fifth wider gives stands beside it, and is what a search there chooses.
    wide = RANGES | {"theta_deg": [48, 60]}
    beyond = shut_in["beyond_bounds"]
    assert beyond["ranges"] == wide and 48 <= beyond["design"]["theta_deg"] < 50
    there = run(bounds=wide)[2]
    assert {name: there[name] for name in ("design", "predicted", "rule")} | {"ranges": wide} == beyond
    assert (
        outside.startswith("an extrapolation")
        and f"theta_deg = {beyond['design']['theta_deg']:.4g}" in outside
    )

    wider = run(bounds=RANGES | {"theta_deg": [40, 60]})[2]
    assert 41 < wider["design"]["theta_deg"] < 49
    assert "theta_deg" not in wider["warning"].split(": ")[0]

    both = run(model=predictor()._replace(objective_error=np.array([1.0, 1.0])))[2]["warning"].split("; ")
    assert [part.split(" ", 1)[0] for part in both] == ["no", "theta_deg", "an"]


def test_fronts_of_several_searches_are_joined(run, grid):
    """Short searches, none of which finds the whole front."""
    table, history, selected = run(seeds=3, generations=6)
    fronts = [
        optimise.search(predictor(), BOUNDS, PARAMS | {"generations": 6, "seed": seed})[0]
        for seed in (1, 2, 3)
    ]
    points = np.concatenate([front.objectives for front in fronts])
    np.testing.assert_allclose(table[["J_fine", "J_intermediate"]], pareto(points), rtol=1e-8)
    assert history.sizes["search"] == 3
    shares = selected["hypervolume_of_each_search"]
    assert all(0.5 < share < 1 for share in shares)
    volume = HV(ref_point=points.max(axis=0) + 0.1 * np.ptp(points, axis=0))
    assert shares == pytest.approx([volume(front.objectives) / volume(points) for front in fronts])


def test_a_front_of_feasible_points_has_no_others(run):
    """A search that finds nothing possible adds nothing, were its objectives the best."""
    one = optimise.Front(np.ones((1, 3)), np.array([[0.1, 0.1]]), np.array([0.2]))
    other = optimise.Front(2 * np.ones((2, 3)), np.array([[0.3, 0.2], [0.2, 0.3]]), np.array([-0.1, -0.2]))
    assert optimise.merged([one, other]).objectives.tolist() == [[0.2, 0.3], [0.3, 0.2]]
    assert optimise.merged([one, one._replace(violation=np.array([0.1]))]).violation.tolist() == [0.1]
    assert optimise.agreement([one], one) == [None]


def test_nothing_possible_gives_the_least_impossible_and_says_so(run, caplog):
    table, _, selected = run(model=predictor(batch=np.array([-0.5, 0.3])), generations=3)
    assert len(table) == 1 and not table["feasible"].any()
    assert not selected["feasible"]
    assert "impossible mass fractions" in selected["warning"]
    assert selected["warning"] in caplog.text


def test_any_number_of_factors(run):
    """Four factors, the last without influence; and one alone."""
    four, one = (model.model.members[0] for model in (predictor(), predictor()))

    def with_factors(names, network, hidden, change):
        scaling = Scaling(*(change(part) for part in network.inputs_scaling))
        network = network._replace(hidden=hidden, inputs_scaling=scaling)
        return predictor()._replace(factors=names, model=Ensemble((network,)))

    hidden = np.insert(four.hidden, 3, 0, axis=1)
    four = with_factors((*RANGES, "outlet_mm"), four, hidden, lambda part: np.insert(part, 3, 1))
    table, history, selected = run(
        model=four, bounds=RANGES | {"outlet_mm": [20, 25]}, centre=PARAMS["centre"] | {"outlet_mm": 22.5}
    )
    assert history.sizes["factor"] == 4 and "outlet_mm" in table
    assert set(selected["design"]) == {*RANGES, "outlet_mm"}
    hidden = np.delete(one.hidden, [1, 2], axis=1)
    one = with_factors(("theta_deg",), one, hidden, lambda part: np.delete(part, [1, 2]))
    table, _, _ = run(model=one, bounds={"theta_deg": [50, 60]}, centre={"theta_deg": 55})
    assert list(table)[:3] == ["theta_deg", "J_fine", "J_intermediate"]
