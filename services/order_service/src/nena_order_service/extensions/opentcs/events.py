"""Events of openTCS's web API: long polling, the event stream, and the times of vehicles' state changes."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncGenerator, Collection, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from itertools import pairwise
from math import degrees
from typing import Annotated, Any, Final, NamedTuple

from fastapi import FastAPI, Query, Request
from fastapi.responses import StreamingResponse

from nena_order_service.errors import TooManyClientsError
from nena_order_service.extensions.opentcs.answers import NotPossibleError
from nena_order_service.extensions.opentcs.orders import LAST_MOMENT, OrderSequenceState, TransportOrderState
from nena_order_service.extensions.opentcs.plant import json_of
from nena_shared.clock import Clock, iso
from nena_shared.fleet_api.peripherals import PeripheralJobStatus
from nena_shared.fleet_api.transport_order import (
    DriveOrderStatus,
    HistoryEntry,
    OrderSequenceStatus,
    Property,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.plant import RECHARGE_OPERATION, PlantModel, Vehicle
from nena_shared.plant.track import MM_PER_M
from nena_shared.tasks import set_within
from nena_shared.web.server_sent_events import HEADERS, EventRing

Json = dict[str, Any]
Status = VehicleStatus | TransportOrderStatus | OrderSequenceStatus | PeripheralJobStatus

KEPT: Final = 1000
"""Number of events kept for long polling; older ones are dropped."""

CLIENTS: Final = 100
"""Maximum number of clients that poll or follow the stream at the same time."""

_COLOR: Final = re.compile("#[0-9A-Fa-f]{6}")


class EventTopic(StrEnum):
    """Topics that a client of the stream can choose, with openTCS's names."""

    VEHICLES = "/events/vehicles"
    TRANSPORT_ORDERS = "/events/transportOrders"
    ORDER_SEQUENCES = "/events/orderSequences"
    PERIPHERAL_JOBS = "/events/peripheralJobs"


TOPICS: Final[Mapping[type[Status], EventTopic]] = {
    VehicleStatus: EventTopic.VEHICLES,
    TransportOrderStatus: EventTopic.TRANSPORT_ORDERS,
    OrderSequenceStatus: EventTopic.ORDER_SEQUENCES,
    PeripheralJobStatus: EventTopic.PERIPHERAL_JOBS,
}


class StateTimes(NamedTuple):
    """Times at which a vehicle entered its state and its processing state."""

    state: datetime
    processing_state: datetime


@dataclass(frozen=True, slots=True)
class _Change:
    """One committed change."""

    time: datetime
    status: Status
    last: Status | None
    times: StateTimes | None
    """Times of a vehicle's states; None for other objects."""


