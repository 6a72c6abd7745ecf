"""Random configurations and designs: what is wrong is said, what is accepted runs, and nothing is lost."""

import pytest

from validation import random_designs, random_documents
from validation.robustness import BEYOND, DOCUMENTS, FEW_DESIGNS, FEW_DOCUMENTS, SEED, WITHIN

pytestmark = pytest.mark.slow
full = pytest.mark.full


@pytest.mark.parametrize("count", [FEW_DOCUMENTS, pytest.param(DOCUMENTS, marks=full)])
def test_random_documents_are_refused_by_sentences_or_run(count):
    found = random_documents.outcomes(count, SEED)
    assert found.total() == count
    complete = {shape: number for (outcome, shape), number in found.items() if outcome == "complete"}
    assert set(complete) == set(random_documents.SHAPES) or count == FEW_DOCUMENTS
    assert found["refused", None] > count / 10 and sum(complete.values()) > count / 10


@pytest.mark.parametrize("count", [FEW_DESIGNS, pytest.param(WITHIN, marks=full)])
def test_random_designs_end_within_the_monitors(count):
    sample = random_designs.sample(count, SEED)
    statuses = [random_designs.judged(case)["status"].item() for case in sample.cases]
    assert len(statuses) == count and statuses.count("complete") > count / 4
    assert sample.refused


@full
def test_random_designs_beyond_the_bounds_of_validity_end_by_their_status():
    sample = random_designs.sample(BEYOND, SEED, beyond=True)
    statuses = [random_designs.judged(case, within=False)["status"].item() for case in sample.cases]
    assert statuses.count("monitor") > BEYOND / 20
