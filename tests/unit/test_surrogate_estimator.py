"""The scikit-learn front of the networks."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GroupKFold, cross_val_score
from sklearn.utils.estimator_checks import check_estimator

from hopperopt.surrogate.estimator import NetworkRegressor


def data(groups=12, points=15, noise=0.05, seed=0):
    """Smooth curves of one variable for each group's own second variable."""
    rng = np.random.default_rng(seed)
    x = np.column_stack([np.tile(np.linspace(0, 1, points), groups), np.repeat(rng.random(groups), points)])
    y = np.column_stack([np.sin(4 * x[:, 0]) * x[:, 1], 100 + 10 * x[:, 0] ** 2])
    return x, y + noise * rng.normal(size=y.shape) * [1, 10], np.repeat(np.arange(groups), points)


# scikit-learn checks an optional interface only on request, and says so in a warning.
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_it_is_a_scikit_learn_estimator():
    check_estimator(NetworkRegressor(starts=5))


def test_same_seed_same_network_to_the_bit():
    x, y, groups = data()
    fits = [NetworkRegressor(5, 10, random_state=s).fit(x, y, groups=groups) for s in (7, 7, 8)]
    predictions = [fit.predict(x).tobytes() for fit in fits]
    assert predictions[0] == predictions[1] != predictions[2]


def test_more_starts_leave_the_first_ones_alone():
    x, y, groups = data()
    few = NetworkRegressor(5, 4, random_state=7).fit(x, y, groups=groups)
    many = NetworkRegressor(5, 12, random_state=7).fit(x, y, groups=groups)
    np.testing.assert_array_equal(few.validation_errors_, many.validation_errors_[:4])
    assert many.validation_errors_[many.start_] == many.validation_errors_.min()


def test_validation_data_alone_choose_stop_and_start():
    """A validation set that contradicts the training data must be seen in the choice."""
    x, y, _ = data()
    usual = NetworkRegressor(5, 10, random_state=1).fit(x, y, validation=(x, y))
    contrary = NetworkRegressor(5, 10, random_state=1).fit(x, y, validation=(x, 2 * y.mean(axis=0) - y))
    assert contrary.epochs_.max() < usual.epochs_[usual.start_]
    assert contrary.training_errors_[contrary.start_] > 2 * usual.training_errors_[usual.start_]


def test_groups_are_set_aside_whole(monkeypatch):
    x, y, groups = data()
    seen = {}

    def record(self, X, y, validation, entropy):
        seen.update(training=set(X[:, 1]), validation=set(validation[0][:, 1]))

    monkeypatch.setattr(NetworkRegressor, "_train", record)
    NetworkRegressor(random_state=3).fit(x, y, groups=groups)
    assert not seen["training"] & seen["validation"]
    assert (len(seen["training"]), len(seen["validation"])) == (10, 2)


def test_it_learns_and_works_in_scikit_learns_tools():
    x, y, groups = data(noise=0.01)
    scores = cross_val_score(
        clone(NetworkRegressor(5, 10, random_state=1)), x, y, groups=groups, cv=GroupKFold(4)
    )
    assert scores.min() > 0.9


def test_outputs_of_any_scale_count_equally():
    x, y, groups = data(noise=0)
    predictions = [
        NetworkRegressor(4, 5, random_state=1).fit(x, y * scale, groups=groups).predict(x) / scale
        for scale in (np.array([1.0, 1.0]), np.array([1024.0, 1.0]))
    ]
    np.testing.assert_allclose(*predictions, rtol=1e-4, atol=1e-4)


def test_validation_of_another_shape_is_refused():
    x, y, _ = data()
    with pytest.raises(ValueError, match="do not fit 2 inputs and 2 outputs"):
        NetworkRegressor(starts=1).fit(x, y, validation=(x, y[:, 0]))