class ChangeLog(EventRing[_Change]):
    """Keeps the last changes."""

    def __init__(self, plant: PlantModel, clock: Clock) -> None:
        super().__init__(KEPT)
        self._models = plant.vehicles_by_name
        self._clock = clock
        self._began = clock.now()
        self._times: dict[str, StateTimes] = {}
        self._last: dict[tuple[type, str], Status] = {}
        """Vehicles, and unfinished orders and sequences, as last seen."""

    def times_of(self, vehicle: str) -> StateTimes:
        """Return when a vehicle entered its states; the start of the service if nothing changed."""
        return self._times.get(vehicle, StateTimes(self._began, self._began))

    def note(self, status: Status) -> None:
        """Note the new version of an object."""
        key, time = (type(status), status.name), self._clock.now()
        times: StateTimes | None = None
        last = self._last.pop(key, None)
        if isinstance(status, VehicleStatus):
            times = self.times_of(status.name)
            if isinstance(last, VehicleStatus):
                times = self._times[status.name] = StateTimes(
                    times.state if last.state is status.state else time,
                    times.processing_state if last.processing_state is status.processing_state else time,
                )
        self.add(_Change(time, status, last, times))
        # What has ended changes no more, and would fill the memory in the course of months.
        if isinstance(status, VehicleStatus) or not _is_over(status):
            self._last[key] = status

    async def poll(self, first: int, last: int, seconds: float) -> list[Json]:
        """Return the status messages with these numbers, waiting up to ``seconds`` for the first one."""
        self._require_room()
        loop = asyncio.get_running_loop()
        end = loop.time() + seconds
        with self.client():
            while True:
                added = self.added()
                changes = self.last(min(max(self.count - first, 0), self.kept)) or ()
                messages = [
                    _message_of(number, change)
                    for number, change in enumerate(changes, self.count - len(changes))
                    # openTCS's long poll has no messages about sequences.
                    if first <= number <= last and not isinstance(change.status, OrderSequenceStatus)
                ]
                if messages or self.closed:
                    return messages
                first = max(first, self.count)  # earlier ones do not match
                if not await set_within(added, max(end - loop.time(), 0.0)):
                    return []

    def follow(self, topics: Collection[EventTopic]) -> AsyncGenerator[bytes, None]:
        """Return the changes of these kinds from now on, as server-sent events.

        Raises:
            TooManyClientsError: the limit of clients is reached; raised before the response starts.
        """
        # Not in the generator, which only begins once the answer's status is sent.
        self._require_room()
        return self._follow_changes(topics, self.count)

    async def _follow_changes(
        self, topics: Collection[EventTopic], position: int
    ) -> AsyncGenerator[bytes, None]:
        with self.client():

            async def next_frames() -> bytes:
                nonlocal position
                changes, position = self.last(min(self.count - position, KEPT)) or (), self.count
                wanted = (change for change in changes if TOPICS[type(change.status)] in topics)
                return b"".join(map(self._event_frame, wanted))

            async for frames in self.frames(next_frames):
                yield frames

    def _require_room(self) -> None:
        if self.clients >= CLIENTS:
            raise TooManyClientsError(CLIENTS)

    def _event_frame(self, change: _Change) -> bytes:
        # Without an ID, as in openTCS: a client cannot ask for what it has missed.
        event = {
            "currentObjectState": self._object_json(change.status, change.times),
            "previousObjectState": self._object_json(change.last, change.times) if change.last else None,
        }
        return f"event: {TOPICS[type(change.status)]}\ndata: {json.dumps(event)}\n\n".encode()

    def _object_json(self, status: Status, times: StateTimes | None) -> Json:
        match status:
            case VehicleStatus():
                model = self._models.get(status.name) or Vehicle(name=status.name)
                return _vehicle_json(status, model, times or self.times_of(status.name))
            case TransportOrderStatus():
                shown = TransportOrderState.model_validate(status).model_dump(mode="json", by_alias=True)
                drive_orders = enumerate(status.drive_orders)
                return {
                    **{name: shown[name] for name in shown if name not in ("category", "destinations")},
                    "properties": _by_key(status.properties),
                    "history": _history_json(status.history),
                    "driveOrders": [_drive_order_json(status.name, *indexed) for indexed in drive_orders],
                    "currentDriveOrderIndex": status.current_drive_order_index,
                    "currentRouteStepIndex": -1,
                    "finishedTime": shown["finishedTime"] or LAST_MOMENT,
                }
            case OrderSequenceStatus():
                shown = OrderSequenceState.model_validate(status).model_dump(mode="json", by_alias=True)
                del shown["orderTypes"]
                properties, history = _by_key(status.properties), _history_json(status.history)
                return {**shown, "properties": properties, "history": history}
            case PeripheralJobStatus():
                return {
                    "name": status.name,
                    **_job_json(status),
                    "properties": {},
                    "history": {"entries": []},
                }


def _is_over(status: TransportOrderStatus | OrderSequenceStatus | PeripheralJobStatus) -> bool:
    return status.finished if isinstance(status, OrderSequenceStatus) else status.state.final


def _message_of(number: int, change: _Change) -> Json:
    """Return a status message of the long poll."""
    head = {"sequenceNumber": number, "creationTimeStamp": iso(change.time)}
    status = change.status
    if isinstance(status, VehicleStatus) and change.times:
        return {
            "type": "Vehicle",
            **head,
            "vehicleName": status.name,
            "transportOrderName": status.transport_order,
            "position": status.current_position,
            "precisePosition": position_of(status),
            "vehicleOrientationAngle": angle_of(status),
            "paused": False,
            "state": status.state.value,
            "stateTimestamp": iso(change.times.state),
            "procState": status.processing_state.value,
            "procStateTimestamp": iso(change.times.processing_state),
            "allocatedResources": [],
            "claimedResources": [],
        }
    if isinstance(status, PeripheralJobStatus):
        return {"type": "PeripheralJob", **head, "name": status.name, **_job_json(status)}
    order = TransportOrderState.model_validate(status).model_dump(mode="json", by_alias=True)
    return {
        "type": "TransportOrder",
        **head,
        "orderName": order["name"],
        "processingVehicleName": order["processingVehicle"],
        "orderState": order["state"],
        "destinations": order["destinations"],
        "properties": order["properties"],
    }


def position_of(status: VehicleStatus) -> Json | None:
    """Return the position of a vehicle in whole mm; None if it is unknown."""
    position = status.precise_position
    if position is None:
        return None
    return {"x": round(position.x * MM_PER_M), "y": round(position.y * MM_PER_M), "z": 0}


def angle_of(status: VehicleStatus) -> float | str:
    """Return the heading of a vehicle, degrees; ``NaN`` if it is unknown."""
    position = status.precise_position
    # openTCS shows a heading that is not set as NaN, which JSON cannot have as a number.
    return round(degrees(position.theta), 3) if position else "NaN"


