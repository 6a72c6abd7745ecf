"""Which experiments, or points, train the surrogate, which stop the training, and which only judge it."""

import numpy as np

from hopperopt.files import InputError

TRAINING, VALIDATION, TEST = "training", "validation", "test"
SPLIT, FOLDS = 1, 2  # random streams


def split_experiments(designs: np.ndarray, validation: int, test: int, seed: int) -> np.ndarray:
    """Split whole experiments at random, so that the training ones hold both extremes of every factor.

    Without the extremes the network would extrapolate to the bounds that the optimiser searches. Experiments
    are taken in random order, first for the test, then for validation; one without which an extreme is lost
    stays.

    designs: (n, factors); validation, test: numbers of experiments. Returns labels (n,). Raises
    files.InputError where too few can be spared.
    """
    designs = np.asarray(designs, dtype=float)
    labels = np.full(len(designs), TRAINING, dtype=object)
    extremes = designs.min(axis=0), designs.max(axis=0)
    waiting = [TEST] * test + [VALIDATION] * validation
    for experiment in _generator(seed, SPLIT).permutation(len(designs)):
        if not waiting:
            break
        rest = designs[(labels == TRAINING) & (np.arange(len(designs)) != experiment)]
        if len(rest) and all((rest == level).any(axis=0).all() for level in extremes):
            labels[experiment] = waiting.pop(0)
    if waiting:
        raise InputError(
            f"{len(designs)} experiments are too few: validation and test need {validation + test} of "
            "them, and the others must hold the lowest and the highest value of every factor"
        )
    return labels.astype(str)


def split_points(shape: tuple[int, int], validation: float, test: float, seed: int) -> np.ndarray:
    """Split single points of the curves at random, whatever experiment they belong to, as the paper does.

    Neighbours of one curve then stand on both sides, so that the errors understate those at new designs.

    shape: numbers of experiments and of moments M; validation, test: shares. Returns labels of that shape.
    """
    labels = np.full(np.prod(shape), TRAINING, dtype=object)
    order = _generator(seed, SPLIT).permutation(labels.size)
    first, second = round(test * labels.size), round((test + validation) * labels.size)
    labels[order[:first]] = TEST
    labels[order[first:second]] = VALIDATION
    return labels.reshape(shape).astype(str)


def folds(groups: np.ndarray, number: int, seed: int) -> np.ndarray:
    """Deal whole groups into folds at random; groups: (n,) labels of rows. Returns each row's fold, (n,)."""
    labels, position = np.unique(groups, return_inverse=True)
    fold = np.empty(len(labels), dtype=int)
    fold[_generator(seed, FOLDS).permutation(len(labels))] = np.arange(len(labels)) % number
    return fold[position]


def _generator(seed, purpose):
    """Random stream of the purpose, apart from the others' and from those of the networks' starts."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(purpose,)))
