"""Whether rounds of infill pay: campaigns on a hopper whose outflow is known, for docs/infill.md.

`python -m validation.infill` runs them and prints the table. The known hopper is a surrogate of the full
study, infill_truth.nc beside this file: its mean curves are the truth, its noise of a run is that of the
simulations.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.stats import qmc, t

from hopperopt import design as plans
from hopperopt import infill, optimise
from hopperopt.outflow import corrected_square, objective
from hopperopt.select import select
from hopperopt.surrogate import gaussian, prediction

TRUTH = Path(__file__).parent / "infill_truth.nc"
FACTORS = {
    "theta_deg": [60, 57.5, 55, 52.5, 50],
    "length_mm": [50, 45, 40, 35, 30],
    "height_mm": [34, 32, 29.6, 28, 26],
}
REPEATS, ROUNDS, BATCH, REPLICATES = 40, 2, 4, 3
NSGA = {"population": 60, "generations": 20, "crossover_probability": 0.9, "mutation_probability": 0.1}
DENSE = 4096  # designs at which the truth is known, for the best that can be reached
BOUNDS = np.array([plans.bounds(levels) for levels in FACTORS.values()])
MEASURES = {
    "score": "J of the selected design",  # J_f / J_f,centre + J_i / J_i,centre, true
    "reached": "front reached",  # true hypervolume of the front's designs over that of the best front
    "error": "error at the selected design",  # rms of predicted less true J_k / J_k,centre
}


class Truth(NamedTuple):
    """The known hopper."""

    predictor: prediction.Predictor
    corner: np.ndarray  # (2,) of the hypervolumes
    centre: np.ndarray  # (2,) true J of the plan's centre
    volume: float  # of the best front
    least: float  # score of the best design

    @classmethod
    def load(cls):
        """The truth of the file, and the best that it holds."""
        predictor = prediction.load(TRUTH)
        if list(predictor.factors) != list(FACTORS):
            raise ValueError(f"{TRUTH.name}: has the factors {predictor.factors}")
        blank = cls(predictor, np.zeros(2), np.zeros(2), 0.0, 0.0)
        low, high = BOUNDS.T
        dense = blank.J(low + qmc.Sobol(len(BOUNDS), rng=1).random(DENSE) * (high - low))
        plan = blank.J(_plan())
        corner = infill.CORNER * plan.max(axis=0)
        centre = blank.J(np.array([list(plans.centre(FACTORS).values())]))[0]
        return cls(
            predictor, corner, centre, _volume(dense, corner), float((dense / centre).sum(axis=1).min())
        )

    def J(self, designs):
        """True J (n, 2) of designs."""
        return objective(self.predictor.curves(designs), self.predictor.batch)

    def simulate(self, designs, rng):
        """A training set as the stage `filter` writes it, of designs with the mean curves of their runs."""
        curves, noise = self.predictor.curves(designs), self.predictor.model.scale
        runs = curves[:, None] + noise * rng.normal(size=(len(curves), REPLICATES, *noise.shape))
        mean, variance = runs.mean(axis=1), runs.var(axis=1, ddof=1) / REPLICATES
        dims = ("experiment", "output", "M")
        return xr.Dataset(
            {
                "target": (dims, mean),
                "variance": (dims, variance),
                "runs": ("experiment", np.full(len(mean), REPLICATES)),
                "U": (dims[:2], corrected_square(mean, self.predictor.batch, variance)),
                "target_fraction": ("output", self.predictor.batch),
            },
            coords={name: ("experiment", designs[:, k]) for k, name in enumerate(FACTORS)},
            attrs={"factors": " ".join(FACTORS)},
        )


def _plan():
    return np.array([list(experiment.design.values()) for experiment in plans.l25(FACTORS)])


def _volume(J, corner):
    """Area that J (n, 2) dominate below a corner."""
    return float(np.prod(corner) - infill.improvement(np.zeros(2), J, corner))


def concluded(truth, data, seed):
    """What a data set leads to: surrogate, designs of its front (the selected one first)."""
    predictor = prediction.Predictor(
        tuple(FACTORS), truth.predictor.M, truth.predictor.batch, gaussian.fit(data)
    )
    front, _ = optimise.search(predictor, BOUNDS, NSGA | {"seed": seed})
    centre = predictor.objectives(np.array([list(plans.centre(FACTORS).values())]))[0]
    index, *_ = select("knee", front.objectives, centre)
    order = np.concatenate([[index], np.delete(np.arange(len(front.designs)), index)])
    return predictor, front.designs[order]


def judged(truth, predictor, front):
    """The measures of a campaign's end."""
    true = truth.J(front)
    wrong = (predictor.objectives(front[:1])[0] - true[0]) / truth.centre
    return {
        "score": (true[0] / truth.centre).sum(),
        "reached": _volume(true, truth.corner) / truth.volume,
        "error": np.sqrt(np.mean(wrong**2)),
    }


def campaign(truth, seed):
    """The measures of each plan, by its name, with the same first runs of the orthogonal array."""
    rng = np.random.default_rng(seed)
    data = truth.simulate(_plan(), rng)
    plan = predictor, front = concluded(truth, data, seed)
    params = {
        "bounds": dict(zip(FACTORS, BOUNDS.tolist(), strict=True)),
        "replicates": REPLICATES,
        "seed": seed,
        "case_of": lambda design: design,
    }
    corner = infill.corner(predictor)
    for number in range(1, ROUNDS + 1):
        found = infill.designs(
            params | {"round": number, "names": plans.proposals(number, BATCH)},
            predictor,
            corner,
            front,
            np.empty((0, len(FACTORS))),  # no run is dropped
        )
        data = xr.concat(
            [data, truth.simulate(found[list(FACTORS)].to_numpy(), rng)], "experiment", data_vars="minimal"
        )
        predictor, front = concluded(truth, data, seed)
    low, high = BOUNDS.T
    total = len(_plan()) + ROUNDS * BATCH
    hypercube = low + qmc.LatinHypercube(len(BOUNDS), rng=seed).random(total) * (high - low)
    other = concluded(truth, truth.simulate(hypercube, rng), seed)
    ends = {"plan": plan, "infill": (predictor, front), "hypercube": other}
    return {name: judged(truth, *end) for name, end in ends.items()}


def main():
    """Run the campaigns and print the table."""
    truth = Truth.load()
    found = []
    for seed in range(1, REPEATS + 1):
        found.append(campaign(truth, seed))
        print(
            seed,
            *({name: round(float(value), 4) for name, value in end.items()} for end in found[-1].values()),
        )
    rows = [
        ["", "plan alone", "infill", "hypercube", "infill less plan", "infill less hypercube"],
        ["---"] * 6,
    ]
    for measure, words in MEASURES.items():
        ends = {name: np.array([one[name][measure] for one in found]) for name in found[0]}
        values = [*ends.values(), ends["infill"] - ends["plan"], ends["infill"] - ends["hypercube"]]
        rows.append([words, *map(_mean, values)])
    print(*("| " + " | ".join(row) + " |" for row in rows), sep="\n")
    print(f"best score: {truth.least:.3f}")


def _mean(values):
    """Mean with its interval of 90 %."""
    half = t.ppf(0.95, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return f"{values.mean():.4f} ({values.mean() - half:.4f} to {values.mean() + half:.4f})"


if __name__ == "__main__":
    main()
