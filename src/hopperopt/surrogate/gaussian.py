"""Gaussian processes of the principal components of the curves.

The curves of both outputs over M are one vector each, divided by the noise of a single run, so that the noise
is 1 everywhere and the components are what stands out of it. The score of each component is a Gaussian
process of the design, with the noise that is known from the runs.

Mean curve and components come from noisy curves too: as in a regression of the curves on the scores, their
variances are the noise over n and over the sum of the squared scores. Noise makes them longer as well, and so
J larger; they are shrunk by as much (James and Stein), the mean curve towards the batch. What the curves vary
besides has a variance of its own, the same at every design.
"""

import functools
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from hopperopt.surrogate import process
from hopperopt.surrogate.network import one_thread, range_scaling

LENGTHS = (
    0.5,
    50.0,
)  # bounds of the correlation lengths, in half ranges; the longest is a factor without effect
VARIANCES = (1e-4, 1e8)  # bounds of a process' variance, in variances of the noise
RESTARTS = 1  # of the search for a process' variance and lengths, with seeds of their own
LEAST_NOISE = 1e-4  # standard deviation of a mass fraction that counts as none


@dataclass(frozen=True, eq=False)
class Gaussian:
    """Independent processes of the scores, c components, given n training experiments."""

    designs: np.ndarray  # (n, factors)
    noise: np.ndarray  # (n,) variance of the noise in each score
    scale: np.ndarray  # (outputs, m) noise of a single run
    mean: np.ndarray  # (outputs, m)
    mean_variance: np.ndarray  # (outputs, 1) in squares of the scale
    components: np.ndarray  # (c, outputs, m)
    component_variances: np.ndarray  # (c, outputs, 1) in squares of the scale
    rest: np.ndarray  # () variance, in squares of the scale, of what no component holds
    scores: np.ndarray  # (n, c)
    variances: np.ndarray  # (c,) of the processes
    lengths: np.ndarray  # (c, factors) of the processes, in half ranges of the factors

    @one_thread
    def moments(self, designs: np.ndarray, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance, (n, outputs, m) each, of the curves without noise, at the M of the training."""
        inputs = self._scaled(designs)
        known = [one.predict(inputs, return_std=True) for one in self._processes]
        scores, deviations = (np.stack(part, axis=-1) for part in zip(*known, strict=True))
        own = np.einsum("nc,com->nom", deviations**2, self.components**2)
        shared = self.mean_variance + np.einsum(
            "nc,com->nom", scores**2 + deviations**2, self.component_variances
        )
        mean = self.mean + np.einsum("nc,com->nom", scores, self.components)
        return mean, own + self.scale**2 * (shared + self.rest)

    @one_thread
    def draws(self, designs: np.ndarray, M: np.ndarray, number: int, rng: np.random.Generator) -> np.ndarray:
        """Draw curves without noise, joint over the designs: (number, n, outputs, m)."""
        inputs = self._scaled(designs)
        scores = []
        for one in self._processes:
            mean, covariance = one.predict(inputs, return_cov=True)
            scores.append(rng.multivariate_normal(mean, covariance, number, method="eigh"))

        def normal(count, variance):
            noise = rng.normal(size=(number, count, *self.scale.shape))
            return self.scale * np.sqrt(variance) * noise

        components = self.components + normal(len(self.components), self.component_variances)
        curves = np.einsum("cdn,dcom->dnom", np.stack(scores), components)
        return self.mean + normal(1, self.mean_variance) + curves + normal(len(inputs), self.rest)

    @one_thread
    def believing(self, design: np.ndarray, runs: int) -> "Gaussian":
        """The processes as if so many runs of a design (factors,) had shown what is predicted there."""
        scores = [one.predict(self._scaled(design)) for one in self._processes]
        designs = np.vstack([self.designs, design])
        widths = range_scaling(self.designs).scale / range_scaling(designs).scale
        return replace(
            self,
            designs=designs,
            noise=np.append(self.noise, 1 / runs),
            scores=np.vstack([self.scores, np.ravel(scores)]),
            lengths=self.lengths * widths,
        )

    def _scaled(self, designs):
        return range_scaling(self.designs).normalise(np.atleast_2d(np.asarray(designs, dtype=float)))

    @functools.cached_property
    def _processes(self):
        """A process per component, conditioned on the training scores: once, as that takes long with many."""
        inputs = self._scaled(self.designs)
        return [
            process.conditioned(_kernel(variance, lengths), inputs, scores, self.noise)
            for scores, variance, lengths in zip(self.scores.T, self.variances, self.lengths, strict=True)
        ]


@one_thread
def fit(data: xr.Dataset) -> Gaussian:
    """Fit the processes to the mean curves of the experiments, never clipped.

    data: `target`, `variance` (of the mean curve), `runs`, `target_fraction` and the factors, as the stage
    `filter` writes them. The variance of one run is pooled over the experiments. The hyperparameters are
    those of the largest likelihood (see `process`).
    """
    designs = np.column_stack([data[name].values for name in data.attrs["factors"].split()])
    curves, batch = (
        data["target"].transpose("experiment", "output", "M").values,
        data["target_fraction"].values,
    )
    scale, noise, mean = np.sqrt(run_variance(data)), 1 / data["runs"].values, curves.mean(axis=0)
    departures = ((curves - mean) / scale).reshape(len(curves), -1)
    directions, rest = _components(departures, noise.mean())
    scores, inputs = departures @ directions.T, range_scaling(designs).normalise(designs)
    found = [_hyperparameters(inputs, score, noise) for score in scores.T]
    variances, lengths = (np.array(part) for part in zip(*found, strict=True))
    from_batch, mean_variance = _shrunk(mean - batch[:, None], scale, noise.mean() / len(curves))
    error = noise.mean() / np.sum(scores**2, axis=0)[:, None, None]
    components, component_variances = _shrunk(directions.reshape(-1, *mean.shape) * scale, scale, error)
    return Gaussian(
        designs, noise, scale, batch[:, None] + from_batch, mean_variance, components, component_variances,
        rest, scores, variances, lengths,
    )  # fmt: skip


def _shrunk(curves, scale, variance):
    """Shrink noisy curves (..., outputs, m) so that their mean squares over M are those without the noise.

    variance: of the noise, in squares of the scale. Returns the curves and the variance that is left.
    """
    square = np.mean(curves**2, axis=-1, keepdims=True)
    noise = variance * np.mean(scale**2, axis=-1, keepdims=True)
    share = 1 - np.minimum(np.divide(noise, square, out=np.ones_like(square), where=square > 0), 1)
    return share * curves, share * variance


def run_variance(data: xr.Dataset) -> np.ndarray:
    """Variance s^2 of one run's mass fractions, (outputs, m), pooled over a training set's experiments."""
    variance = (data["variance"] * data["runs"]).mean("experiment").transpose("output", "M").values
    return np.maximum(variance, LEAST_NOISE**2)


def _components(curves, noise):
    """Directions along which centred curves (n, columns) vary by more than noise does, and the rest.

    Noise of variance `noise` in every column reaches the variance noise (1 + sqrt(columns / (n - 1)))^2 along
    some direction (the edge of Marchenko and Pastur). At least one direction is kept. Returns them,
    orthonormal (c, columns), and the variance in each column of what the others hold above the noise.
    """
    freedom, columns = len(curves) - 1, curves.shape[1]
    _, singular, directions = np.linalg.svd(curves, full_matrices=False)
    edge = noise * (1 + np.sqrt(columns / freedom)) ** 2
    count = max(1, int((singular**2 / freedom > edge).sum()))
    left = (freedom - count) * (columns - count)
    rest = np.sum(singular[count:] ** 2) / left - noise if left > 0 else 0.0
    return directions[:count], np.maximum(rest, 0.0)


def _kernel(variance, lengths):
    from sklearn.gaussian_process import kernels  # slow to import

    return kernels.ConstantKernel(variance, VARIANCES) * kernels.Matern(lengths, LENGTHS, nu=2.5)


def _hyperparameters(inputs, scores, noise):
    """Variance and correlation lengths of a process: those that make its scores likeliest."""
    factors = inputs.shape[1]
    start = _kernel(float(np.clip(np.var(scores), *VARIANCES)), np.ones(factors))
    best = process.likeliest(start, inputs, scores, noise, RESTARTS)
    return best.k1.constant_value, np.broadcast_to(best.k2.length_scale, factors)
