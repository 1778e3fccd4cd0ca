"""Zones on a robot's way: kept out of, slowed down in, entered with a release only."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from nena_edge_agent.driver.port import Halted, KeepOutReport
from nena_edge_agent.protocol.events import (
    ActionReport,
    Halt,
    KeepOut,
    LimitSpeed,
    OperatingModeSwitched,
    ResponsesReceived,
    Started,
    TimePassed,
    ZoneSetReceived,
)
from nena_edge_agent.protocol.zone_sets import REQUEST_RETRY_DELAY
from nena_edge_agent.protocol.zones import KEEP_OUT_TIMEOUT
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import RULES
from nena_shared.vda5050.zone_set import (
    BidirectedLimitation,
    DirectedLimitation,
    Zone,
    ZoneReleaseLossBehavior,
)
from support.robot_core import Bench, action, at, order, position
from support.zones import responses, transfer, zone, zone_set

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
GATE = zone("gate", "RELEASE", 13, 17)


def with_zones(*zones: Zone, **capabilities: Any) -> Bench:
    """Return a robot with ``zones`` enabled."""
    made = Bench(rules=RULES["3.0.0"], **capabilities)
    made.do(Started(NOON))
    enable(made, *zones)
    return made


def enable(robot: Bench, *zones: Zone, zone_set_id: str = "s1") -> None:
    robot.do(ZoneSetReceived(transfer(*zones, zone_set_id=zone_set_id)))
    action_id = f"enable {zone_set_id}"
    robot.instant(action(action_id, "NONE", "enableZoneSet", zoneSetId=zone_set_id))
    assert robot.status(action_id) == "FINISHED"


def answer(robot: Bench, grant: str, *, lasting: float | None = None) -> None:
    """Answer the last request."""
    until = None if lasting is None else NOON + timedelta(seconds=lasting)
    robot.do(ResponsesReceived(responses(requests(robot)[-1][1], grant, until), NOON))


def requests(robot: Bench) -> list[tuple[str, str, str]]:
    return [
        (each.zone_id, each.request_id, each.request_status.value) for each in robot.state.zone_requests or ()
    ]


def wait(robot: Bench, seconds: float) -> None:
    robot.now += seconds
    assert robot.waits()
    robot.do(at(robot.core.robot.reports.pose.pose.x if robot.core.robot.reports.pose else 0.0))


class TestClosedZones:
    pytestmark = pytest.mark.clause("6.4")

    @pytest.mark.clause("6.4/BLOCKED", "6.4/LINEGUIDED", "6.1.4.8")
    @pytest.mark.parametrize("kind", ["BLOCKED", "LINE_GUIDED"])
    def test_an_order_through_a_blocked_zone_is_refused(self, kind: str) -> None:
        robot = with_zones(zone("wall", kind, 13, 17))

        robot.send(order("n0", "n1", "n2"))

        (entry,) = robot.state.errors
        assert entry.error_type == "NO_ROUTE_TO_TARGET"
        assert "zone 'wall'" in (entry.error_description or "")
        assert not robot.goals

    @pytest.mark.parametrize(("low", "refused"), [(0.31, False), (0.29, True)])
    def test_the_whole_footprint_stays_outside(self, low: float, *, refused: bool) -> None:
        robot = with_zones(zone("wall", "BLOCKED", 13, 17, low=low, high=5))

        robot.send(order("n0", "n1", "n2"))

        assert robot.errors == (["NO_ROUTE_TO_TARGET"] if refused else [])
        assert bool(robot.goals) is not refused

    @pytest.mark.clause("6.4.2")
    def test_zones_of_disabled_sets_are_ignored(self) -> None:
        robot = with_zones(zone("wall", "BLOCKED", 13, 17))
        enable(robot, zone("far", "BLOCKED", 70, 80), zone_set_id="s2")

        robot.send(order("n0", "n1", "n2"))

        assert robot.errors == []

    @pytest.mark.clause("6.4/BLOCKED", "6.6.5.4/unreachable")
    def test_a_zone_closed_during_the_drive_stops_the_robot_before_it(self) -> None:
        robot = with_zones(zone("far", "BLOCKED", 70, 80))
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        enable(robot, zone("wall", "BLOCKED", 13, 17), zone_set_id="s2")

        assert robot.effects_of(Halt)
        assert robot.errors == ["NODE_UNREACHABLE"]
        robot.halted()
        enable(robot, zone("far", "BLOCKED", 70, 80), zone_set_id="s3")
        assert robot.errors == []
        assert robot.goal.pose.x == 20.0

    @pytest.mark.clause("6.4/BLOCKED")
    def test_a_robot_inside_a_blocked_zone_does_not_drive(self) -> None:
        robot = with_zones(zone("far", "BLOCKED", 70, 80))
        robot.send(order("n0", "n1", "n2"))
        enable(robot, zone("here", "BLOCKED", -1, 1), zone_set_id="s2")

        assert robot.effects_of(Halt)
        assert "BLOCKED_ZONE_VIOLATION" in robot.errors
        robot.do(at(5.0))
        assert "BLOCKED_ZONE_VIOLATION" not in robot.errors


@pytest.mark.clause("6.4")
class TestSpeedLimit:
    @pytest.mark.clause("6.4/SPEEDLIMIT")
    def test_the_robot_slows_down_before_the_border_and_speeds_up_after_it(self) -> None:
        robot = with_zones(
            zone("slow", "SPEED_LIMIT", 4, 6, maximum_speed=0.4),
            zone("slower", "SPEED_LIMIT", 5, 6, maximum_speed=0.2),
            braking_distance=1.0,
        )
        robot.send(order("n0", "n1"))
        assert not robot.effects_of(LimitSpeed)

        for x in (2.0, 2.9, 3.9, 5.5, 6.6):
            robot.do(at(x))

        assert [each.speed for each in robot.effects_of(LimitSpeed)] == [0.4, 0.2, None]

    @pytest.mark.clause("6.4/SPEEDLIMIT", "6.4/others")
    def test_a_driver_without_speed_limits_refuses_speed_limit_zones(self) -> None:
        robot = Bench(rules=RULES["3.0.0"], limits_speed=False)

        robot.do(ZoneSetReceived(transfer(zone("slow", "SPEED_LIMIT", 4, 6, maximum_speed=0.4))))

        assert robot.errors == ["VALIDATION_FAILURE"]
        assert robot.state.zone_sets == ()


@pytest.mark.clause("6.4.3", "6.9")
class TestRelease:
    def test_it_waits_before_a_zone_until_granted_and_releases_it_after_leaving_it(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2", "n3"))
        assert requests(robot) == [("gate", "zone-1", "REQUESTED")], "one edge ahead"
        robot.arrive()
        assert [each.pose.x for each in robot.goals] == [10.0]

        answer(robot, "GRANTED")
        assert requests(robot) == [("gate", "zone-1", "GRANTED")]
        assert robot.goal.pose.x == 20.0
        robot.do(at(17.3))
        assert requests(robot) == [("gate", "zone-1", "GRANTED")]
        robot.do(at(17.5))

        assert requests(robot) == []

    def test_zones_of_the_horizon_are_not_requested(self) -> None:
        robot = with_zones(GATE)

        robot.send(order("n0", "n1", "n2", released=2))

        assert requests(robot) == []

    def test_a_queued_request_remains_requested(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))

        answer(robot, "QUEUED")

        assert requests(robot) == [("gate", "zone-1", "REQUESTED")]

    def test_after_a_rejection_the_zone_is_requested_again_later_with_another_id(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))

        answer(robot, "REJECTED")
        assert requests(robot) == []
        wait(robot, REQUEST_RETRY_DELAY - 1)
        assert requests(robot) == []
        wait(robot, 1.0)

        assert requests(robot) == [("gate", "zone-2", "REQUESTED")]

    @pytest.mark.clause("6.4.3/loss")
    def test_a_grant_revoked_before_the_zone_stops_the_robot(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED")
        robot.do(at(11.0))

        answer(robot, "REVOKED")

        assert robot.effects_of(Halt)
        assert requests(robot) == [("gate", "zone-2", "REQUESTED")]
        assert robot.errors == []

    @pytest.mark.clause("6.4.3/loss")
    def test_an_expired_lease_ends_the_release(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED", lasting=5)
        robot.do(at(15.0))
        wait(robot, 4.9)
        assert requests(robot) == [("gate", "zone-1", "GRANTED")]

        wait(robot, 0.2)

        assert requests(robot) == [("gate", "zone-1", "EXPIRED")]
        assert robot.errors == ["RELEASE_LOST"]
        assert robot.effects_of(Halt)

    def test_a_longer_lease_extends_a_grant(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED", lasting=5)
        answer(robot, "GRANTED", lasting=50)

        wait(robot, 10.0)

        assert requests(robot) == [("gate", "zone-1", "GRANTED")]

    @pytest.mark.clause("6.4.3/loss")
    @pytest.mark.parametrize(
        ("behavior", "stands"),
        [(None, True), ("STOP", True), ("CONTINUE", False), ("EVACUATE", False)],
    )
    def test_a_lost_release_follows_the_release_loss_behavior(
        self, behavior: str | None, *, stands: bool
    ) -> None:
        meets = ZoneReleaseLossBehavior(behavior) if behavior else None
        robot = with_zones(zone("gate", "RELEASE", 13, 17, release_loss_behavior=meets))
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED")
        robot.do(at(15.0))

        answer(robot, "REVOKED")

        assert requests(robot) == [("gate", "zone-1", "REVOKED")]
        assert bool(robot.effects_of(Halt)) is stands
        assert robot.errors == (["RELEASE_LOST"] if stands else ["RELEASE_LOSS_HANDLING"])
        robot.do(at(18.5))
        assert stands or robot.errors == []

    @pytest.mark.clause("6.4.3/loss")
    def test_a_robot_whose_base_does_not_leave_the_zone_stops(self) -> None:
        evacuated = ZoneReleaseLossBehavior.EVACUATE
        robot = with_zones(zone("gate", "RELEASE", 13, 21, release_loss_behavior=evacuated))
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED")
        robot.do(at(15.0))

        answer(robot, "REVOKED")

        assert robot.errors == ["RELEASE_LOST"]

    @pytest.mark.clause("6.4.3/loss")
    def test_a_new_grant_lets_the_robot_continue(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED")
        robot.do(at(15.0))
        answer(robot, "REVOKED")
        robot.halted()

        answer(robot, "GRANTED")

        assert robot.errors == []
        assert robot.goal.pose.x == 20.0
        assert robot.goal.generation == 3

    def test_all_requests_end_with_the_order(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        robot.instant(action("c", "NONE", "cancelOrder"))
        robot.halted()

        assert robot.status("c") == "FINISHED"
        assert requests(robot) == []

    @pytest.mark.parametrize("mode", [OperatingMode.INTERVENED, OperatingMode.MANUAL])
    def test_a_person_who_takes_over_ends_all_requests(self, mode: OperatingMode) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))

        robot.do(OperatingModeSwitched(mode))
        robot.halted()

        assert requests(robot) == []

    def test_a_robot_that_ends_its_order_in_the_zone_keeps_its_release(self) -> None:
        robot = with_zones(zone("gate", "RELEASE", 13, 25))
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED")
        robot.arrive()

        assert robot.idle
        assert requests(robot) == [("gate", "zone-1", "GRANTED")]

    @pytest.mark.clause("6.9/restart", "6.4.2")
    def test_zone_sets_and_requests_survive_a_restart(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED", lasting=5)

        again = Bench(memory=robot.core.memory(), rules=RULES["3.0.0"], ready=False)
        again.do(Started(NOON), at(15.0))

        assert again.state.zone_sets == robot.state.zone_sets
        assert requests(again) == [("gate", "zone-1", "GRANTED")]
        assert not again.effects_of(Halt)
        again.now += 6.0
        again.do(at(15.0))
        assert requests(again) == [("gate", "zone-1", "EXPIRED")]
        assert again.effects_of(Halt)  # navigation may still drive to the goal of before

    def test_a_response_to_an_unknown_request_is_ignored(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))

        robot.do(ResponsesReceived(responses("zone-99", "GRANTED"), NOON))

        assert requests(robot) == [("gate", "zone-1", "REQUESTED")]


@pytest.mark.clause("6.4")
def test_a_node_before_a_closed_zone_is_not_passed() -> None:
    robot = with_zones(GATE, strategy="pass_through")
    robot.send(order("n0", "n1", "n2"))

    robot.do(at(9.8))

    assert robot.nodes == ["n1", "n2"]


@pytest.mark.clause("6.4/BLOCKED", "6.6.5.4")
@pytest.mark.parametrize("place", [4.0, 14.0], ids=["on the way to it", "inside"])
def test_effects_of_zones_end_with_the_last_zone(place: float) -> None:
    robot = with_zones()
    robot.send(order("n0", "n1", "n2"))
    robot.arrive()
    robot.do(at(place))
    slow = zone("slow", "SPEED_LIMIT", 0, 17, maximum_speed=0.2)
    enable(robot, zone("wall", "BLOCKED", 13, 17), slow, zone_set_id="s2")
    robot.do(Halted())
    assert "NODE_UNREACHABLE" in robot.errors

    enable(robot, zone_set_id="empty")

    assert not robot.errors
    assert robot.effects_of(LimitSpeed)[-1].speed is None
    assert len(robot.goals) == 3


class TestLeasesAndRefusals:
    """Cases in which a robot must still report that it is in a zone, and must not be blocked for ever."""

    pytestmark = pytest.mark.clause("6.4.3", "6.9")

    def inside(self, *, lasting: float | None = None) -> Bench:
        """Return a robot that is in the gate with a release."""
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED", lasting=lasting)
        robot.do(at(15.0))
        return robot

    def test_a_robot_that_is_not_localised_reports_its_expired_lease(self) -> None:
        robot = self.inside(lasting=30)
        robot.do(at(15.0, localized=False), Halted())

        robot.now += 60
        robot.do(at(15.0, localized=False))

        assert requests(robot) == [("gate", "zone-1", "EXPIRED")]
        robot.do(at(15.0))
        assert requests(robot) == [("gate", "zone-1", "EXPIRED")]
        assert robot.errors == ["RELEASE_LOST"]

    def test_a_lease_that_expires_while_the_agent_is_down_is_reported_as_expired(self) -> None:
        memory = self.inside(lasting=30).core.memory()

        robot = Bench(rules=RULES["3.0.0"], memory=memory, ready=False)
        robot.do(Started(NOON + timedelta(seconds=60)))

        assert requests(robot) == [("gate", "zone-1", "EXPIRED")]

    def test_a_rejection_inside_the_zone_revokes_the_release(self) -> None:
        robot = self.inside()

        answer(robot, "REJECTED")

        assert robot.effects_of(Halt)
        assert requests(robot) == [("gate", "zone-1", "REVOKED")]
        assert robot.errors == ["RELEASE_LOST"]

    def test_a_robot_that_was_moved_out_of_the_zone_requests_it_again(self) -> None:
        robot = self.inside()
        answer(robot, "REVOKED")
        robot.do(Halted(), at(11.0))

        assert requests(robot) == [("gate", "zone-2", "REQUESTED")]
        assert not robot.errors
        answer(robot, "GRANTED")
        assert len(robot.goals) == 3

    def test_an_expired_grant_is_ignored_and_the_request_remains(self) -> None:
        robot = with_zones(GATE)
        robot.send(order("n0", "n1", "n2"))
        before = len(robot.effects)

        answer(robot, "GRANTED", lasting=-10)

        assert requests(robot) == [("gate", "zone-1", "REQUESTED")]
        assert len(robot.effects) == before

    @pytest.mark.parametrize("behavior", [ZoneReleaseLossBehavior.CONTINUE, ZoneReleaseLossBehavior.EVACUATE])
    def test_only_a_robot_inside_the_zone_continues_without_a_release(
        self, behavior: ZoneReleaseLossBehavior
    ) -> None:
        robot = with_zones(zone("gate", "RELEASE", 13, 17, release_loss_behavior=behavior))
        robot.send(order("n0", "n1", "n2"))
        robot.arrive()
        answer(robot, "GRANTED")
        robot.do(at(10.5, localized=False), Halted())
        answer(robot, "REVOKED")  # nobody knows whether the robot is in the gate
        given = len(robot.goals)

        robot.do(at(10.5))

        assert len(robot.goals) == given
        assert requests(robot) == [("gate", "zone-2", "REQUESTED")]


WALL = zone("wall", "BLOCKED", 13, 17)


def held(bench: Bench) -> dict[str, str]:
    return {each.zone_set_id: each.zone_set_status.value for each in bench.state.zone_sets or ()}


@pytest.fixture
def bench() -> Bench:
    return Bench(rules=RULES["3.0.0"])


@pytest.mark.clause("6.4.1", "6.6.5")
def test_the_same_id_is_refused_until_another_set_is_accepted(bench: Bench) -> None:
    bench.do(ZoneSetReceived(transfer(WALL)))
    bench.do(ZoneSetReceived(transfer(zone("other", "BLOCKED", 0, 1))))

    (entry,) = bench.state.errors
    assert (entry.error_type, entry.error_level.value) == ("DUPLICATE_ZONE_SET", "WARNING")
    assert ("zoneSetId", "s1") in {(e.reference_key, e.reference_value) for e in entry.error_references}
    bench.do(ZoneSetReceived(transfer(WALL, zone_set_id="s2")))
    assert bench.errors == []
    assert held(bench) == {"s1": "DISABLED", "s2": "DISABLED"}


@pytest.mark.clause("6.2.3/enableZoneSet", "6.2.3/deleteZoneSet")
def test_instant_actions_enable_and_delete(bench: Bench) -> None:
    bench.do(ZoneSetReceived(transfer(WALL)), ZoneSetReceived(transfer(WALL, zone_set_id="s2")))

    bench.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))
    bench.instant(action("d1", "NONE", "deleteZoneSet", zoneSetId="s1"))
    bench.instant(action("d2", "NONE", "deleteZoneSet", zoneSetId="s2"))
    bench.instant(action("d3", "NONE", "deleteZoneSet", zoneSetId="s2"))

    assert [bench.status(each) for each in ("e", "d1", "d2", "d3")] == [
        "FINISHED",
        "FAILED",
        "FINISHED",
        "FAILED",
    ]
    assert held(bench) == {"s1": "ENABLED"}


@pytest.mark.clause("6.2.3/enableZoneSet")
def test_an_order_enables_a_set_on_a_node(bench: Bench) -> None:
    bench.do(ZoneSetReceived(transfer(WALL)))
    enabling = action("e", "HARD", "enableZoneSet", zoneSetId="s1")

    bench.send(order("n0", "n1", node_actions={"n0": [enabling]}))

    assert bench.status("e") == "FINISHED"
    assert held(bench) == {"s1": "ENABLED"}
    assert bench.goal.pose.x == 10.0


@pytest.mark.clause("6.2.3/downloadZoneSet")
def test_a_downloaded_zone_set_is_accepted_or_fails_its_action(bench: Bench) -> None:
    for action_id in ("w1", "w2"):
        bench.instant(action(action_id, "NONE", "work"))
        bench.do(ActionReport(action_id, ActionStatus.FINISHED, zone_set=zone_set(WALL)))

    assert (bench.status("w1"), bench.status("w2")) == ("FINISHED", "FAILED")
    assert "DUPLICATE_ZONE_SET" in bench.errors


@pytest.mark.clause("6.4", "6.10/zones", "6.2.3")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0"])
def test_older_versions_have_no_zones(version: str) -> None:
    bench = Bench(rules=RULES[version])

    bench.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))

    assert bench.capabilities.zones == frozenset()
    assert bench.status("e") == "FAILED"


@pytest.mark.clause("6.4/others")
@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("COORDINATED_REPLANNING", {}),
        ("ACTION", {"entry_actions": (), "during_actions": (), "exit_actions": ()}),
        ("PRIORITY", {"priority_factor": 0.5}),
        ("PENALTY", {"penalty_factor": 0.5}),
        ("DIRECTED", {"direction": 0.0, "directed_limitation": DirectedLimitation.SOFT}),
        ("BIDIRECTED", {"direction": 0.0, "bidirected_limitation": BidirectedLimitation.SOFT}),
    ],
)
def test_a_set_with_a_zone_that_the_robot_does_not_support_is_refused(
    bench: Bench, kind: str, fields: dict[str, Any]
) -> None:
    bench.do(ZoneSetReceived(transfer(WALL, zone("other", kind, 20, 30, **fields))))

    assert bench.errors == ["VALIDATION_FAILURE"]
    assert held(bench) == {}


class TestKeepOut:
    WALL = zone("wall", "BLOCKED", 4, 6)
    USED, UNUSED = KeepOutReport(""), KeepOutReport("no node subscribes to /zone_filter_info")

    def robot(self, **more: Any) -> Bench:
        """Return a robot with a zone set of one BLOCKED zone that is being enabled."""
        robot = Bench(rules=RULES["3.0.0"], keeps_out=True, **more)
        robot.do(Started(NOON), ZoneSetReceived(transfer(self.WALL)))
        robot.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))
        return robot

    @pytest.mark.clause("6.4/BLOCKED")
    def test_navigation_gets_only_the_blocked_zones_of_enabled_sets(self) -> None:
        robot = self.robot()
        robot.do(self.USED)
        assert [len(each.areas) for each in robot.effects_of(KeepOut)] == [1]

        robot.do(at(1.0))
        enable(robot, GATE, zone_set_id="s2")

        assert [len(each.areas) for each in robot.effects_of(KeepOut)] == [1, 0]

    @pytest.mark.clause("6.2.3/enableZoneSet")
    def test_a_set_is_enabled_only_once_navigation_plans_around_its_blocked_zones(self) -> None:
        robot = self.robot()
        assert (robot.status("e"), held(robot)) == ("RUNNING", {"s1": "DISABLED"})
        assert [len(each.areas) for each in robot.effects_of(KeepOut)] == [1]  # so that navigation can

        robot.do(self.USED)

        assert (robot.status("e"), held(robot)) == ("FINISHED", {"s1": "ENABLED"})
        assert len(robot.effects_of(KeepOut)) == 1

    @pytest.mark.parametrize("answers", [(), (UNUSED,)])
    def test_a_set_that_navigation_cannot_obey_is_not_enabled(
        self, answers: tuple[KeepOutReport, ...]
    ) -> None:
        robot = self.robot()
        robot.do(*answers)
        assert robot.core.waits
        robot.now += KEEP_OUT_TIMEOUT

        robot.do(TimePassed())

        assert (robot.status("e"), held(robot)) == ("FAILED", {"s1": "DISABLED"})
        assert [len(each.areas) for each in robot.effects_of(KeepOut)] == [1, 0]
        assert robot.errors == ["ACTION_FAILED"]
        (entry,) = robot.state.errors
        assert (answers[0].problem if answers else "has not confirmed") in str(entry.error_description)
        robot.send(order("n0", "n1"))  # the zone does not count
        assert robot.goals

    def test_sets_of_two_maps_are_enabled_together(self) -> None:
        robot = self.robot()
        robot.do(ZoneSetReceived(transfer(self.WALL, zone_set_id="s2", map_id="cellar")))
        robot.instant(action("e2", "NONE", "enableZoneSet", zoneSetId="s2"))
        assert [len(each.areas) for each in robot.effects_of(KeepOut)] == [1, 2]

        robot.do(self.USED)

        assert held(robot) == {"s1": "ENABLED", "s2": "ENABLED"}
        assert (robot.status("e"), robot.status("e2")) == ("FINISHED", "FINISHED")

    def test_an_action_of_an_order_waits_as_well(self) -> None:
        robot = Bench(rules=RULES["3.0.0"], keeps_out=True)
        robot.do(Started(NOON), ZoneSetReceived(transfer(self.WALL)))
        enabling = action("e", "HARD", "enableZoneSet", zoneSetId="s1")
        robot.send(order("n0", "n9", positions={"n9": position(0.0, 9.0)}, node_actions={"n0": [enabling]}))
        assert (robot.status("e"), robot.goals) == ("RUNNING", [])

        robot.do(self.USED)

        assert robot.status("e") == "FINISHED"
        assert robot.goal.pose.y == 9.0

    def test_a_restart_of_the_agent_does_not_end_the_wait(self) -> None:
        robot = Bench(rules=RULES["3.0.0"], keeps_out=True, memory=self.robot().core.memory())
        robot.do(Started(NOON))
        assert robot.status("e") == "RUNNING"

        robot.do(self.USED)

        assert (robot.status("e"), held(robot)) == ("FINISHED", {"s1": "ENABLED"})

    @pytest.mark.parametrize("keeps_out", [False, True])
    def test_a_wait_that_a_restart_makes_needless_ends(self, *, keeps_out: bool) -> None:
        robot = self.robot()
        if keeps_out:
            robot.instant(action("d", "NONE", "deleteZoneSet", zoneSetId="s1"))
            assert robot.status("e") == "FAILED"
        memory = robot.core.memory()

        again = Bench(rules=RULES["3.0.0"], memory=memory, keeps_out=keeps_out)

        assert again.status("e") == ("FAILED" if keeps_out else "FINISHED")
        assert not again.waits()

    def test_a_restarted_robot_drives_once_navigation_plans_around_its_zones(self) -> None:
        robot = self.robot()
        robot.do(self.USED)
        robot.send(order("n0", "n9", positions={"n9": position(0.0, 9.0)}))

        again = Bench(rules=RULES["3.0.0"], keeps_out=True, memory=robot.core.memory())

        assert (again.goals, again.effects_of(Halt)) == ([], [])  # Nav2 drives on meanwhile
        again.do(self.UNUSED)
        assert (again.goals, again.errors) == ([], ["BLOCKED_ZONES_NOT_AVOIDED"])
        again.do(Halted(), self.USED)
        assert len(again.goals) == 1

    def test_a_late_answer_about_former_areas_does_not_count(self) -> None:
        robot = self.robot()
        robot.now += KEEP_OUT_TIMEOUT
        robot.do(TimePassed(), self.USED)
        robot.instant(action("e2", "NONE", "enableZoneSet", zoneSetId="s1"))
        assert (robot.status("e"), robot.status("e2")) == ("FAILED", "RUNNING")

    def test_a_set_without_blocked_zones_needs_nobody(self) -> None:
        robot = Bench(rules=RULES["3.0.0"], keeps_out=True)
        enable(robot, GATE)
        assert held(robot) == {"s1": "ENABLED"}

    def test_a_robot_whose_navigation_no_longer_plans_around_zones_stands_until_it_does(self) -> None:
        robot = self.robot()
        robot.do(self.USED)
        robot.send(order("n0", "n9", positions={"n9": position(0.0, 9.0)}))
        drives = len(robot.goals)

        robot.do(self.UNUSED)
        assert robot.effects_of(Halt)
        robot.do(Halted())
        assert robot.errors == ["BLOCKED_ZONES_NOT_AVOIDED"]
        assert held(robot) == {"s1": "ENABLED"}

        robot.do(self.USED)
        assert (robot.errors, len(robot.goals)) == ([], drives + 1)

    def test_a_driver_without_support_is_not_called(self) -> None:
        robot = with_zones(zone("wall", "BLOCKED", 4, 6))
        assert not robot.effects_of(KeepOut)
