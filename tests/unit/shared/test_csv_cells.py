"""Cells of CSV files."""

from __future__ import annotations

import pytest

from nena_shared.csv_cells import FORMULA_SIGNS, harmless


@pytest.mark.parametrize("sign", FORMULA_SIGNS)
def test_no_spreadsheet_executes_a_cell(sign: str) -> None:
    assert harmless(f"{sign}1+1") == f"'{sign}1+1"


def test_other_texts_are_unchanged() -> None:
    assert [harmless(each) for each in ("AMR-1", "", None)] == ["AMR-1", "", ""]
