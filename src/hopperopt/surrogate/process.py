"""Gaussian processes of noisy values at designs: the search for a kernel's parameters, and the predictions.

Either takes the cube of the number of values if all are to have a say. A search asks some of many. A
prediction with many uses all, by way of what they say of the process at inducing inputs: Titsias, Variational
learning of inducing variables in sparse Gaussian processes, AISTATS 2009, 567-574.
"""

import warnings
from collections.abc import Iterable

import numpy as np

SEARCHED = 500  # values at most in a search for a kernel's parameters
EXACT = 1000  # values at most with which a process is conditioned as it is; inducing inputs of more
# Of the process' variance, on the diagonal of the inducing inputs' covariance, which may be singular. Where
# the variance is more than a million times that of the noise, predictions are less sure for it.
JITTER = 1e-9


def likeliest(kernel, inputs: np.ndarray, values: np.ndarray, noise=1e-10, restarts: int = 0):
    """The scikit-learn kernel with the parameters that make values (n,) at inputs (n, factors) likeliest.

    noise: variance of the values' noise beside the kernel's own, one or (n,). Of more than 500 values, a
    sample of so many, always the same, has a say.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor  # slow to import

    some = np.sort(np.random.default_rng(0).permutation(len(values))[:SEARCHED])
    noise = np.broadcast_to(noise, len(values))[some]
    search = GaussianProcessRegressor(kernel, alpha=noise, n_restarts_optimizer=restarts, random_state=0)
    with warnings.catch_warnings():
        # A factor without effect takes its length to the bound, as it should.
        warnings.simplefilter("ignore", ConvergenceWarning)
        return search.fit(inputs[some], values[some]).kernel_


def conditioned(kernel, inputs: np.ndarray, values: np.ndarray, noise: np.ndarray):
    """The process of a kernel, a constant times a Matern, given values (n,) at inputs (n, factors).

    noise: (n,) variances. What is returned predicts as scikit-learn's regressor does. Up to 1,000 values that
    is exact.
    """
    from sklearn.gaussian_process import GaussianProcessRegressor  # slow to import

    if len(values) > EXACT:
        return Inducing(kernel, inputs, values, noise)
    return GaussianProcessRegressor(kernel, alpha=noise, optimizer=None).fit(inputs, values)


class Inducing:
    """A process that knows of its values what they say of it at some of their inputs, m of n.

    To condition it takes n m^2, a prediction m^2 for each input. A tenth of the inducing inputs are the
    latest: a search for the best designs asks what is known close to those that it has added.

    kernel, inputs (n, factors), values (n,) and noise (n,) as in `conditioned`.
    """

    def __init__(self, kernel, inputs: np.ndarray, values: np.ndarray, noise: np.ndarray):
        from scipy.linalg import cholesky, solve_triangular  # slow to import

        latest = range(len(values) - EXACT // 10, len(values))
        chosen = far_apart(inputs / kernel.k2.length_scale, EXACT, latest)
        self.kernel = kernel
        self.inputs = inputs[chosen]  # (m, factors)
        prior = kernel(self.inputs) + JITTER * kernel.k1.constant_value * np.eye(len(chosen))
        self.lower = cholesky(prior, lower=True)  # (m, m), L of K_mm = L L'
        seen = solve_triangular(self.lower, kernel(self.inputs, inputs), lower=True) / np.sqrt(noise)
        # (m, m), of 1 + A A' with A = L^-1 K_mn / sqrt(noise)
        self.informed = cholesky(np.eye(len(chosen)) + seen @ seen.T, lower=True)
        self.weights = solve_triangular(self.informed, seen @ (values / np.sqrt(noise)), lower=True)  # (m,)

    def predict(self, inputs: np.ndarray, return_std: bool = False, return_cov: bool = False):
        """Mean (n,) at inputs (n, factors), and standard deviation (n,) or covariance (n, n) if asked for."""
        from scipy.linalg import solve_triangular

        known = solve_triangular(self.lower, self.kernel(self.inputs, inputs), lower=True)
        left = solve_triangular(self.informed, known, lower=True)
        mean = left.T @ self.weights
        if return_cov:
            return mean, self.kernel(inputs) - known.T @ known + left.T @ left
        if return_std:
            variance = self.kernel.diag(inputs) - np.sum(known**2, axis=0) + np.sum(left**2, axis=0)
            return mean, np.sqrt(np.maximum(variance, 0))
        return mean


def far_apart(points: np.ndarray, number: int, first: Iterable[int]) -> np.ndarray:
    """Indices of so many points of (n, d): those of `first`, then the farthest from all before it each time.

    None coincides with another: there may be fewer. Gonzalez, Theoretical Computer Science 38 (1985) 293-306.
    """
    chosen: list[int] = []
    distance, first = np.full(len(points), np.inf), iter(first)
    while len(chosen) < number and distance.max() > 0:
        one = next(first, None)
        if one is None:
            one = int(np.argmax(distance))
        elif not distance[one] > 0:
            continue
        chosen.append(one)
        distance = np.minimum(distance, np.sum((points - points[one]) ** 2, axis=1))
    return np.array(chosen)
