"""Answers to robots that request a zone or a corridor."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import chain, count
from typing import Any

import pytest

from nena_conversations.kit.honest_robot import HonestRobot
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.outputs import PublishResponses
from nena_order_service.fleet.settings import FleetSettings, ReleasePolicy
from nena_order_service.fleet.zones import ReleaseManager
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.request import (
    EdgeRequest,
    EdgeRequestType,
    RequestStatus,
    ZoneRequest,
    ZoneRequestType,
)
from nena_shared.vda5050.state import EdgeState
from nena_shared.vda5050.topics import RobotKey

pytestmark = pytest.mark.clause("6.9")

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
ONE, TWO = RobotKey("ACME", "one"), RobotKey("ACME", "two")


class Releases:
    def __init__(self, **settings: object) -> None:
        self.manager = ReleaseManager(FleetSettings.model_validate(settings), lambda: NOON)
        self.now = 100.0
        self.away: set[RobotKey] = set()

    def ask(
        self, robot: RobotKey, *requests: ZoneRequest | EdgeRequest, edges: tuple[EdgeState, ...] = ()
    ) -> None:
        state = HonestRobot(key=robot, version="3.0.0").state()
        zones = tuple(each for each in requests if isinstance(each, ZoneRequest))
        asked = tuple(each for each in requests if isinstance(each, EdgeRequest))
        asking = state.model_copy(
            update={"edge_states": edges, "zone_requests": zones, "edge_requests": asked}
        )
        self.manager.on_state(robot, asking)

    def answers(self, *, all_known: bool = True) -> dict[str, str]:
        told = self.manager.take_due_answers(
            self.now, all_known=all_known, reachable=lambda robot: robot not in self.away
        )
        return {each.request_id: each.grant_type.value for one in told for each in one.responses}


def gate(request_id: str, status: str = "REQUESTED", zone_id: str = "gate") -> ZoneRequest:
    return ZoneRequest(
        request_id=request_id,
        request_type=ZoneRequestType.ACCESS,
        zone_id=zone_id,
        zone_set_id="s1",
        request_status=RequestStatus(status),
    )


def corridor(request_id: str) -> EdgeRequest:
    return EdgeRequest(
        request_id=request_id,
        request_type=EdgeRequestType.CORRIDOR,
        edge_id="A-B",
        sequence_id=1,
        request_status=RequestStatus.REQUESTED,
    )


def test_one_robot_is_admitted_and_the_next_waits_until_it_has_left() -> None:
    releases = Releases()
    releases.ask(ONE, gate("a"))
    releases.ask(TWO, gate("b"))
    assert releases.answers() == {"a": "GRANTED", "b": "QUEUED"}
    assert releases.answers() == {}

    releases.ask(ONE, gate("a", "GRANTED"))
    assert releases.answers() == {}
    releases.ask(ONE)
    assert releases.answers() == {"b": "GRANTED"}


ALL, NONE = {"release_policy": ReleasePolicy.ALL}, {"release_policy": ReleasePolicy.NONE}


@pytest.mark.clause("6.6.10")
@pytest.mark.parametrize(
    ("settings", "one", "two", "answers"),
    [
        pytest.param({}, gate("a"), gate("b", zone_id="other"), "GRANTED GRANTED", id="two zones"),
        pytest.param({}, gate("a", "EXPIRED"), gate("b"), "GRANTED QUEUED", id="inside without release"),
        pytest.param({}, gate("a"), gate("b", "GRANTED"), "QUEUED -", id="inside before"),
        pytest.param({}, corridor("a"), corridor("b"), "GRANTED QUEUED", id="one corridor"),
        pytest.param(ALL, gate("a"), gate("b"), "GRANTED GRANTED", id="all are admitted"),
        pytest.param(NONE, gate("a"), gate("b"), "REJECTED REJECTED", id="none is admitted"),
        pytest.param(NONE, gate("a", "GRANTED"), gate("b"), "REVOKED REJECTED", id="nor stays inside"),
    ],
)
def test_the_first_answers_to_two_robots(
    settings: dict[str, Any], one: ZoneRequest | EdgeRequest, two: ZoneRequest | EdgeRequest, answers: str
) -> None:
    releases = Releases(**settings)
    releases.ask(ONE, one)
    releases.ask(TWO, two)

    expected = dict(zip("ab", answers.split(), strict=True))
    assert releases.answers() == {name: answer for name, answer in expected.items() if answer != "-"}


def test_a_grant_that_the_robot_does_not_show_is_resent() -> None:
    releases = Releases(resend_after=2)
    releases.ask(ONE, gate("a"))
    assert releases.answers() == {"a": "GRANTED"}
    releases.now += 1.9
    assert releases.answers() == {}
    releases.now += 0.1
    assert releases.answers() == {"a": "GRANTED"}
    releases.ask(ONE, gate("a", "GRANTED"))
    releases.now += 10
    assert releases.answers() == {}


def test_answers_are_resent_with_growing_delays() -> None:
    releases = Releases(resend_after=1, resend_at_most_after=4)
    releases.ask(ONE, gate("a"))
    times = []
    for _ in range(40):
        if releases.answers():
            times.append(releases.now - 100.0)
        releases.now += 0.5

    assert times == [0.0, 1.0, 3.0, 7.0, 11.0, 15.0, 19.0]


def test_nothing_is_sent_to_an_unreachable_robot() -> None:
    releases = Releases()
    releases.ask(ONE, gate("a"))
    releases.away.add(ONE)
    assert releases.answers() == {}
    releases.away.clear()
    assert releases.answers() == {"a": "GRANTED"}


def test_a_robot_may_request_several_paths_through_a_zone() -> None:
    releases = Releases()
    releases.ask(ONE, gate("left"), gate("right"))
    releases.ask(TWO, gate("b"))
    assert releases.answers() == {"left": "GRANTED", "right": "GRANTED", "b": "QUEUED"}

    releases.ask(ONE, gate("right", "GRANTED"))
    assert releases.answers() == {}
    releases.ask(ONE)
    assert releases.answers() == {"b": "GRANTED"}


def test_the_second_holder_of_a_zone_is_revoked_after_a_restart() -> None:
    releases = Releases(resend_after=2)
    releases.ask(ONE, gate("a", "GRANTED"))
    releases.ask(TWO, gate("b", "GRANTED"))
    assert releases.answers() == {"b": "REVOKED"}
    releases.now += 2
    assert releases.answers() == {"b": "REVOKED"}, "it does not show it"

    releases.ask(TWO, gate("b", "REVOKED"))
    releases.now += 10
    assert releases.answers() == {}
    releases.ask(ONE)
    assert releases.answers() == {"b": "GRANTED"}, "it is still inside, and now alone"


def test_a_new_request_of_the_same_robot_is_answered_separately() -> None:
    releases = Releases()
    releases.ask(ONE, gate("a"))
    releases.answers()

    releases.ask(ONE, gate("a2"))

    assert releases.answers() == {"a2": "GRANTED"}


def test_a_lease_is_renewed_before_it_ends() -> None:
    releases = Releases(release_lease=10.0)
    releases.ask(ONE, gate("a"))
    (answer,) = next(
        releases.manager.take_due_answers(releases.now, all_known=True, reachable=lambda _: True)
    ).responses
    assert answer.lease_expiry is not None
    assert (answer.lease_expiry - NOON).total_seconds() == 10.0
    releases.ask(ONE, gate("a", "GRANTED"))
    releases.now += 4.9
    assert releases.answers() == {}
    releases.now += 0.2
    assert releases.answers() == {"a": "GRANTED"}


def test_an_earlier_lease_is_renewed_after_a_restart() -> None:
    releases = Releases(release_lease=10.0)
    releases.ask(ONE, gate("a", "GRANTED"))

    assert releases.answers() == {"a": "GRANTED"}
    assert releases.answers() == {}


@pytest.mark.clause("6.6.10")
@pytest.mark.parametrize("policy", ReleasePolicy)
def test_a_corridor_in_the_horizon_is_not_granted_before_its_edge_is_released(policy: ReleasePolicy) -> None:
    releases = Releases(release_policy=policy)

    releases.ask(ONE, corridor("a"), edges=(EdgeState(edge_id="A-B", sequence_id=1, released=False),))
    assert releases.answers() == {}

    releases.ask(ONE, corridor("a"), edges=(EdgeState(edge_id="A-B", sequence_id=1, released=True),))
    assert releases.answers() == {"a": "REJECTED" if policy is ReleasePolicy.NONE else "GRANTED"}


@pytest.mark.clause("6.9/restart")
def test_the_controller_answers_once_all_robots_have_reported() -> None:
    numbers = count()
    fleet = FleetController(FleetSettings(), new_id=lambda: str(next(numbers)), utc_now=lambda: NOON)
    one, two = (HonestRobot(key=key, version="3.0.0") for key in (ONE, TWO))
    one.zone_requests = (gate("a"),)
    fleet.on_broker(connected=True, now=0.0)
    for robot in (one, two):
        fleet.on_connection(robot.key, robot.connection(ConnectionState.ONLINE), 0.0)

    def answers(robot: HonestRobot, now: float) -> list[str]:
        outputs = fleet.on_state(robot.key, robot.state(now), now)
        told = [each for each in outputs if isinstance(each, PublishResponses)]
        return [response.grant_type.value for each in told for response in each.responses]

    assert answers(one, 1.0) == ["QUEUED"]
    assert answers(two, 2.0) == ["GRANTED"]
    fleet.on_broker(connected=False, now=3.0)
    two.zone_requests = (gate("b", zone_id="other"),)
    assert answers(two, 4.0) == []
    fleet.on_broker(connected=True, now=5.0)

    def grants(now: float) -> dict[str, str]:
        outputs = chain.from_iterable(fleet.tick(now))
        messages = (each for each in outputs if isinstance(each, PublishResponses))
        return {each.request_id: each.grant_type.value for message in messages for each in message.responses}

    assert grants(5.0) == {"a": "GRANTED", "b": "QUEUED"}, "the broker may know of more robots"
    assert grants(6.0)["b"] == "GRANTED"
