"""What a study does with its simulations: plan, infill, surrogate, optimiser, verification, figures."""

from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, BeforeValidator, Field, StringConstraints

from hopperopt import design as plans
from hopperopt.config.fields import Count, Finite, Model, Name, Nodes, Number, Seed, Share
from hopperopt.document import NotAllowed
from hopperopt.quantity import Quantity


class Factor(Model):
    """A number of the configuration that the designs vary, and its levels."""

    key: str
    """The number that the factor varies, by its dotted key: any of hopper, insert, particles (but the
    diameters), wall, contact, filling, discharge or simulation."""
    levels: Annotated[tuple[Finite, ...], Field(min_length=2, max_length=plans.MOST_EXPERIMENTS)]
    """Its levels, in the key's unit: five for `l25`; other plans and the optimiser use the smallest and
    largest."""


def _power_of_two(count):
    if count & (count - 1):
        raise NotAllowed("a power of two (others lose the balance of Sobol' points)")
    return count


class Hypercube(Model):
    """Latin hypercube within the ranges of the levels."""

    experiments: Annotated[int, Number(least=2, most=plans.MOST_EXPERIMENTS)] = 25
    """Number of experiments."""
    seed: Seed = 1
    """Seed of the plan."""


class Sobol(Model):
    """Sobol' points within the ranges of the levels."""

    experiments: Annotated[
        int, Number(least=2, most=plans.MOST_EXPERIMENTS), AfterValidator(_power_of_two)
    ] = 32
    """Number of experiments, a power of two."""
    seed: Seed = 1
    """Seed of the plan."""


class OwnPlan(Model):
    """A plan of one's own: a CSV file, read when the configuration is."""

    file: Annotated[str, StringConstraints(min_length=1)] = "plan.csv"
    """CSV file with a column `experiment` and one for each factor."""


class Design(Model):
    """Which designs are simulated, and how often."""

    plan: Literal["l25", "lhs", "sobol", "csv"] = "l25"
    """Orthogonal array of 25 experiments, Latin hypercube, Sobol' points, or a CSV file of one's own."""
    replicates: Count = 3
    """Independent fillings of each design."""
    lhs: Hypercube = Hypercube()
    sobol: Sobol = Sobol()
    csv: OwnPlan = OwnPlan()


class Infill(Model):
    """Designs that are simulated after the plan, where its surrogate expects most of them."""

    rounds: Annotated[int, Number(least=0, most=100)] = 0
    """Rounds; in each, designs are proposed from all that is simulated, and simulated as often as the
    plan's."""
    batch: Annotated[int, Number(least=1, most=100)] = 4
    """Designs of a round: the one selected from the front, and those of the largest expected improvement of
    its hypervolume."""


class Validation(Model):
    """The comparison of the surrogates, each experiment left out once."""

    starts: Count = 20
    """Initial weight sets for each size, in the comparison of the surrogates."""


PAPERS_NETWORK = {"selected_hidden_nodes": 7, "clip_sigma": 3.0}


class Surrogate(Model):
    """The surrogate: which model; filter, split, hidden sizes and starts of networks."""

    model: Literal["auto", "paper", "network", "ensemble", "gaussian"] = "auto"
    """By comparison at experiments not seen (`auto`), or the one that is named; `paper` is a network with 7
    hidden nodes on targets clipped at 3 standard deviations, whatever else is set."""
    clip_sigma: Annotated[float | None, Number(above=0)] = 3.0
    """Limit of the targets' filter in standard deviations; null for none."""
    hidden_nodes: Annotated[tuple[Nodes, ...], Field(min_length=1)] = (3, 4, 5, 6, 7, 8, 9, 10)
    """Numbers of hidden nodes of the networks that are trained."""
    starts: Count = 100
    """Initial weight sets for each of these sizes."""
    selected_hidden_nodes: Annotated[int | Literal["auto"], Number(least=1, most=200)] = "auto"
    """One of these sizes; `auto` chooses by cross-validation."""
    split: Literal["experiments", "points"] = "experiments"
    """Into training, validation and test: whole experiments, or points as the paper."""
    validation_experiments: Count = 4
    """Experiments that stop the training."""
    test_experiments: Count = 4
    """Experiments that choose nothing and tell the error."""
    validation: Validation = Validation()
    seed: Seed = 1
    """Seed of split and weights."""

    @property
    def networks(self):
        """Settings of the networks' training, as plain values; of the paper's where it is chosen."""
        names = {"hidden_nodes", "starts", "selected_hidden_nodes", "seed"}
        settings = self.model_dump(mode="json", include=names)
        if self.model == "paper":
            nodes = PAPERS_NETWORK["selected_hidden_nodes"]
            settings |= {"hidden_nodes": sorted({*self.hidden_nodes, nodes}), "selected_hidden_nodes": nodes}
        return settings

    @property
    def targets(self):
        """Settings of the targets, as plain values; the clip is the paper's where its network is chosen."""
        settings = self.model_dump(
            include={"clip_sigma", "split", "validation_experiments", "test_experiments", "seed"}
        )
        return settings | ({"clip_sigma": PAPERS_NETWORK["clip_sigma"]} if self.model == "paper" else {})


