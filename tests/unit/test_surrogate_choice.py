"""Which surrogate is chosen, in constructed cases; and that the study goes on with it."""

import numpy as np
import pytest
import xarray as xr

from hopperopt import config, files
from hopperopt.outflow import GRID
from hopperopt.surrogate import choice, gaussian, prediction
from hopperopt.surrogate.network import Ensemble, Network, Scaling

PARAMS = {"hidden_nodes": [2], "selected_hidden_nodes": 2, "starts": 1, "seed": 1}


def errors(rng=None, **rms):
    """Squared errors (25, 2) with the given rms errors; random ones with rng, else all alike."""
    shape = np.ones((25, 2)) if rng is None else rng.chisquare(1, (25, 2))
    return {name: np.square(value) * shape for name, value in rms.items()}


def test_the_smallest_sum_of_relative_errors_wins():
    """The objectives count relative to their baselines: a gain in the smaller one is not drowned."""
    found = errors(
        mean_objective=[0.001, 0.01],
        gaussian=[0.0009, 0.0099],
        ensemble=[0.0005, 0.0101],
        network=[0.001, 0.007],
    )
    assert choice.best(found) == "ensemble"


def test_within_a_standard_error_the_simpler_wins():
    rng = np.random.default_rng(0)
    common = rng.chisquare(1, (25, 2))
    base = {"mean_objective": 4 * common}
    gaussian_errors, noisy = 1.01 * common, common * np.exp(rng.normal(0, 0.3, (25, 2)))
    assert choice.best(base | {"gaussian": gaussian_errors, "network": noisy}) == "gaussian"
    # The errors go together: the same small difference is told when it is there in every experiment.
    assert choice.best(base | {"gaussian": 1.1 * common, "network": common}) == "network"


def test_an_objective_that_no_candidate_predicts_is_named():
    rng = np.random.default_rng(1)
    found = errors(rng, mean_objective=[0.01, 0.01]) | errors(rng, gaussian=[0.002, 0.0101])
    assert choice.undetectable(found) == ["intermediate"]
    assert choice.undetectable(errors(mean_objective=[1, 1], gaussian=[1, 1])) == ["fine", "intermediate"]


@pytest.fixture
def chosen(synthetic, tmp_path):
    """Function that runs the stage; auto sees the comparison in which `favoured` errs least."""
    data = synthetic.training(1)
    network = Network(
        np.zeros((1, 5)),
        np.zeros((2, 2)),
        Scaling(np.zeros(4), np.ones(4)),
        Scaling(synthetic.batch, np.ones(2)),
    )
    single = prediction.Predictor(
        tuple(synthetic.factors), GRID, synthetic.batch, Ensemble((network,)), np.array([0.001, 0.002])
    )
    prediction.save(tmp_path / "network.nc", single, {}, {"hidden_nodes": 1})

    def run(model, favoured=(), clip_sigma=3.0, J=0.01):
        files.write_netcdf(data.assign_attrs(clip_sigma=clip_sigma), tmp_path / "training.nc")
        names = ["mean_objective", *choice.CANDIDATES]
        good = np.array([0.3 if name in favoured else 1.0 for name in names])
        wrong = J * good[:, None, None] * np.random.default_rng(0).normal(size=(25, 2))
        compared = {"J": (("surrogate", "experiment", "output"), wrong)}
        compared["simulated_J"] = (("experiment", "output"), np.zeros((25, 2)))
        files.write_netcdf(xr.Dataset(compared, {"surrogate": names}), tmp_path / "validation.nc")
        validation = [tmp_path / "validation.nc"] if model == "auto" else []
        networks = [] if model == "gaussian" else [tmp_path / "network.nc"]
        paths = tmp_path / "training.nc", networks, validation, tmp_path / "model.nc"
        choice.choose(PARAMS | {"model": model}, *paths)
        return prediction.load(paths[-1]), files.read_netcdf(paths[-1]).attrs

    return run


@pytest.mark.parametrize("name", choice.CANDIDATES)
def test_auto_fits_the_surrogate_that_it_chose(chosen, name, caplog):
    predictor, attributes = chosen("auto", [name])
    assert (attributes["surrogate"], attributes["chosen"]) == (name, "compared")
    if name == "gaussian":
        assert isinstance(predictor.model, gaussian.Gaussian)
    else:
        assert len(predictor.model.members) == (5 if name.startswith("ensemble") else 1)
    assert ("hidden_nodes" in attributes) == (name == "network_clipped")
    assert (predictor.objective_error > 0).all()
    if name == "network":  # as far off as in the comparison: 0.3 of 0.01
        np.testing.assert_allclose(predictor.objective_error, 0.003, rtol=0.3)
    assert "detectable" not in caplog.text


def test_auto_says_where_there_is_nothing_to_predict(chosen, caplog):
    _, attributes = chosen("auto")
    assert attributes["surrogate"] == "gaussian"
    for name in ("fine", "intermediate"):
        assert (
            f"no effect of the design is detectable in the objective of the {name} particles" in caplog.text
        )


def test_a_named_surrogate_needs_no_comparison(chosen):
    for model, clip, name in (
        ("paper", 3.0, "network_clipped"),
        ("network", np.inf, "network"),
        ("ensemble", 3.0, "ensemble_clipped"),
        ("gaussian", 3.0, "gaussian"),
    ):
        _, attributes = chosen(model, clip_sigma=clip)
        assert (attributes["surrogate"], attributes["chosen"]) == (name, "given")


def test_the_papers_choice_is_one_word():
    study = config.parse({"surrogate": {"model": "paper", "hidden_nodes": [3, 5], "clip_sigma": None}})
    for stage in ("train", "validate_fold", "choose"):
        settings = study.stage_params(stage)
        assert (settings["hidden_nodes"], settings["selected_hidden_nodes"]) == ([3, 5, 7], 7)
    assert study.stage_params("filter")["clip_sigma"] == 3
    assert config.parse({}).stage_params("choose")["model"] == "auto"
