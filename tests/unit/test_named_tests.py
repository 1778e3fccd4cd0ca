"""The pages that name tests name such that exist, for all that they promise to cover."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.guides import DOCS
from support.reference import PROJECT, reference_dir

SIGNS = str.maketrans("", "", "`,")
FILES = tuple((PROJECT / "tests").rglob("test_*.py"))
NAMED = sorted(
    {
        name
        for page in ("brokers.md", "compatibility.md")
        for name in re.findall(r"`([\w/]*test_\w+\.py(?:::\w+)?)`", (DOCS / page).read_text("utf-8"))
    }
)


def keys_of(page: str) -> set[str]:
    """Return the first cells of all tables of a page, without signs."""
    return set(
        re.findall(r"^\| ([^|]*\S) +\|", (DOCS / page).read_text("utf-8").translate(SIGNS), re.MULTILINE)
    )


def test_the_pages_name_tests() -> None:
    assert len(NAMED) > 30


@pytest.mark.parametrize("name", NAMED)
def test_a_named_test_exists(name: str) -> None:
    file, _, test = name.partition("::")
    ends = Path(file).parts
    found = [each for each in FILES if each.parts[-len(ends) :] == ends]
    assert found, f"no file {file}"
    assert not test or any(f"def {test}(" in each.read_text("utf-8") for each in found), f"no test {name}"


def test_each_public_case_has_a_test() -> None:
    cases = {file.name[:2] for file in (reference_dir("brokers.md").parents[1] / "field").glob("[0-9]*.md")}
    assert cases <= keys_of("compatibility.md")


def test_each_behaviour_of_a_broker_that_differs_has_a_test_or_a_reason() -> None:
    lines = reference_dir("brokers.md").read_text("utf-8").translate(SIGNS).splitlines()
    different = {line[2:].partition(" | ")[0] for line in lines if line.startswith("| ") and "**" in line}
    known = keys_of("brokers.md")
    assert different
    assert not [each for each in different if not any(f"{each} ".startswith(f"{key} ") for key in known)]
