"""The order service's black box: decisions with their reasons, and what starts a recording."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from nena_order_service.errors import RefusedError
from nena_order_service.extensions.black_box import BlackBoxSettings, make_black_box, request_recording
from nena_order_service.extensions.black_box.recorder import DecisionRecorder
from nena_order_service.fleet import outputs
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.extensions.black_box.box import BlackBox
from nena_shared.extensions.black_box.mcap_file import encoded
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.stops import VehicleStop
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.vda5050.action import Action, BlockingType
from nena_shared.vda5050.order import Edge, Node
from nena_shared.vda5050.state import EmergencyStop, SafetyState, State
from nena_shared.vda5050.topics import RobotKey, Topic
from support.clocks import ManualClock
from support.fleet_examples import state, vehicle_status
from support.order_service import NOW, assigned_order, dispatchable_order

ROBOT = RobotKey("ACME", "r1")


@dataclass
class Recorded:
    """A recorder, and what it has recorded."""

    settings: BlackBoxSettings
    clock: ManualClock = field(default_factory=lambda: ManualClock(start=NOW))
    states: dict[RobotKey, State] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make the recorder."""
        box = make_black_box(self.settings, FleetTopics(), self.clock)
        assert box
        self.box: BlackBox = box
        self.recorder = DecisionRecorder(box, self.clock, self.states.get)

    def order(self, *versions: TransportOrder) -> None:
        for each in versions:
            self.recorder.order_changed(each.status)

    def decisions(self, topic: str = "") -> list[dict[str, Any]]:
        """Return the decisions below a topic as a file contains them."""
        entries = self.box.ring.entries(self.clock.monotonic())
        own = [each for each in entries if each.channel.topic.startswith("/nena/" + topic)]
        return [json.loads(encoded(each)) for each in own]

    @property
    def started(self) -> list[str]:
        """Return why recordings have started."""
        due, found = self.box._due, []
        while not due.empty():
            found.append(due.get_nowait())
        return found


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    return Recorded(with_box(tmp_path))


def with_box(folder: Path) -> BlackBoxSettings:
    return BlackBoxSettings.model_validate(
        {"black_box": {"enabled": True, "interval": 0.0}, "upload": {"folder": folder / "recordings"}}
    )


def test_dispatch_is_recorded_with_its_reasons_once(recorded: Recorded) -> None:
    waits = dispatchable_order()
    deferred = waits.deferred(Reason.of("all are busy"), NOW)
    again = deferred.deferred(Reason.of("V-1 is charging"), NOW)
    order = again.assigned("V-1", [("A", "B")], Reason.of("it is near"), NOW)
    recorded.order(
        waits, deferred, again, order, order.rerouted(("A", "C", "B"), Reason.of("a path is locked"), NOW)
    )

    assert [each["explanation"] for each in recorded.decisions("dispatch")] == [
        ["all are busy"],
        ["V-1 is charging"],
        ["V-1", "it is near"],
    ]
    assert recorded.decisions("routing") == [
        {"order": "T-1", "vehicle": "V-1", "destination": 1, "route": ["A", "B"]},
        {
            "order": "T-1",
            "state": "BEING_PROCESSED",
            "vehicle": "V-1",
            "event": "nena:rerouted",
            "explanation": ["a path is locked"],
            "reason": "robot V-1 travels to destination 1 of 1",
        },
        {"order": "T-1", "vehicle": "V-1", "destination": 1, "route": ["A", "C", "B"]},
    ]


def test_a_withdrawal_is_recorded_and_is_no_failure(recorded: Recorded) -> None:
    withdrawn = assigned_order().withdrawn("the host has changed its mind", NOW)
    recorded.order(assigned_order(), withdrawn, withdrawn.failed(Reason.of("withdrawn: released"), NOW))

    (decision,) = recorded.decisions("withdrawal")
    assert (decision["order"], decision["explanation"]) == ("T-1", ["the host has changed its mind"])
    assert recorded.started == []


def test_a_failed_order_starts_a_recording(recorded: Recorded) -> None:
    failed = assigned_order().failed(Reason.of("no path"), NOW)
    recorded.order(assigned_order(), failed)

    assert recorded.decisions("orders")[-1]["reason"] == "no path"
    assert recorded.started == ["order-failed"]


def test_a_withdrawal_before_the_assignment_is_recorded_and_starts_none(recorded: Recorded) -> None:
    recorded.order(dispatchable_order(), dispatchable_order().withdrawn("not needed", NOW))

    (decision,) = recorded.decisions("withdrawal")
    assert (decision["order"], decision["explanation"]) == ("T-1", ["not needed"])
    assert recorded.decisions("orders")[-1]["explanation"] == ["FAILED", "not needed"]
    assert recorded.started == []


def test_waits_of_orders_are_recorded_without_an_event(recorded: Recorded) -> None:
    order = assigned_order()
    recorded.order(order, order.with_wait_reason(Reason.of("V-2 stands at B")))

    assert "V-2 stands at B" in recorded.decisions("orders")[-1]["reason"]


