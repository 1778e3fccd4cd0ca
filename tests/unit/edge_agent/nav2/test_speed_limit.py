"""Which limit Nav2's controller gets, and when it is sent."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from nena_edge_agent.driver.port import SessionState
from nena_edge_agent.nav2.speed_limit import REPEATED_AFTER, SLOWEST, SpeedLimiter

OWN = 1.0


class Controller:
    """A session and its node with one publisher, and those who listen to it."""

    state = SessionState.ACTIVE

    def __init__(self) -> None:
        self.sent: list[float] = []
        self.listeners: list[bytes] = [b"controller"]

    def create_publisher(self, *_: Any, **__: Any) -> Any:
        return SimpleNamespace(
            get_subscription_count=lambda: len(self.listeners),
            publish=lambda message: self.sent.append(message.speed_limit),
        )

    def get_subscriptions_info_by_topic(self, _topic: str) -> list[Any]:
        return [SimpleNamespace(endpoint_gid=each) for each in self.listeners]


@pytest.fixture
def controller() -> Controller:
    return Controller()


@pytest.fixture
def limiter(controller: Controller, monkeypatch: pytest.MonkeyPatch) -> SpeedLimiter:
    monkeypatch.setattr("nena_edge_agent.nav2.speed_limit.interface", lambda _name: SimpleNamespace)
    made = SpeedLimiter("speed_limit", OWN)
    made.enter(controller, controller)  # type: ignore[arg-type]
    return made


pytestmark = pytest.mark.ros


def test_the_lower_of_two_limits_applies(limiter: SpeedLimiter, controller: Controller) -> None:
    limiter.limit_goal(0.5)
    limiter.limit_place(0.3)
    limiter.limit_place(None)
    limiter.limit_goal(None)
    assert controller.sent == [0.5, 0.3, 0.5, 0.0]


@pytest.mark.parametrize("limit", [OWN, 2.0])
def test_a_limit_above_the_own_speed_would_make_the_robot_faster_and_is_none(
    limiter: SpeedLimiter, controller: Controller, limit: float
) -> None:
    limiter.limit_goal(limit)
    assert controller.sent == [0.0]


@pytest.mark.parametrize("limit", [-0.5, -math.inf, math.nan, 0.0])
def test_a_limit_with_which_the_robot_would_reverse_is_the_lowest_one(
    limiter: SpeedLimiter, controller: Controller, limit: float
) -> None:
    limiter.limit_goal(0.5)
    limiter.limit_place(limit)
    limiter.limit_place(None)
    limiter.limit_goal(limit)
    assert controller.sent == [0.5, SLOWEST, 0.5, SLOWEST]


@pytest.mark.parametrize("limit", [math.inf, 1e308])
def test_an_endless_limit_is_none(limiter: SpeedLimiter, controller: Controller, limit: float) -> None:
    limiter.limit_goal(limit)
    limiter.limit_place(0.5)
    assert controller.sent == [0.0, 0.5]


def test_a_limit_of_zero_does_not_withdraw_the_limit(limiter: SpeedLimiter, controller: Controller) -> None:
    limiter.limit_place(0.0)
    assert controller.sent == [SLOWEST]


def test_a_controller_that_returns_gets_the_limit(limiter: SpeedLimiter, controller: Controller) -> None:
    limiter.check_controllers()
    limiter.check_controllers()
    assert controller.sent == [0.0]

    controller.listeners = [b"another one"]
    limiter.check_controllers()
    assert controller.sent == [0.0, 0.0]


def test_a_limit_that_holds_is_repeated(limiter: SpeedLimiter, controller: Controller) -> None:
    limiter.limit_goal(0.5)
    limiter.limit_goal(0.5)
    limiter.check_controllers()
    assert controller.sent == [0.5] * 3

    limiter.repeat_while_driving(10.0)
    limiter.repeat_while_driving(10.0 + REPEATED_AFTER / 2)
    limiter.repeat_while_driving(10.0 + REPEATED_AFTER)
    assert controller.sent == [0.5] * 5

    limiter.limit_goal(None)
    limiter.repeat_while_driving(20.0)
    limiter.check_controllers()  # the first one: it tells all
    limiter.check_controllers()
    assert controller.sent == [0.5] * 5 + [0.0]


def test_a_limit_of_an_earlier_run_stays_until_the_next_goal(
    limiter: SpeedLimiter, controller: Controller
) -> None:
    limiter.reclaim()
    limiter.check_controllers()
    limiter.limit_place(None)
    assert controller.sent == []

    limiter.limit_goal(0.4)
    assert controller.sent == [0.4]


def test_without_a_listener_a_goal_with_a_limit_has_a_problem(
    limiter: SpeedLimiter, controller: Controller
) -> None:
    controller.listeners = []
    assert "no node subscribes to speed_limit" in limiter.problem(0.4)
    assert limiter.problem(None) == limiter.problem(OWN) == ""
    controller.listeners = [b"controller"]
    assert limiter.problem(0.4) == ""


def test_a_controller_slower_than_the_settings_gets_no_limit_above_its_speed(
    limiter: SpeedLimiter, controller: Controller
) -> None:
    limiter.limit_goal(0.8)
    limiter.controller_drives(0.5)
    assert controller.sent == [0.8, 0.0]
    limiter.limit_goal(0.4)
    assert controller.sent == [0.8, 0.0, 0.4]


def test_a_controller_faster_than_the_settings_gets_limits_in_between(
    limiter: SpeedLimiter, controller: Controller
) -> None:
    limiter.limit_goal(1.5)
    limiter.controller_drives(2.0)
    assert controller.sent == [0.0, 1.5]
