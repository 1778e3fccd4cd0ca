"""Readers of what comes over MQTT, and over ROS to the simulator, besides messages of VDA 5050."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any
from unittest.mock import patch

from pydantic import BaseModel
from pydantic_core import to_json

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.loopback.control import ControlApi, SimulationControl
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.protocol.events import Event
from nena_edge_agent.robot_link import RobotLink
from nena_order_service.api.mqtt import COMMANDS, CommandAnswer, read_request, text_in
from nena_robot_simulator import faults
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import Problem, TransportOrderRequest
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Timestamp
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings
from support.fleet_examples import order_status, sample_plant, vehicle_status
from support.readers.reader import Make, NotTakenError, Place, Reader
from support.robot_maps import robot_map

ROBOT = RobotKey("ACME", "1")
MAX_BODY = 262_144
"""Bytes, as the order service has it by default."""
CORNERS = [{"x": 0, "y": 0}, {"x": 1, "y": 0}, {"x": 1, "y": 1}]
ZONE = {"zoneId": "z", "zoneType": "BLOCKED", "vertices": CORNERS}
PROPERTY = {"key": "colour", "value": "red"}
SEQUENCE = {"name": "S-1", "orderTypes": ["a", "b"], "failureFatal": True, "properties": [PROPERTY]}
POSE = {"x": 1, "y": 2, "theta": 0.5, "mapId": "hall"}
BODIES: dict[str, dict[str, Any]] = {
    "peripherals": {},
    "peripheral": {"location": "Door 1"},
    "peripheralJobs": {},
    "peripheralJob": {"peripheralJob": "J-1"},
    "createPeripheralJob": {"location": "Door 1", "operation": "open", "reservationToken": "wms"},
    "withdrawPeripheralJob": {"peripheralJob": "J-1"},
    "withdraw": {"transportOrder": "T-1", "reason": "late", "immediate": False, "version": 3},
    "changeOrder": {"transportOrder": "T-1", "priority": 5, "intendedVehicle": None, "timeout": 60.0},
    "hold": {"transportOrder": "T-1", "by": "ann", "reason": "waits"},
    "resume": {"transportOrder": "T-1", "by": "ann"},
    "delivery": {"transportOrder": "T-1"},
    "assignment": {"transportOrder": "T-1"},
    "dispatch": {"vehicle": "V-1", "coordinate": {"x": 1, "y": 2}, "priority": 5},
    "instantAction": {
        "vehicle": "V-1",
        "actionType": "initializePosition",
        "pose": POSE,
        "parameters": [{"key": "a", "value": {"b": [1, None, "c"]}}],
    },
    "stops": {},
    "stop": {"by": "ann", "reason": "spill", "area": {"xMin": 0, "yMin": 0, "xMax": 2, "yMax": 1.5}},
    "endStop": {"stop": "stop-1", "by": "ann", "reason": "cleaned"},
    "previewPathLock": {"path": "A --- B"},
    "lockPath": {"path": "A --- B", "locked": True},
    "reroute": {"vehicle": "V-1", "type": "FORCED"},
    "putZoneSet": {"zoneSet": {"mapId": "hall", "zoneSetId": "s1", "zones": [ZONE]}},
    "enableZoneSet": {"zoneSetId": "s1"},
    "deleteZoneSet": {"zoneSetId": "s1"},
    "integrationLevel": {"vehicle": "V-1", "integrationLevel": "TO_BE_UTILIZED"},
    "acceptableOrderTypes": {"vehicle": "V-1", "acceptableOrderTypes": [{"name": "a", "priority": 1}]},
    "createOrderSequence": SEQUENCE,
    "orderSequence": {"orderSequence": "S-1"},
    "orderSequences": {"finished": True, "limit": 5, "after": "12"},
    "completeOrderSequence": {"orderSequence": "S-1", "version": 1},
    "summary": {},
    "trafficPlan": {},
    "fetchRecording": {},
    "points": {"limit": 5, "after": "A", "vehicle": "V-1"},
    "point": {"point": "A"},
    "locations": {"limit": 5, "type": "shelf", "operation": "Load"},
    "location": {"location": "Shelf 1"},
    "schedules": {},
    "schedule": {"schedule": "night"},
    "putSchedule": {
        "schedule": "night",
        "transportOrder": {"destinations": [{"locationName": "A"}]},
        "cron": "30 2 * * 1-5",
        "timeZone": "Europe/Berlin",
        "validFrom": "2030-01-01T00:00:00Z",
        "catchUp": 1,
    },
    "enableSchedule": {"schedule": "night", "enabled": False},
    "deleteSchedule": {"schedule": "night"},
}
ORDER = {
    "name": "T-1",
    "idempotencyKey": "k",
    "destinations": [
        {"locationName": "A", "operation": "Load", "properties": [PROPERTY]},
        {"coordinate": {"x": 1, "y": 2}},
    ],
    "deadline": "2030-01-01T00:00:00Z",
    "dependencies": ["T-0"],
    "timeout": 60,
}


def _request(model: type[BaseModel], body: dict[str, Any], _place: Place) -> Reader:
    def read(data: bytes) -> None:
        message = Inbound("t", data, retained=False)
        found = read_request(message, model, max_body=MAX_BODY)
        if isinstance(found, Problem):
            known = text_in(message, "requestId", max_body=MAX_BODY)
            answer = CommandAnswer(status=found.status, request_id=known, problem=found)
            raise NotTakenError(answer.model_dump_json(by_alias=True, exclude_none=True))

    return Reader(read, (json.dumps(body).encode(),), (NotTakenError,))


def loopback_control(_place: Place) -> Reader:
    """Read commands, and obey them."""
    said: list[Outbound] = []
    events: list[Event] = []
    control = SimulationControl(RobotLink().cut)
    start = Pose(0.0, 0.0, 0.0, "m")
    control.use_driver(
        LoopbackDriver(LoopbackSettings(), start, emit=events.append, clock=SystemClock()), events.append
    )
    client = ControlApi(MqttSettings(), "uagv", {ROBOT: control})

    def read(data: bytes) -> None:
        said.clear()
        with patch.object(client._link, "publish", said.append):
            client._on_command(Inbound(f"uagv/loopback/{ROBOT}/control", data, retained=False))
        problems = [each for answer in said for each in json.loads(answer.payload).get("problems", ())]
        if problems:
            raise NotTakenError("; ".join(problems))

    commands: tuple[dict[str, Any], ...] = (
        {"id": "1", "command": "operatingMode", "mode": "SERVICE"},
        {"command": "localization", "localized": True},
        {
            "command": "error",
            "errorType": "worn",
            "errorLevel": "URGENT",
            "errorReferences": {"part": "belt"},
        },
        {"command": "pauseButton", "pressed": True},
    )
    return Reader(read, tuple(json.dumps(each).encode() for each in commands), (NotTakenError,))


def fault_of_the_simulator(_place: Place) -> Reader:
    samples = (
        b'{"kind": "unreachable", "circles": [{"x": 1, "y": 2, "radius": 0.5}], "goals": 2}',
        b'{"kind": "foreign_goal", "x": 1, "y": -2}',
    )
    return Reader(
        lambda data: faults.parse(data.decode(errors="replace")), samples, (faults.FaultRefusedError,)
    )


def _at_the_aggregator(topic: str, sample: Callable[[], bytes], _place: Place) -> Reader:
    """Read a message as the aggregator does, and show what has become of the fleet."""
    clock = SystemClock()
    model = FleetModel(ModelLimits())
    link = FleetSubscriber(AggregatorSettings(), model, clock)

    def read(data: bytes) -> None:
        link._problems.clear()
        for handler in link.mqtt._handlers(topic):
            handler(Inbound(topic, data, retained=True))
        to_json(model.flush(Timestamp.of(clock)))
        if link._problems:
            raise NotTakenError("; ".join(link._problems.values()))

    return Reader(read, (sample(),), (NotTakenError,))


def _json(made: BaseModel) -> bytes:
    return made.model_dump_json(by_alias=True).encode()


def _body(command: str) -> dict[str, Any]:
    assert command in BODIES, f"BODIES has no example of the command {command}"
    return BODIES[command]


TOPICS = FleetTopics()
MESSAGES: dict[str, Make] = {
    "creation": partial(_request, TransportOrderRequest, ORDER),
    **{
        f"command {name}": partial(_request, model, {"requestId": "17", **_body(name)})
        for name, model in COMMANDS.items()
    },
    "control of a loopback robot": loopback_control,
    "fault of the simulator": fault_of_the_simulator,
    "robot's map at the aggregator": partial(
        _at_the_aggregator, TOPICS.robot_map(ROBOT), lambda: _json(robot_map())
    ),
    "order at the aggregator": partial(
        _at_the_aggregator, TOPICS.order_status("TO-1"), lambda: _json(order_status())
    ),
    "vehicle at the aggregator": partial(
        _at_the_aggregator, TOPICS.vehicle_status("r1"), lambda: _json(vehicle_status())
    ),
    "plant model at the aggregator": partial(
        _at_the_aggregator, TOPICS.plant_model, lambda: sample_plant().to_json().encode()
    ),
}
