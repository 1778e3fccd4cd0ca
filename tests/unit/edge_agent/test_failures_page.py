"""The page of failures names every failure, every error and tests that there are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from nena_edge_agent.driver.port import DriveFailure
from nena_edge_agent.protocol.conditions import (
    COLLISION_STOP,
    DRIVE_RECOVERS,
    DRIVE_RETRIED,
    EXTERNAL_GOAL,
    ROBOT_BLOCKED,
)
from nena_edge_agent.protocol.zones import NOT_AVOIDED
from nena_shared.vda5050.error import ErrorType

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/failures.md").read_text(encoding="utf-8")
TESTS = ROOT / "tests/integration/edge_agent/nav2"
ERRORS = (
    ErrorType.NODE_UNREACHABLE,
    ErrorType.LOCALIZATION_ERROR,
    ErrorType.NAVIGATION_NOT_AVAILABLE,
    DRIVE_RETRIED,
    EXTERNAL_GOAL,
    ROBOT_BLOCKED,
    COLLISION_STOP,
    DRIVE_RECOVERS,
    NOT_AVOIDED,
)


@pytest.mark.parametrize("word", [*DriveFailure, *ERRORS])
def test_it_names_each_failure_and_each_error(word: str) -> None:
    assert str(word) in PAGE


def test_each_row_names_an_existing_test() -> None:
    table = PAGE.split("\n## ")[0]
    rows = [line for line in table.splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 15
    for row in rows:
        named = re.search(r"`(test_\w+\.py)::(test_\w+)` \|$", row)
        assert named, row
        assert f"def {named[2]}(" in (TESTS / named[1]).read_text(encoding="utf-8"), row
