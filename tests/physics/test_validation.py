"""The quick cases of the validation hold: every judged row of the table that they write."""

import importlib

import pytest

from validation.__main__ import QUICK


@pytest.mark.parametrize("case", QUICK)
def test_every_row_holds(case):
    rows = importlib.import_module(f"validation.{case}").measure(None)
    assert [row for row in rows if row.tolerance and not row.holds] == []
    assert any(row.tolerance for row in rows)