def test_events_from_before_the_start_are_left_out(recorded: Recorded) -> None:
    recorded.clock.start = NOW + timedelta(minutes=1)
    restarted = DecisionRecorder(recorded.box, recorded.clock, recorded.states.get)
    order = assigned_order()
    restarted.order_changed(order.status)
    restarted.order_changed(order.adopted(recorded.clock.now()).status)

    assert [each["event"] for each in recorded.decisions("orders")] == ["nena:adoptedAfterRestart"]
    assert recorded.decisions("dispatch") == []


def test_waits_and_stops_of_vehicles_are_traffic(recorded: Recorded) -> None:
    wait = TrafficWait(vehicles=("V-2",), at="B", cause=WaitCause.STANDS, reason="V-2 stands at B")
    stop = VehicleStop(name="S-1", by="Anna", reason="spill", area=False)
    for changes in ({}, {"wait": wait}, {"wait": wait}, {"wait": wait, "stop": stop}, {}):
        recorded.recorder.vehicle_changed(vehicle_status(**changes))

    waiting, stopped, free = recorded.decisions("traffic")
    assert waiting["wait"]["vehicles"] == ["V-2"]
    assert stopped["stop"]["by"] == "Anna"
    assert "wait" not in free
    assert recorded.started == ["stop"]


def test_reasons_of_idle_vehicles_are_dispatch(recorded: Recorded) -> None:
    for reason in ("no order waits", "no order waits", "is charging"):
        recorded.recorder.vehicle_changed(vehicle_status(transport_order=None, reason=reason))

    assert [each["reason"] for each in recorded.decisions("dispatch")] == ["no order waits", "is charging"]


def node(name: str, sequence: int, *, released: bool) -> Node:
    return Node(node_id=name, sequence_id=sequence, released=released, actions=())


def test_messages_to_robots_are_recorded_with_base_and_horizon(recorded: Recorded) -> None:
    nodes = (node("A", 0, released=True), node("B", 2, released=False))
    edge = Edge(edge_id="A-B", sequence_id=1, released=False, actions=())
    order = VdaOrder(order_id="T-1-0", nodes=nodes, edges=(edge,))
    pause = Action(action_type="startPause", action_id="p", blocking_type=BlockingType.HARD)
    recorder = recorded.recorder
    recorder.published(Topic.ORDER, outputs.PublishOrder(ROBOT, order, 3))
    recorder.published(Topic.INSTANT_ACTIONS, outputs.PublishInstantActions(ROBOT, (pause,)))
    recorder.happened(outputs.VdaOrderAccepted(ROBOT, "T-1-0"))
    recorder.happened(outputs.VdaOrderFailed(ROBOT, "T-1-0", Reason.of("blocked"), ("FATAL motor",)))

    sent, paused, accepted, failed = recorded.decisions("delivery")
    assert sent == {
        "robot": "ACME/r1",
        "event": "orderSent",
        "orderId": "T-1-0",
        "orderUpdateId": 3,
        "base": ["A"],
        "horizon": ["B"],
    }
    assert (paused["event"], paused["actions"]) == ("instantActionsSent", ["startPause"])
    assert accepted["event"] == "orderAccepted"
    assert (failed["reason"], failed["details"]) == ("blocked", ["FATAL motor"])


def test_an_emergency_stop_starts_a_recording_when_it_begins(recorded: Recorded) -> None:
    safety = SafetyState(active_emergency_stop=EmergencyStop.MANUAL, field_violation=False)
    going, stopped = state(), state(safety_state=safety)
    for each in (going, stopped, stopped, going, stopped):
        recorded.states[ROBOT] = each
        recorded.recorder.happened(outputs.RobotChanged(ROBOT))

    assert recorded.started == ["emergency-stop", "emergency-stop"]
    assert [each["emergencyStop"] for each in recorded.decisions("traffic")] == ["MANUAL", "NONE", "MANUAL"]


def test_stops_from_before_the_start_start_no_recording(recorded: Recorded) -> None:
    """Otherwise, an order that fails in the next minute would start none."""
    safety = SafetyState(active_emergency_stop=EmergencyStop.MANUAL, field_violation=False)
    recorded.states[ROBOT] = state(safety_state=safety)
    recorded.recorder.happened(outputs.RobotChanged(ROBOT))
    stop = VehicleStop(name="S-1", by="Anna", reason="spill", area=False)
    recorded.recorder.vehicle_changed(vehicle_status(stop=stop))
    assert recorded.started == []

    recorded.order(assigned_order(), assigned_order().failed(Reason.of("no path"), NOW))
    assert recorded.started == ["order-failed"]


async def test_a_request_returns_the_file(recorded: Recorded, tmp_path: Path) -> None:
    recorded.order(dispatchable_order())
    answer = await request_recording(recorded.box)

    assert (answer.robot, answer.sent) == ("nena/order-service", False)
    assert list((tmp_path / "recordings").rglob(answer.name))


async def test_a_request_says_what_is_wrong(tmp_path: Path) -> None:
    assert make_black_box(BlackBoxSettings(), FleetTopics(), ManualClock()) is None
    with pytest.raises(RefusedError, match=r"black_box\.enabled"):
        await request_recording(None)
    (tmp_path / "recordings").write_text("no folder")
    box = make_black_box(with_box(tmp_path), FleetTopics(), ManualClock())
    with pytest.raises(RefusedError, match=r"upload\.folder"):
        await request_recording(box)
