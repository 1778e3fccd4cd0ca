"""Answers to robots that request a zone or a corridor."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import count

import pytest

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
from support.honest_robot import HonestRobot

pytestmark = pytest.mark.clause("6.9")

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
ONE, TWO = RobotKey("ACME", "one"), RobotKey("ACME", "two")


class Desk:
    def __init__(self, **settings: object) -> None:
        self.desk = ReleaseManager(FleetSettings.model_validate(settings), lambda: NOON)
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
        self.desk.on_state(robot, asking)

    def answers(self, *, all_known: bool = True) -> dict[str, str]:
        told = self.desk.answers(
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
    desk = Desk()
    desk.ask(ONE, gate("a"))
    desk.ask(TWO, gate("b"))
    assert desk.answers() == {"a": "GRANTED", "b": "QUEUED"}
    assert desk.answers() == {}

    desk.ask(ONE, gate("a", "GRANTED"))
    assert desk.answers() == {}
    desk.ask(ONE)
    assert desk.answers() == {"b": "GRANTED"}


def test_other_zones_do_not_matter() -> None:
    desk = Desk()
    desk.ask(ONE, gate("a"))
    desk.ask(TWO, gate("b", zone_id="other"))

    assert desk.answers() == {"a": "GRANTED", "b": "GRANTED"}


def test_a_robot_that_lost_its_release_inside_still_holds_the_zone() -> None:
    desk = Desk()
    desk.ask(ONE, gate("a", "EXPIRED"))
    desk.ask(TWO, gate("b"))

    assert desk.answers() == {"a": "GRANTED", "b": "QUEUED"}


def test_a_grant_that_the_robot_does_not_show_is_resent() -> None:
    desk = Desk(resend_after=2)
    desk.ask(ONE, gate("a"))
    assert desk.answers() == {"a": "GRANTED"}
    desk.now += 1.9
    assert desk.answers() == {}
    desk.now += 0.1
    assert desk.answers() == {"a": "GRANTED"}
    desk.ask(ONE, gate("a", "GRANTED"))
    desk.now += 10
    assert desk.answers() == {}


def test_answers_are_resent_with_growing_delays() -> None:
    desk = Desk(resend_after=1, resend_at_most_after=4)
    desk.ask(ONE, gate("a"))
    times = []
    for _ in range(40):
        if desk.answers():
            times.append(desk.now - 100.0)
        desk.now += 0.5

    assert times == [0.0, 1.0, 3.0, 7.0, 11.0, 15.0, 19.0]


def test_nothing_is_sent_to_an_unreachable_robot() -> None:
    desk = Desk()
    desk.ask(ONE, gate("a"))
    desk.away.add(ONE)
    assert desk.answers() == {}
    desk.away.clear()
    assert desk.answers() == {"a": "GRANTED"}


def test_a_robot_may_request_several_paths_through_a_zone() -> None:
    desk = Desk()
    desk.ask(ONE, gate("left"), gate("right"))
    desk.ask(TWO, gate("b"))
    assert desk.answers() == {"left": "GRANTED", "right": "GRANTED", "b": "QUEUED"}

    desk.ask(ONE, gate("right", "GRANTED"))
    assert desk.answers() == {}
    desk.ask(ONE)
    assert desk.answers() == {"b": "GRANTED"}


def test_the_second_holder_of_a_zone_is_revoked_after_a_restart() -> None:
    desk = Desk(resend_after=2)
    desk.ask(ONE, gate("a", "GRANTED"))
    desk.ask(TWO, gate("b", "GRANTED"))
    assert desk.answers() == {"b": "REVOKED"}
    desk.now += 2
    assert desk.answers() == {"b": "REVOKED"}, "it does not show it"

    desk.ask(TWO, gate("b", "REVOKED"))
    desk.now += 10
    assert desk.answers() == {}
    desk.ask(ONE)
    assert desk.answers() == {"b": "GRANTED"}, "it is still inside, and now alone"


def test_grants_are_revoked_under_policy_none() -> None:
    desk = Desk(release_policy=ReleasePolicy.NONE)
    desk.ask(ONE, gate("a", "GRANTED"))

    assert desk.answers() == {"a": "REVOKED"}


def test_a_new_request_of_the_same_robot_is_answered_separately() -> None:
    desk = Desk()
    desk.ask(ONE, gate("a"))
    desk.answers()

    desk.ask(ONE, gate("a2"))

    assert desk.answers() == {"a2": "GRANTED"}


@pytest.mark.clause("6.9/restart")
def test_nothing_is_granted_before_all_robots_have_reported() -> None:
    desk = Desk()
    desk.ask(ONE, gate("a"))
    assert desk.answers(all_known=False) == {"a": "QUEUED"}

    desk.ask(TWO, gate("b", "GRANTED"))

    assert desk.answers() == {}
    desk.ask(TWO)
    assert desk.answers() == {"a": "GRANTED"}


def test_a_lease_is_renewed_before_it_ends() -> None:
    desk = Desk(release_lease=10.0)
    desk.ask(ONE, gate("a"))
    (answer,) = next(desk.desk.answers(desk.now, all_known=True, reachable=lambda _: True)).responses
    assert answer.lease_expiry is not None
    assert (answer.lease_expiry - NOON).total_seconds() == 10.0
    desk.ask(ONE, gate("a", "GRANTED"))
    desk.now += 4.9
    assert desk.answers() == {}
    desk.now += 0.2
    assert desk.answers() == {"a": "GRANTED"}


def test_an_earlier_lease_is_renewed_after_a_restart() -> None:
    desk = Desk(release_lease=10.0)
    desk.ask(ONE, gate("a", "GRANTED"))

    assert desk.answers() == {"a": "GRANTED"}
    assert desk.answers() == {}


@pytest.mark.parametrize(
    ("policy", "grant"), [(ReleasePolicy.ALL, "GRANTED"), (ReleasePolicy.NONE, "REJECTED")]
)
def test_a_policy_may_admit_all_robots_or_none(policy: ReleasePolicy, grant: str) -> None:
    desk = Desk(release_policy=policy)
    desk.ask(ONE, gate("a"))
    desk.ask(TWO, gate("b"))

    assert desk.answers() == {"a": grant, "b": grant}


@pytest.mark.clause("6.6.10")
def test_a_corridor_is_granted_to_one_robot_at_a_time() -> None:
    desk = Desk()
    for robot, request_id in ((ONE, "a"), (TWO, "b")):
        desk.ask(robot, corridor(request_id))

    assert desk.answers() == {"a": "GRANTED", "b": "QUEUED"}


@pytest.mark.clause("6.6.10")
@pytest.mark.parametrize("policy", ReleasePolicy)
def test_a_corridor_in_the_horizon_is_not_granted_before_its_edge_is_released(policy: ReleasePolicy) -> None:
    desk = Desk(release_policy=policy)

    desk.ask(ONE, corridor("a"), edges=(EdgeState(edge_id="A-B", sequence_id=1, released=False),))
    assert desk.answers() == {}

    desk.ask(ONE, corridor("a"), edges=(EdgeState(edge_id="A-B", sequence_id=1, released=True),))
    assert desk.answers() == {"a": "REJECTED" if policy is ReleasePolicy.NONE else "GRANTED"}


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

    def told(now: float) -> dict[str, str]:
        messages = (each for each in fleet.tick(now) if isinstance(each, PublishResponses))
        return {each.request_id: each.grant_type.value for message in messages for each in message.responses}

    assert told(5.0) == {"a": "GRANTED", "b": "QUEUED"}, "the broker may know of more robots"
    assert told(6.0)["b"] == "GRANTED"
