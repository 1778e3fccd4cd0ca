from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.share import Share

NAMES = st.builds(RobotKey, st.text(min_size=1), st.text(min_size=1))


@given(robot=NAMES, of=st.integers(1, 20))
def test_each_robot_is_in_exactly_one_share(robot: RobotKey, of: int) -> None:
    shares = [Share.read(f"{number}/{of}") for number in range(1, of + 1)]
    assert [share.has(robot) for share in shares].count(True) == 1


def test_shares_are_of_about_the_same_size() -> None:
    robots = [RobotKey("ACME", f"robot-{number:04d}") for number in range(900)]
    sizes = [sum(Share(number, 3).has(robot) for robot in robots) for number in (1, 2, 3)]
    assert min(sizes) > 250


def test_a_robot_stays_in_its_share_for_ever() -> None:
    assert [str(share) for share in (Share(1, 2), Share(2, 2)) if share.has(RobotKey("ACME", "r1"))] == [
        "2/2"
    ]


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "1/0", "-1/2", "1/2/3", "a/b", "1/1000", "1/²"])
def test_what_is_no_share_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match="1/2 for the first of two"):
        Share.read(text)