def _vehicle_json(status: VehicleStatus, model: Vehicle, times: StateTimes) -> Json:
    shown = json_of("vehicle", model)
    color = shown["layout"]["routeColor"] if model.color else ""
    red, green, blue = bytes.fromhex(color[1:] if _COLOR.fullmatch(color) else "000000")
    levels = ("Critical", "Good", "FullyRecharged", "SufficientlyRecharged")
    return {
        "name": status.name,
        "properties": dict(model.properties),
        "history": {"entries": []},
        "boundingBox": shown["boundingBox"],
        "energyLevelThresholdSet": {f"energyLevel{level}": shown[f"energyLevel{level}"] for level in levels},
        "energyLevel": round(status.energy_level or 0),
        "maxVelocity": model.max_velocity_mm_s,
        "maxReverseVelocity": model.max_reverse_velocity_mm_s,
        "rechargeOperation": RECHARGE_OPERATION,
        "loadHandlingDevices": [],
        "state": {"state": status.state.value, "timestamp": iso(times.state)},
        "procState": {"state": status.processing_state.value, "timestamp": iso(times.processing_state)},
        "integrationLevel": status.integration_level.value,
        "paused": False,
        "transportOrder": status.transport_order,
        "orderSequence": status.order_sequence,
        "acceptableOrderTypes": [
            {"name": accepted.name, "priority": accepted.priority}
            for accepted in status.acceptable_order_types
        ],
        "claimedResources": [],
        "allocatedResources": [],
        "currentPosition": status.current_position,
        "pose": {"position": position_of(status), "orientationAngle": angle_of(status)},
        "envelopeKey": model.envelope_key,
        "layout": {"routeColor": {"red": red, "green": green, "blue": blue}},
    }


def _drive_order_json(order: str, index: int, drive_order: DriveOrderStatus) -> Json:
    """Return a drive order; its route only has points, because costs and paths are not kept."""
    points = drive_order.route or ()
    steps = [
        {
            "path": None,
            "sourcePoint": start,
            "destinationPoint": end,
            "vehicleOrientation": "UNDEFINED",
            "routeIndex": place,
            "costs": 0,
            "executionAllowed": True,
            "reroutingType": None,
        }
        for place, (start, end) in enumerate(pairwise(points))
    ]
    destination = drive_order.destination
    return {
        "name": f"{order}-{index}",
        "destination": {
            "destination": destination.location_name or "",
            "operation": destination.operation,
            "properties": {item.key: item.text for item in destination.properties},
        },
        "transportOrder": order,
        "route": {"steps": steps, "costs": 0} if drive_order.route else None,
        "state": drive_order.state.value,
    }


def _job_json(job: PeripheralJobStatus) -> Json:
    """Return what the job has in events, the long poll and answers."""
    return {
        "reservationToken": job.reservation_token,
        "relatedVehicle": job.related_vehicle,
        "relatedTransportOrder": job.related_transport_order,
        "peripheralOperation": {
            "operation": job.operation,
            "locationName": job.location,
            "executionTrigger": job.execution_trigger.value,
            "completionRequired": job.completion_required,
        },
        "state": job.state.value,
        "creationTime": iso(job.created),
        "finishedTime": iso(job.finished) if job.finished else LAST_MOMENT,
    }


def peripheral_job(job: PeripheralJobStatus) -> Json:
    """Return a peripheral job as in openTCS's answers."""
    return {"name": job.name, **_job_json(job), "properties": []}


def _by_key(properties: tuple[Property, ...]) -> dict[str, str]:
    return {item.key: item.value for item in properties}


def _history_json(entries: tuple[HistoryEntry, ...]) -> Json:
    return {
        "entries": [
            {
                "timestamp": iso(entry.timestamp),
                "eventCode": entry.event_code,
                "supplements": list(entry.supplements),
            }
            for entry in entries
        ]
    }


def add_routes(app: FastAPI, changes: ChangeLog) -> None:
    """Add the routes of long polling and of the event stream."""

    @app.get("/v1/events")
    async def poll(
        first: Annotated[int, Query(alias="minSequenceNo", ge=0)] = 0,
        last: Annotated[int, Query(alias="maxSequenceNo")] = 2**63 - 1,
        wait_ms: Annotated[int, Query(alias="timeout", ge=0, le=10_000)] = 1000,
    ) -> dict[str, Any]:
        if last < first:
            raise NotPossibleError("Parameter 'maxSequenceNo' is less than 'minSequenceNo'.")
        messages = await changes.poll(first, last, wait_ms / 1000)
        return {"timeStamp": iso(datetime.now(UTC)), "statusMessages": messages}

    @app.get("/v1/sse", response_class=StreamingResponse)
    async def stream(request: Request) -> StreamingResponse:
        topics = {topic for topic in EventTopic if request.query_params.get(topic, "").lower() == "true"}
        frames = changes.follow(topics)
        return StreamingResponse(frames, media_type="text/event-stream", headers=HEADERS)