class Optimise(Model):
    """NSGA-II and the choice from its front."""

    population: Annotated[int, Number(least=4, most=10_000)] = 100
    """Designs in a generation of NSGA-II."""
    generations: Count = 30
    """Generations, the first one included."""
    crossover_probability: Share = 0.9
    """Probability of crossover."""
    mutation_probability: Share = 0.1
    """Probability of mutation of each variable."""
    seed: Seed = 1
    """Seed of the search."""
    seeds: Annotated[int, Number(least=1, most=100)] = 3
    """Searches, each from another seed (`seed` and the next ones); their fronts are joined."""
    select: Literal["knee", "compromise", "explicit"] = "knee"
    """The front's knee, its best compromise, or the design named below."""
    explicit: dict[Name, Finite] = Field(default={})
    """With `select: explicit`, a number for each factor, within its levels."""


PAPERS_OPTIMUM = {"theta_deg": 56.7, "length_mm": 32.4, "height_mm": 33.0}  # the optimum of Yu and Saxén
Derived = Literal["selected", "best_f", "best_i", "plan_best"]
Fixed = Literal["plan_centre", "bare"]
DERIVED: tuple[Derived, ...] = get_args(Derived)
FIXED: tuple[Fixed, ...] = get_args(Fixed)
MOST_CASES = 1000  # `verify` gets them in one argument, whose length the system limits


def _read_case(value):
    """A verification case: one of the words, or a number for each factor."""
    if isinstance(value, str) and value in (*DERIVED, *FIXED):
        return value
    allowed = f"{', '.join((*DERIVED, *FIXED))}, or a number for each factor"
    if not isinstance(value, dict) or not value:
        raise NotAllowed(allowed)
    try:
        return {str(name): Quantity().read(number) for name, number in value.items()}
    except NotAllowed:
        raise NotAllowed(allowed) from None


Case = Annotated[Literal[Derived, Fixed] | dict[str, float], BeforeValidator(_read_case)]
USUAL_CASES: dict[str, Case] = {
    **{word: word for word in DERIVED},
    "plan_centre": "plan_centre",
    "paper": PAPERS_OPTIMUM,
    "bare": "bare",
}


class Verification(Model):
    """The designs that are simulated anew, by name, and how often."""

    replicates: Count = 10
    """Fillings of each case."""
    replicates_of: dict[Name, Count] = Field(default={"selected": 20, "plan_best": 20})
    """Fillings of single cases that have another number, by name."""
    cases: Annotated[dict[Name, Case], Field(min_length=1, max_length=MOST_CASES)] = USUAL_CASES
    """The designs that are simulated anew, by name: a word (`selected`; the front's ends `best_f` and
    `best_i`; `plan_best`; `plan_centre`, the middle levels; `bare`, no insert), or a number for each
    factor."""

    @property
    def words(self):
        """What a case may be, beside a design."""
        return (*DERIVED, *FIXED)

    def replicates_in(self, name):
        """Number of runs of a case."""
        return self.replicates_of.get(name, self.replicates)


class Figures(Model):
    """How the figures are drawn."""

    dpi: Annotated[int, Number(least=50, most=1200)] = 200
    """Resolution of the PNG files, dots per inch."""
