"""The surrogate's networks as a scikit-learn regressor."""

import numpy as np
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils import check_array, check_consistent_length, check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from hopperopt.surrogate import levenberg_marquardt, network

VALIDATION_SHARE = 0.2


class NetworkRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator):
    """Feed-forward network with one logistic hidden layer, Levenberg-Marquardt training, early stopping.

    Several initial weight sets are trained; the one with the smallest validation error is kept. Inputs are
    scaled to [-1, 1], outputs to mean 0 and standard deviation 1, both over the training rows, so that errors
    count the outputs equally.

    Parameters
    ----------
    hidden_nodes : int
        Number of hidden nodes.
    starts : int
        Number of initial weight sets. Start k has a seed of its own, spawned from `random_state` for
        (hidden_nodes, k): more starts leave the others as they were.
    random_state : int, RandomState instance or None
        Entropy of the seeds. The same integer gives the same network to the bit.

    Attributes
    ----------
    network_ : hopperopt.surrogate.network.Network
        The kept weights with their scaling.
    start_ : int
        Number of the kept start.
    epochs_ : ndarray of shape (starts,)
        Epochs trained, per start.
    training_errors_, validation_errors_ : ndarray of shape (starts,)
        Mean squared scaled residual at each start's best epoch.
    """

    def __init__(self, hidden_nodes=7, starts=100, random_state=None):
        self.hidden_nodes = hidden_nodes
        self.starts = starts
        self.random_state = random_state

    def fit(self, X, y, validation=None, groups=None):
        """Train on rows X (n, inputs) and y (n,) or (n, outputs).

        validation: a pair (X, y) that decides on stopping and on the start. Without it a fifth of the rows is
        set aside for that, drawn at random; with groups, (n,) labels, a fifth of the groups, whole. With
        fewer than five rows or groups nothing is set aside, and the networks are trained to their minimum.
        """
        if self.hidden_nodes < 1 or self.starts < 1:
            raise ValueError(f"hidden_nodes={self.hidden_nodes} and starts={self.starts} must be at least 1")
        X, y = validate_data(self, X, y, multi_output=True, y_numeric=True, dtype=np.float64)
        self._single_output = y.ndim == 1
        y = y.reshape(len(y), -1).astype(np.float64)
        entropy = self._entropy()
        if validation is None:
            groups = np.arange(len(X)) if groups is None else np.asarray(groups)
            check_consistent_length(X, groups)
            held_out = _held_out(groups, entropy)
            validation = (X[held_out], y[held_out]) if held_out.any() else None
            X, y = X[~held_out], y[~held_out]
        else:
            validation = self._checked_validation(*validation, y.shape[1])
        self._train(X, y, validation, entropy)
        return self

    def predict(self, X):
        """Predict rows X (n, inputs): (n,) or (n, outputs), as y was given."""
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        prediction = self.network_.predict(X)
        return prediction[:, 0] if self._single_output else prediction

    def _train(self, X, y, validation, entropy):
        """Train all starts and keep the best."""
        inputs_scaling, outputs_scaling = network.range_scaling(X), network.standard_scaling(y)

        def sample(inputs, targets):
            return levenberg_marquardt.Sample(
                network.columns(inputs_scaling.normalise(inputs)),
                np.ascontiguousarray(outputs_scaling.normalise(targets).T),
            )

        seeds = [
            np.random.SeedSequence(entropy, spawn_key=(self.hidden_nodes, start))
            for start in range(self.starts)
        ]
        initial = network.initial_weights(self.hidden_nodes, X.shape[1], y.shape[1], seeds)
        fits = levenberg_marquardt.fit(initial, sample(X, y), sample(*validation) if validation else None)
        self.start_ = int(np.argmin(fits.validation_error))
        self.epochs_ = fits.epochs
        self.training_errors_, self.validation_errors_ = fits.training_error, fits.validation_error
        self.network_ = network.Network(
            fits.weights.hidden[self.start_],
            fits.weights.output[self.start_],
            inputs_scaling,
            outputs_scaling,
        )

    def _entropy(self):
        """Integer from which all seeds follow."""
        if isinstance(self.random_state, int | np.integer):
            return int(self.random_state)
        return int(check_random_state(self.random_state).randint(2**31))

    def _checked_validation(self, X, y, outputs):
        """Return validation data as arrays of the training data's numbers of columns."""
        X, y = check_array(X, dtype=np.float64), np.asarray(y, dtype=np.float64)
        y = y.reshape(len(y), -1)
        if X.shape[1] != self.n_features_in_ or y.shape != (len(X), outputs):
            raise ValueError(
                f"validation data of shapes {X.shape} and {y.shape} do not fit "
                f"{self.n_features_in_} inputs and {outputs} outputs"
            )
        return X, y


def _held_out(groups, entropy):
    """Choose a fifth of the groups at random; groups: (n,) labels. Returns a mask (n,)."""
    labels = np.unique(groups)
    rng = np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=(0,)))
    return np.isin(groups, rng.permutation(labels)[: int(VALIDATION_SHARE * len(labels))])
