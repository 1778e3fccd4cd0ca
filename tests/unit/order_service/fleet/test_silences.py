from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.fleet.robot import Silences
from nena_shared.vda5050.topics import RobotKey

ONE, OTHER = RobotKey("NeNa", "one"), RobotKey("NeNa", "other")


def test_a_robot_is_given_once_and_only_after_its_moment() -> None:
    silences = Silences()
    silences.expect(ONE, 10.0)
    assert list(silences.passed(10.0)) == []
    assert list(silences.passed(10.1)) == [ONE]
    assert list(silences.passed(20.0)) == []


def test_what_is_heard_meanwhile_moves_nothing_until_the_robot_was_given() -> None:
    silences = Silences()
    silences.expect(ONE, 10.0)
    silences.expect(ONE, 15.0)
    assert list(silences.passed(12.0)) == [ONE]
    silences.expect(ONE, 15.0)
    assert list(silences.passed(14.0)) == []
    assert list(silences.passed(16.0)) == [ONE]


def test_a_sooner_moment_counts() -> None:
    silences = Silences()
    silences.expect(ONE, 10.0)
    silences.expect(ONE, 5.0)
    assert list(silences.passed(6.0)) == [ONE]
    assert list(silences.passed(11.0)) == []


def test_a_moment_that_was_looked_at_is_not_given_again() -> None:
    silences = Silences()
    silences.expect(ONE, 5.0)
    for robot in silences.passed(10.0):
        silences.expect(robot, 5.0)
    silences.expect(ONE, 5.0)
    assert list(silences.passed(11.0)) == []


@given(st.lists(st.tuples(st.sampled_from((ONE, OTHER)), st.floats(0, 100)), max_size=20), st.floats(0, 100))
def test_all_whose_soonest_moment_has_passed_are_given(
    expected: list[tuple[RobotKey, float]], now: float
) -> None:
    silences = Silences()
    for robot, at in expected:
        silences.expect(robot, at)
    soonest = {robot: min(at for other, at in expected if other == robot) for robot, _ in expected}
    found = list(silences.passed(now))
    assert sorted(found) == sorted(robot for robot, at in soonest.items() if at < now)
