"""Each threat of SECURITY.md names tests that attempt it, and each of these tests exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (?P<number>T\d+) \| (?P<cells>.*) \|$", re.MULTILINE)
NAMED = re.compile(r"`(?P<file>tests/[\w/]+(?:\.py)?)(?:::(?P<test>\w+))?`")


def rows(heading: str) -> list[tuple[str, str]]:
    """Return numbers and cells of the table below a heading."""
    part = TEXT.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    return [(found["number"], found["cells"]) for found in ROW.finditer(part)]


THREATS = rows("What NeNa protects, and against whom")
TRIED = rows("Tests of each threat")


def test_threats_are_tested_in_the_order_of_the_table() -> None:
    numbers = [number for number, _ in THREATS]
    assert numbers == [f"T{number}" for number in range(1, len(THREATS) + 1)]
    assert len(numbers) > 10
    assert list(dict.fromkeys(number for number, _ in TRIED)) == numbers


@pytest.mark.parametrize(
    ("number", "cells"), TRIED, ids=[f"{number}-{n}" for n, (number, _) in enumerate(TRIED)]
)
def test_named_tests_exist(number: str, cells: str) -> None:
    named = list(NAMED.finditer(cells))
    assert named, f"{number} names no test: {cells}"
    for each in named:
        file = ROOT / each["file"]
        assert file.exists(), each["file"]
        if each["test"]:
            assert re.search(
                rf"^ *(async )?def {each['test']}\(", file.read_text(encoding="utf-8"), re.MULTILINE
            ), each[0]


def test_all_attacks_of_this_folder_are_in_the_table() -> None:
    """An attack that no threat names is a gap of the table."""
    source = (ROOT / "tests/security/test_attacks.py").read_text(encoding="utf-8")
    attacks = re.findall(r"^async def (test_\w+)\(", source, re.MULTILINE)
    named = {each["test"] for _, cells in TRIED for each in NAMED.finditer(cells)}
    assert set(attacks) <= named, set(attacks) - named
