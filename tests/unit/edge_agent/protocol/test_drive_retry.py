"""A drive that fails is tried again, as often as the settings say."""

from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import DriveFailed, DriveFailure, Halted, NavigationReport
from nena_edge_agent.protocol.conditions import DRIVE_RETRIED
from nena_edge_agent.protocol.events import Halt, TimePassed
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from support.robot_core import Bench, action, order


@pytest.fixture
def bench() -> Bench:
    bench = Bench(drive_retries=2, retry_wait=5.0)
    bench.send(order("n0", "n1", "n2"))
    return bench


def fail(bench: Bench, failure: DriveFailure = DriveFailure.ABORTED) -> None:
    bench.do(DriveFailed(bench.goal.generation, failure, "no way"))


def later(bench: Bench, seconds: float) -> None:
    bench.now += seconds
    bench.do(TimePassed())


@pytest.mark.clause("6.6.5.1/keeps")
def test_is_tried_again_after_a_while_and_fails_after_the_last_try(bench: Bench) -> None:
    for number in (1, 2):
        fail(bench)
        (error,) = bench.state.errors
        assert (error.error_type, error.error_level) == (DRIVE_RETRIED, ErrorLevel.WARNING)
        assert f"try {number} of 2" in str(error.error_description)
        assert "no way (ABORTED)" in str(error.error_description)
        assert bench.waits()
        later(bench, 4.9)
        assert len(bench.goals) == number
        later(bench, 0.2)
        assert len(bench.goals) == number + 1
        assert bench.errors == [DRIVE_RETRIED]
        assert not bench.waits()

    fail(bench)
    assert bench.errors == [ErrorType.NODE_UNREACHABLE]
    later(bench, 60.0)
    assert len(bench.goals) == 3


def test_the_next_node_has_its_own_tries(bench: Bench) -> None:
    fail(bench)
    later(bench, 5.0)
    bench.arrive()
    assert bench.errors == []
    for _ in range(2):
        fail(bench)
        later(bench, 5.0)
    assert (bench.errors, bench.goal.pose.x) == ([DRIVE_RETRIED], 20.0)


@pytest.mark.parametrize("failure", [DriveFailure.CANCELED_FROM_OUTSIDE])
def test_what_somebody_wanted_is_not_undone(bench: Bench, failure: DriveFailure) -> None:
    fail(bench, failure)
    assert bench.errors == [ErrorType.NODE_UNREACHABLE]


def test_an_order_that_waits_for_a_try_can_be_cancelled(bench: Bench) -> None:
    fail(bench)
    bench.instant(action("c", "NONE", "cancelOrder"))
    assert (bench.status("c"), bench.errors) == ("FINISHED", [])
    later(bench, 10.0)
    assert len(bench.goals) == 1


def test_a_drive_whose_navigation_has_gone_is_tried_when_it_is_back(bench: Bench) -> None:
    bench.do(NavigationReport(available=False, reason="gone"))
    fail(bench, DriveFailure.NAVIGATION_GONE)
    assert Halt() in bench.effects
    later(bench, 60.0)
    assert len(bench.goals) == 1
    bench.do(Halted())
    bench.do(NavigationReport(available=True, reason=""))
    assert (len(bench.goals), bench.errors) == (2, [DRIVE_RETRIED])


def test_a_pause_lasts_over_the_time_of_a_try(bench: Bench) -> None:
    fail(bench)
    bench.instant(action("p", "NONE", "startPause"))
    later(bench, 10.0)
    assert len(bench.goals) == 1
    bench.instant(action("s", "NONE", "stopPause"))
    assert len(bench.goals) == 2


@pytest.mark.clause("6.6.5.1/keeps")
def test_an_update_gives_all_tries_back(bench: Bench) -> None:
    for _ in range(2):
        fail(bench)
        later(bench, 5.0)
    fail(bench)
    bench.send(order("n2", "n3", update=1, first=4))
    fail(bench)
    assert bench.errors == [DRIVE_RETRIED]
