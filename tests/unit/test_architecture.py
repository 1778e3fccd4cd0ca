"""docs/architecture.md names files that exist."""

from __future__ import annotations

import re
from pathlib import PurePosixPath

import pytest

from support.guides import DOCS
from support.reference import PROJECT

NAMES = sorted(set(re.findall(r"[\w/.{},*]*\w\.(?:py|js)\b", (DOCS / "architecture.md").read_text("utf-8"))))
FILES = [
    PurePosixPath(path.relative_to(PROJECT))
    for folder in ("shared", "services", "tools", "tests", "bench")
    for path in (PROJECT / folder).rglob("*.[pj][ys]")
]


def test_the_page_names_files() -> None:
    assert len(NAMES) > 50


@pytest.mark.parametrize("name", NAMES)
def test_a_named_file_exists(name: str) -> None:
    pattern = name.replace("/.../", "/**/").replace("NOUN", "*").replace("TOPIC", "*")
    ends = PurePosixPath(pattern.rpartition("**/")[2]).parts
    assert any(PurePosixPath(*file.parts[-len(ends) :]).match("/".join(ends)) for file in FILES), name
