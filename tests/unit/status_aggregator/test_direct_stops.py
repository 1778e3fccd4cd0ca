"""Stops without the order service, over a link that only notes what is published."""

from __future__ import annotations

import json
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from nena_shared.fleet_api.stops import StopEndRequest, StopRequest
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from nena_status_aggregator.direct_stops import DirectStops
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Timestamp
from support.clocks import ManualClock
from support.fleet_examples import START, connection
from support.fleet_records import state

ANNA = StopRequest(by="Anna", reason="fire drill")
OVER = StopEndRequest(by="Ben", reason="over")
TOPICS = FleetTopics()
A, B, C = (RobotKey("ACME", name) for name in "ABC")


class Link:
    """Notes what is published, and returns retained messages like a broker."""

    state = SimpleNamespace(connected=True)

    def __init__(self) -> None:
        self.published: list[Outbound] = []
        self.handler: Callable[[Inbound], None] = lambda _: None

    def subscribe(self, _topic: str, handler: Callable[[Inbound], None], **_: Any) -> None:
        self.handler = handler

    def publish(self, message: Outbound) -> None:
        self.published.append(message)
        if message.retain:
            self.handler(Inbound(message.topic, message.payload, retained=False))


class Site:
    """Direct stops of an aggregator that sees some robots."""

    def __init__(self, **paused: bool) -> None:
        self.clock = ManualClock(start=START)
        self.number = 0
        self.link = Link()
        self.model = FleetModel(ModelLimits())
        for name, is_paused in paused.items():
            self.report(RobotKey("ACME", name), paused=is_paused)
        self.stops = DirectStops(cast("MqttLink", self.link), self.model, TOPICS, self.clock)

    def report(self, robot: RobotKey, *, paused: bool, version: str = "2.1.0") -> None:
        """Let a robot report whether it is paused."""
        self.clock.advance(1)
        at = Timestamp.of(self.clock)
        self.model.on_connection(robot, connection(robot=robot), at)
        self.number += 1
        self.model.on_state(robot, state(self.number, robot=robot, at=float(self.number), paused=paused), at)
        scheme = TopicScheme("uagv" if version < "3" else "vda5050", f"v{version[0]}")
        self.model.on_source(robot, scheme, version)

    def later(self, seconds: float = 3) -> list[tuple[str, str]]:
        """Let time pass; return what robots are sent meanwhile."""
        already = len(self.link.published)
        self.clock.advance(seconds)
        self.stops.pause_and_release()
        return self.sent(already)

    def sent(self, first: int = 0) -> list[tuple[str, str]]:
        """Return the serial numbers and actions of what was published to robots."""
        return [
            (each.topic.split("/")[3], json.loads(each.payload)["actions"][0]["actionType"])
            for each in self.link.published[first:]
            if each.topic.endswith("/instantActions")
        ]

    def retained(self) -> dict[str, Any]:
        """Return the last retained stop."""
        found: dict[str, Any] = json.loads([each for each in self.link.published if each.retain][-1].payload)
        return found


def test_each_robot_is_asked_until_it_reports_the_pause() -> None:
    site = Site(A=False, B=False, C=True)
    status = site.stops.begin(ANNA, "anna@example")
    assert site.sent() == [("A", "startPause"), ("B", "startPause")]
    assert (status.vehicles, status.paused, [each.vehicle for each in status.not_paused]) == (
        3,
        1,
        ["A", "B"],
    )
    assert (site.retained()["user"], sorted(site.retained()["paused"])) == (
        "anna@example",
        [["ACME", "A"], ["ACME", "B"]],
    )

    site.report(A, paused=True)
    assert site.later() == [("B", "startPause")]
    (shown,) = site.model.direct_stops
    assert (shown.paused, [str(each.reason) for each in shown.not_paused]) == (
        2,
        ["has not confirmed the pause yet"],
    )


def test_stop_is_retained_before_the_first_robot_is_told() -> None:
    site = Site(A=False)
    site.stops.begin(ANNA, "anonymous")
    assert [each.retain for each in site.link.published] == [True, True, False]
    assert json.loads(site.link.published[1].payload)["paused"] == [["ACME", "A"]]


def test_only_robots_that_the_stop_has_paused_continue() -> None:
    site = Site(A=False, C=True)
    name = site.stops.begin(ANNA, "anonymous").name
    site.report(A, paused=True)
    stop = site.stops.find(name)
    assert stop
    before = len(site.link.published)
    assert site.stops.end(stop, OVER, "anonymous").ended
    assert site.sent(before) == [("A", "stopPause")]
    assert site.stops.find(name) is None
    site.report(A, paused=False)
    assert site.later() == []
    site.report(A, paused=True)
    assert site.later() == [], "somebody else has paused it since"


def test_robot_that_comes_later_is_paused_and_one_that_is_gone_is_named() -> None:
    site = Site(A=False)
    site.stops.begin(ANNA, "anonymous")
    site.report(B, paused=False, version="3.0.0")
    at = Timestamp.of(site.clock)
    site.model.on_connection(A, connection(state=ConnectionState.CONNECTION_BROKEN, robot=A), at)
    assert site.later() == [("B", "startPause")]
    assert site.link.published[-1].topic == "vda5050/v3/ACME/B/instantActions"
    (shown,) = site.model.direct_stops
    assert [(each.vehicle, each.coded_reason.code) for each in shown.not_paused if each.coded_reason] == [
        ("A", "connection_lost"),
        ("B", "pause_unconfirmed"),
    ]


def test_stops_of_another_aggregator_pause_our_robots_and_end_here_as_well() -> None:
    ours, other = Site(A=False), Site(B=False)
    name = other.stops.begin(ANNA, "anonymous").name
    topic = TOPICS.direct_stop(name)
    ours.link.handler(Inbound(topic, other.link.published[-2].payload, retained=True))
    assert ours.later() == [("A", "startPause")]
    assert sorted(ours.retained()["paused"]) == [["ACME", "A"], ["ACME", "B"]]
    ours.report(A, paused=True)

    stop = other.stops.find(name)
    assert stop
    other.stops.end(stop, OVER, "anonymous")
    before = len(ours.link.published)
    ended = [each for each in other.link.published if each.retain][-1].payload
    ours.link.handler(Inbound(topic, ended, retained=False))
    ours.stops.pause_and_release()
    assert ours.sent(before) == [("A", "stopPause")]
    merged = ours.retained()
    assert merged["endedBy"] == "Ben"
    assert {each[1] for each in merged["paused"]} == {"A", "B"}


@pytest.mark.parametrize("payload", [b"", b"{", b"[]"])
def test_stop_that_was_taken_over_is_gone_and_an_unreadable_one_is_none(payload: bytes) -> None:
    site = Site(A=True)
    name = site.stops.begin(ANNA, "anonymous").name
    site.link.handler(Inbound(TOPICS.direct_stop(name if not payload else "x"), payload, retained=False))
    assert (site.stops.find(name) is None) is (not payload)
    assert site.stops.find("x") is None
