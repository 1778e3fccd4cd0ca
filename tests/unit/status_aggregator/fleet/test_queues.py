"""Queues and jams of the fleet model, from statuses to views."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

from nena_shared.clock import SystemClock, iso
from nena_shared.fleet_api.service_status import LOST_AFTER, ServiceStatus
from nena_shared.fleet_api.stops import Area, StopStatus, UnpausedVehicle
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.vehicle import VehicleState, VehicleStatus
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.queues import Queues
from nena_status_aggregator.fleet.views import FleetView, WaitView
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings, JamSettings, Share
from support.fleet_examples import START, connection, timestamp, vehicle_status
from support.fleet_records import state

LIMITS = ModelLimits(jam=JamSettings(robots=2, seconds=20))
STOP = {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}


class Site:
    """A model, and vehicles V-1, V-2, ... of it."""

    def __init__(self) -> None:
        self.model = FleetModel(LIMITS)
        self.now = 0.0
        self._header = 0

    def robot(self, number: int, *behind: int, **fields: Any) -> None:
        """Let a robot stand, with an order if it waits ``behind`` others."""
        key = RobotKey("ACME", f"r{number}")
        at, self._header = timestamp(self.now), self._header + 1
        self.model.on_connection(key, connection(robot=key), at)
        self.model.on_state(key, state(self._header, robot=key, at=self.now, **fields), at)
        names = tuple(f"V-{each}" for each in behind)
        wait = (
            TrafficWait(vehicles=names, at="B", cause=WaitCause.PASSES, reason="it waits") if names else None
        )
        order = f"T-{number}" if names else None
        self.model.on_vehicle_status(
            vehicle_status(f"V-{number}", robot=key, transport_order=order, wait=wait), at
        )

    def pass_time(self, seconds: float) -> None:
        self.now += seconds

    def view(self) -> FleetView:
        self.model.flush(timestamp(self.now))
        return self.model.snapshot()

    def wait(self, number: int) -> WaitView:
        """Return where the waiting of a vehicle leads."""
        (found,) = [each for each in self.view()["robots"] if each["name"] == f"V-{number}"]
        assert found["vehicle"]
        assert found["vehicle"]["wait"]
        return found["vehicle"]["wait"]

    def jams(self) -> list[tuple[str | None, list[str], int]]:
        return [(each["head"], each["circle"], each["robots"]) for each in self.view()["jams"]]


def test_a_chain_leads_to_the_robot_with_the_emergency_stop() -> None:
    site = Site()
    site.robot(1, 15)
    site.robot(15, 17)
    site.robot(17, **STOP)
    assert (site.wait(1)["next"], site.wait(1)["head"]) == ("V-15", "V-17")
    assert (site.wait(15)["next"], site.wait(15)["head"]) == ("V-17", "V-17")


def test_a_chain_changes_with_a_robot_further_ahead() -> None:
    site = Site()
    site.robot(1, 2)
    site.robot(2)
    assert site.wait(1)["head"] == "V-2"
    site.robot(2, 3)
    assert site.wait(1)["head"] == "V-3"


def test_robot_with_an_emergency_stop_is_the_head_of_its_queue() -> None:
    site = Site()
    site.robot(1, 2)
    site.robot(2, 3, **STOP)
    site.robot(3)
    assert site.wait(1)["head"] == "V-2"
    assert site.wait(2)["next"] is None


def test_disconnected_or_unknown_robot_is_the_head_of_its_queue() -> None:
    site = Site()
    site.robot(1, 2)
    assert site.wait(1)["head"] == "V-2"
    site.robot(2, 1)
    assert site.wait(1)["circle"] == ["V-1", "V-2"]
    key = RobotKey("ACME", "r2")
    site.model.on_connection(key, connection(ConnectionState.OFFLINE, robot=key), timestamp(site.now))
    assert (site.wait(1)["head"], site.wait(1)["circle"]) == ("V-2", [])


def test_robots_that_wait_in_a_circle_are_named() -> None:
    site = Site()
    site.robot(1, 2)
    site.robot(2, 3)
    site.robot(3, 1)
    assert (site.wait(2)["head"], site.wait(2)["circle"]) == (None, ["V-1", "V-2", "V-3"])
    site.pass_time(20)
    assert site.jams() == [(None, ["V-1", "V-2", "V-3"], 3)]


def test_more_robots_than_the_limit_for_long_are_a_jam() -> None:
    site = Site()
    site.robot(1, 2)
    site.robot(2, 3)
    site.robot(3)
    site.view()
    site.pass_time(600)
    site.robot(1, 2)
    site.robot(2, 3)
    site.robot(3)
    assert site.jams() == []
    site.robot(4, 3)
    assert site.jams() == []
    site.pass_time(19)
    assert site.jams() == []
    site.pass_time(1)
    assert site.jams() == [("V-3", [], 3)]
    assert site.view()["jams"][0]["since"] == iso(START + timedelta(seconds=600))


def test_a_jam_ends_when_its_robots_go_on() -> None:
    site = Site()
    for number in (1, 2, 4):
        site.robot(number, 3)
    site.robot(3, **STOP)
    site.view()
    site.pass_time(20)
    assert site.jams() == [("V-3", [], 3)]
    site.robot(4)
    assert site.jams() == []
    site.robot(4, 3)
    assert site.jams() == []


def elsewhere(number: int, *behind: int, state: VehicleState = VehicleState.IDLE) -> VehicleStatus:
    """Return the status of a vehicle that another aggregator monitors."""
    names = tuple(f"V-{each}" for each in behind)
    wait = TrafficWait(vehicles=names, at="B", cause=WaitCause.PASSES, reason="it waits") if names else None
    return vehicle_status(f"V-{number}", wait=wait, state=state)


def test_chain_leads_through_uncounted_robots_of_other_shares() -> None:
    site = Site()
    for number in (1, 3, 5):
        site.robot(number, 2)
    for vehicle in (elsewhere(2, 8), elsewhere(4, 2), elsewhere(8, 9, state=VehicleState.ERROR)):
        site.model.on_vehicle_elsewhere(vehicle)
    assert (site.wait(1)["next"], site.wait(1)["head"]) == ("V-2", "V-8")
    site.pass_time(20)
    assert site.jams() == [("V-8", [], 3)]
    site.model.on_vehicle_elsewhere(elsewhere(2))
    assert site.wait(1)["head"] == "V-2"


def test_robots_of_other_shares_have_a_limit() -> None:
    queues = Queues(JamSettings())
    for number in range(10):
        queues.update_elsewhere(elsewhere(number, 99), limit=2)
    queues.update_elsewhere(elsewhere(1, 98), limit=2)
    queues.update_chains(timestamp(0))
    assert {name: chain.head for name, chain in queues.chains.items()} == {"V-0": "V-99", "V-1": "V-98"}


async def test_the_statuses_of_other_shares_reach_the_queues_only() -> None:
    model = FleetModel(LIMITS)
    link = FleetSubscriber(AggregatorSettings(share="1/2"), model, SystemClock())
    keys = [RobotKey("ACME", f"r{number}") for number in range(9)]
    robot = next(key for key in keys if Share(2, 2).has(key))
    body = vehicle_status("V-1", robot=robot, wait=elsewhere(1, 2).wait).model_dump_json(by_alias=True)
    topic = FleetTopics().vehicle_status(robot.serial_number)
    for handler in link.mqtt._handlers(topic):
        handler(Inbound(topic, body.encode(), retained=True))
    model.flush(timestamp(0))
    assert model.queues.chains["V-1"].head == "V-2"
    assert list(model.robots) == []


def test_a_robot_that_drives_is_no_part_of_a_queue() -> None:
    site = Site()
    site.robot(1, 2, driving=True)
    assert site.wait(1)["next"] is None


def service(*, online: bool, at: float) -> ServiceStatus:
    return ServiceStatus(online=online, timestamp=START + timedelta(seconds=at), store_ready=online)


def test_stops_are_published_and_kept_while_the_order_service_is_down() -> None:
    site = Site()
    area = Area(x_min=0, y_min=1, x_max=2, y_max=3)
    stop = StopStatus(
        name="stop-1",
        by="Anna",
        reason="spill",
        since=START,
        area=area,
        vehicles=2,
        paused=1,
        not_paused=(UnpausedVehicle(vehicle="V-2", reason="is silent"),),
    )
    status = service(online=True, at=0).model_copy(update={"stops": (stop,)})
    site.model.on_service_status(status, timestamp(0), retained=False)
    (shown,) = site.view()["orderService"]["stops"]
    assert (shown["by"], shown["paused"], shown["vehicles"]) == ("Anna", 1, 2)
    assert shown["area"] == {"xMin": 0, "yMin": 1, "xMax": 2, "yMax": 3, "mapId": None}
    assert shown["notPaused"] == [{"vehicle": "V-2", "reason": "is silent", "codedReason": None}]
    site.model.on_service_status(service(online=False, at=0), timestamp(1), retained=False)
    assert site.view()["orderService"]["stops"] == [shown], "the robots are still paused"
    site.model.on_service_status(service(online=True, at=2), timestamp(2), retained=False)
    assert site.view()["orderService"]["stops"] == []


def test_stopped_order_service_is_published_with_its_last_heartbeat() -> None:
    site = Site()
    assert site.view()["orderService"] == {"up": None, "lastSign": None, "stops": [], "brokerLacks": []}
    site.model.on_service_status(service(online=True, at=0), timestamp(0), retained=False)
    assert site.view()["orderService"] == {"up": True, "lastSign": None, "stops": [], "brokerLacks": []}
    site.pass_time(1)
    site.model.on_service_status(service(online=False, at=0), timestamp(1), retained=False)
    assert site.view()["orderService"] == {
        "up": False,
        "lastSign": iso(START),
        "stops": [],
        "brokerLacks": [],
    }
    site.model.on_service_status(service(online=True, at=2), timestamp(2), retained=False)
    site.pass_time(1 + LOST_AFTER)
    assert site.view()["orderService"] == {
        "up": False,
        "lastSign": iso(START + timedelta(seconds=2)),
        "stops": [],
        "brokerLacks": [],
    }
    site.model.on_link(connected=False, at=timestamp(site.now))
    assert site.view()["orderService"] == {"up": None, "lastSign": None, "stops": [], "brokerLacks": []}
