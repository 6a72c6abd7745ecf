"""Random configurations and designs at their full counts, told in docs/robustness.md.

`python -m validation.robustness` runs them all and rewrites the page; with `--seed N` it runs others, and
prints what the page would say.
"""

import argparse
from collections import Counter

from hopperopt.provenance import compile_solver
from validation.report import DOCS

SEED = 1  # of the page and of the tests
DOCUMENTS, WITHIN, BEYOND = 1000, 200, 60  # counts of the page and of `make test-all`
PAGE = """# Random input

Written by `.venv/bin/python -m validation.robustness`. `make test-all` checks the same counts, `make test`
{few_documents} configurations and {few_designs} designs. `--seed N` draws others than these of seed {seed}.

## Configurations

{documents} documents with any keys in any sections, half of them spoilt in one to three places: other types,
NaN and infinities, empty or endless lists, text for numbers, unknown keys, a section in the place of a value.
Each is either refused, by sentences that are one printable line and begin with a key, or everything is made
of it that the workflow makes: warnings, settings of all stages, and a run of {particles} particles for at
most {steps} steps before and after the opening, which `gather` takes or refuses by its status. All shapes of
inserts are drawn, bodies and shells of random points among them.

{outcomes}

## Designs

Experiments of 150 to 300 spheres: outlets of 1.6 to 8 coarse diameters, half-angles of 10 to 90 degrees,
inserts of all shapes and many sizes, spheres up to 1 : 4, friction up to 2, all rolling models, steps of 0.2
to 0.4 Rayleigh times with a restitution up to 0.95, or of 0.77 with one up to 0.7 and friction up to 0.5.

Within are {within} designs that the configuration accepts without a warning that a monitor may break; beyond
are {beyond} with such a warning: a fine sphere crushed by a coarse one, squeezed so that the step is too
long, or flung off it; coarse spheres of more than 2.5 times the fine ones' diameter. In each run all spheres
that went in have left or are counted as residual, and the windows of m(M) add up to what left, of each size.
Within, every monitor is inside its bound; beyond, a run with one that is not has the status `monitor`.

{designs}

While those within were drawn, this many were refused by each key: {refused}; and warned of: {warned}.
"""
FEW_DOCUMENTS, FEW_DESIGNS = 50, 12


def main():
    """Measure, and write the page or print it; a fault stops it."""
    parser = argparse.ArgumentParser(prog="validation.robustness", description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, help="draw other input, and print the page")
    seed = parser.parse_args().seed
    compile_solver()
    if seed is None:
        (DOCS / "robustness.md").write_text(page(SEED))
    else:
        print(page(seed))


def page(seed):
    """Text of the page for a seed of the random input."""
    # These import numba, whose cache has to be named before.
    from validation import random_designs, random_documents

    columns, samples = {}, {}
    for name, beyond, count in (("within", False, WITHIN), ("beyond", True, BEYOND)):
        samples[name] = random_designs.sample(count, seed, beyond)
        runs = [random_designs.judged(case, within=not beyond) for case in samples[name].cases]
        columns[name] = _column(runs, random_designs.STATUSES, random_designs.BOUNDS)
    outcomes = random_documents.outcomes(DOCUMENTS, seed)
    return PAGE.format(
        seed=seed,
        documents=DOCUMENTS,
        few_documents=FEW_DOCUMENTS,
        few_designs=FEW_DESIGNS,
        particles=random_documents.PARTICLES,
        steps=random_documents.STEPS,
        outcomes=_by_shape(outcomes, list(random_documents.SHAPES)),
        within=WITHIN,
        beyond=BEYOND,
        designs=_table(
            ("", *columns),
            [(row, *(column[row] for column in columns.values())) for row in columns["within"]],
        ),
        refused=_listed(samples["within"].refused),
        warned=_listed(samples["within"].warned),
    )


def _column(runs, statuses, bounds):
    """How many runs have each status, and the largest value of each monitor, by the row's name."""
    found = Counter(run["status"].item() for run in runs)
    rows = {f"`{status}`": found[status] for status in statuses}
    for name, bound in bounds.items():
        rows[f"largest `{name}` (bound {bound:g})"] = f"{max(float(run[name]) for run in runs):.2g}"
    return rows


def _by_shape(outcomes, shapes):
    """Table of the documents with each outcome: all of them, and of those with each shape of insert."""
    totals = Counter()
    for (outcome, _), number in outcomes.items():
        totals[outcome] += number
    rows = [
        (outcome, total, *(outcomes[outcome, shape] or "" for shape in shapes))
        for outcome, total in totals.most_common()
    ]
    return _table(("outcome", "documents", *(f"`{shape}`" for shape in shapes)), rows)


def _listed(counts):
    return ", ".join(f"`{key}` {count}" for key, count in counts.most_common())


def _table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


if __name__ == "__main__":
    main()
