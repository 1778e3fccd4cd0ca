from __future__ import annotations

import pytest

from nena_edge_agent.ros.navigation_error import reason_of


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (105, "does not get on"),
        (208, "no way to the place"),
        (308, "no way to the place"),
        (309, "names no places"),
        (503, "smoother"),
        (701, "recovery"),
        (9001, "navigator"),
        (42, "does not know"),
    ],
)
def test_says_what_a_code_means_and_the_code(code: int, text: str) -> None:
    reason = str(reason_of(code))
    assert text in reason
    assert f"error code {code}" in reason


def test_adds_what_nav2_says_itself() -> None:
    assert "Collision ahead" in str(reason_of(106, "Collision ahead"))


def test_no_code_is_no_reason() -> None:
    assert reason_of(0) is None
