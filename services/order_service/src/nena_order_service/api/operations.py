"""Host operations: one method for each operation of the table, the same over REST and MQTT."""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Generic, TypeVar

from pydantic import BaseModel
from pydantic_core import to_json

from nena_order_service.api.audit import ChangingRequest, Origin, body_of_model, kind_of, masked
from nena_order_service.api.host_requests import Creation, ETag, HostServices, Refused
from nena_order_service.api.place_requests import path_page
from nena_order_service.api.problems import problem_of
from nena_order_service.fleet.outputs import InstantActionEnded
from nena_order_service.store.database import OrderFilter, SequenceFilter
from nena_shared.fleet_api import operations as table
from nena_shared.fleet_api import requests as bodies
from nena_shared.fleet_api.audit import AuditInterface, AuditQuery
from nena_shared.fleet_api.peripherals import (
    PeripheralJobList,
    PeripheralJobRequest,
    PeripheralJobsQuery,
    PeripheralList,
)
from nena_shared.fleet_api.places import LocationsQuery, PointsQuery
from nena_shared.fleet_api.plant import PathLockRequest, PathsQuery, ZoneSetList
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained
from nena_shared.fleet_api.schedules import ScheduleList, ScheduleRequest, ScheduleSwitch
from nena_shared.fleet_api.stops import StopEndRequest, StopList, StopRequest
from nena_shared.fleet_api.transport_order import (
    CreationAnswer,
    OrderSequenceRequest,
    TransportOrderBatch,
    TransportOrderBatchAnswer,
    TransportOrderRequest,
)
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus
from nena_shared.fleet_api.webhooks import WebhookList
from nena_shared.plant import PlantPose
from nena_shared.vda5050.action import Action, ActionParameter
from nena_shared.vda5050.zone_set import ZoneSet

R = TypeVar("R")

ACTION_TYPES = {"pause": "startPause", "resume": "stopPause"}
"""Names of instant actions in VDA 5050 by the names that hosts may use."""


@dataclass(frozen=True, slots=True)
class Call(Generic[R]):
    """One request of a host."""

    name: str
    """Name of the object; empty if the operation has none."""
    request: R
    caller: str
    """The caller, as identified by access control."""
    seen: ETag | None = None
    """Version that the host has seen; None: any."""
    origin: Origin = field(default_factory=lambda: Origin(AuditInterface.REST))
    """The origin of the request, for the audit trail."""


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a successful request."""

    body: BaseModel | bytes
    """The answer; bytes: a page in JSON, whose objects would take five times the memory as models."""
    status: HTTPStatus = HTTPStatus.OK


Handler = Callable[[Call[Any]], Awaitable[Reply]]
M = TypeVar("M", bound=Callable[..., Awaitable[Reply]])


_METHODS: dict[str, str] = {}
"""Names of methods by operation name."""


def _does(operation: table.Operation[Any]) -> Callable[[M], M]:
    """Mark the method that executes an operation."""

    def mark(method: M) -> M:
        _METHODS[operation.name] = method.__name__
        return method

    return mark


class HostOperations:
    """Executes host operations; a change is committed before its answer is returned.

    The table in :mod:`nena_shared.fleet_api.operations` describes each of them. They raise the errors in
    :mod:`nena_order_service.errors`; ``api.problems`` maps these to problems.
    """

    def __init__(self, hosts: HostServices) -> None:
        self._requests = hosts.requests
        self._sequences = hosts.sequences
        self._locks = hosts.locks
        self._zones = hosts.zones
        self._peripherals = hosts.peripherals
        self._stops = hosts.stops
        self._places = hosts.places
        self._schedules = hosts.schedules
        self._webhooks = hosts.webhooks
        self._recordings = hosts.recordings
        self.trail = hosts.trail
        self.handlers: Mapping[str, Handler] = {
            each.name: self._recorded(each, getattr(self, _METHODS[each.name])) for each in table.OPERATIONS
        }

    def _recorded(self, operation: table.Operation[Any], handler: Handler) -> Handler:
        """Return the handler of an operation, with a row in the audit trail if it changes something."""
        if operation.method == "GET":
            return handler

        async def recorded(call: Call[Any]) -> Reply:
            with self.trail.recorded(_changing_request(operation, call)) as request:
                reply = await handler(call)
                request.name = request.name or getattr(reply.body, "name", "")
                request.after = _outcome(reply.body)
                return reply

        return recorded

    @_does(table.CREATE_ORDER)
    async def _create_order(self, call: Call[TransportOrderRequest]) -> Reply:
        order, new = await self._requests.create(call.request)
        return Reply(order, _created(new=new))

    @_does(table.CREATE_ORDERS)
    async def _create_orders(self, call: Call[TransportOrderBatch]) -> Reply:
        found = await self._requests.create_all(
            call.request.transport_orders, check_only=call.request.check_only
        )
        results = tuple(map(_creation_answer, call.request.transport_orders, found))
        return Reply(TransportOrderBatchAnswer(results=results))

    @_does(table.LIST_ORDERS)
    async def _list_orders(self, call: Call[bodies.TransportOrdersQuery]) -> Reply:
        query = call.request
        states, before = tuple(query.state or ()), _number(query.after)
        wanted = OrderFilter(states, query.intended_vehicle, before, query.limit + 1)
        encoded: list[bytes] = []
        last, following = 0, None
        async for order in self._requests.orders(wanted, query.since, query.until):
            if len(encoded) < query.limit:
                encoded.append(order.status.model_dump_json(by_alias=True).encode())
                last = order.number
            else:
                following = str(last)
        return Reply(b'{"transportOrders":[%s],"next":%s}' % (b",".join(encoded), to_json(following)))

    @_does(table.SHOW_ORDER)
    async def _show_order(self, call: Call[None]) -> Reply:
        return Reply(await self._requests.order(call.name))

    @_does(table.DELIVERY)
    async def _delivery(self, call: Call[None]) -> Reply:
        return Reply(await self._requests.delivery(call.name))

    @_does(table.ASSIGNMENT)
    async def _assignment(self, call: Call[bodies.AssignmentQuery]) -> Reply:
        return Reply(await self._requests.assignment(call.name, call.request.limit))

    @_does(table.WITHDRAW)
    async def _withdraw(self, call: Call[bodies.WithdrawalRequest]) -> Reply:
        asked = call.request
        return Reply(
            await self._requests.withdraw(call.name, asked.reason, seen=call.seen, immediate=asked.immediate)
        )

    @_does(table.HOLD)
    async def _hold(self, call: Call[bodies.HoldRequest]) -> Reply:
        asked, by = call.request, call.request.by or call.caller
        return Reply(
            await self._requests.hold(call.name, by, asked.reason, seen=call.seen, immediate=asked.immediate)
        )

    @_does(table.RESUME)
    async def _resume(self, call: Call[bodies.ResumeRequest]) -> Reply:
        by = call.request.by or call.caller
        return Reply(await self._requests.resume(call.name, by, call.request.reason, seen=call.seen))

    @_does(table.CREATE_SEQUENCE)
    async def _create_sequence(self, call: Call[OrderSequenceRequest]) -> Reply:
        sequence, new = await self._sequences.create(call.request)
        return Reply(sequence, _created(new=new))

    @_does(table.LIST_SEQUENCES)
    async def _list_sequences(self, call: Call[bodies.OrderSequencesQuery]) -> Reply:
        query = call.request
        wanted = SequenceFilter(
            query.finished,
            query.intended_vehicle,
            query.since,
            query.until,
            before=_number(query.after),
            limit=query.limit + 1,
        )
        found = await self._sequences.sequences(wanted)
        page = found[: query.limit]
        following = str(page[-1].number) if len(found) > query.limit else None
        return Reply(
            bodies.OrderSequencePage(order_sequences=tuple(each.status for each in page), next=following)
        )

    @_does(table.SHOW_SEQUENCE)
    async def _show_sequence(self, call: Call[None]) -> Reply:
        return Reply(await self._sequences.sequence(call.name))

    @_does(table.COMPLETE_SEQUENCE)
    async def _complete_sequence(self, call: Call[None]) -> Reply:
        return Reply(await self._sequences.complete(call.name, seen=call.seen))

    @_does(table.LIST_VEHICLES)
    async def _list_vehicles(self, call: Call[bodies.VehiclesQuery]) -> Reply:
        query = call.request
        states, processing = (
            query.state or tuple(VehicleState),
            query.processing_state or tuple(ProcessingState),
        )
        found: list[VehicleStatus] = []
        async for each in self._requests.vehicles(query.after):
            if each.state in states and each.processing_state in processing:
                found.append(each)
            if len(found) > query.limit:
                break
        page = tuple(found[: query.limit])
        return Reply(
            bodies.VehicleList(vehicles=page, next=page[-1].name if len(found) > query.limit else None)
        )

    @_does(table.SHOW_VEHICLE)
    async def _show_vehicle(self, call: Call[None]) -> Reply:
        return Reply(self._requests.vehicle(call.name))

    @_does(table.INTEGRATION_LEVEL)
    async def _set_integration_level(self, call: Call[bodies.IntegrationLevelRequest]) -> Reply:
        level = call.request.integration_level
        return Reply(await self._requests.set_integration_level(call.name, level))

    @_does(table.ORDER_TYPES)
    async def _accept_order_types(self, call: Call[bodies.OrderTypesRequest]) -> Reply:
        types = call.request.acceptable_order_types
        return Reply(await self._requests.accept_order_types(call.name, types))

    @_does(table.DISPATCH)
    async def _dispatch(self, call: Call[bodies.DispatchRequest]) -> Reply:
        asked = call.request
        self._requests.vehicle(call.name)
        order, new = await self._requests.create(
            TransportOrderRequest(
                destinations=(asked.destination(),),
                intended_vehicle=call.name,
                priority=asked.priority,
                idempotency_key=asked.idempotency_key,
                traceparent=asked.traceparent,
            )
        )
        return Reply(order, _created(new=new))

    @_does(table.INSTANT_ACTION)
    async def instant_action(self, call: Call[bodies.InstantActionRequest]) -> Reply:
        """Send an instant action to a vehicle and wait for its end, up to a timeout."""
        asked = call.request
        action_type = ACTION_TYPES.get(asked.action_type, asked.action_type)
        parameters = self._parameters(call.name, asked)
        action, end = await self._requests.instant_action(
            call.name, action_type, parameters, asked.blocking_type
        )
        return Reply(_instant_action_answer(action, end), HTTPStatus.OK if end else HTTPStatus.ACCEPTED)

    @_does(table.REROUTE)
    async def _reroute(self, call: Call[bodies.ReroutingRequest]) -> Reply:
        return Reply(await self._requests.reroute(call.name, call.request.type))

    @_does(table.LIST_POINTS)
    async def _list_points(self, call: Call[PointsQuery]) -> Reply:
        return Reply(await self._places.points(call.request))

    @_does(table.SHOW_POINT)
    async def _show_point(self, call: Call[None]) -> Reply:
        return Reply(await self._places.point(call.name))

    @_does(table.LIST_LOCATIONS)
    async def _list_locations(self, call: Call[LocationsQuery]) -> Reply:
        return Reply(self._places.locations(call.request))

    @_does(table.SHOW_LOCATION)
    async def _show_location(self, call: Call[None]) -> Reply:
        return Reply(self._places.location(call.name))

    @_does(table.LIST_PATHS)
    async def _list_paths(self, call: Call[PathsQuery]) -> Reply:
        return Reply(path_page(self._locks, call.request))

    @_does(table.SHOW_PATH)
    async def _show_path(self, call: Call[None]) -> Reply:
        return Reply(self._locks.get(call.name))

    @_does(table.LOCK_PATH)
    async def _lock_path(self, call: Call[PathLockRequest]) -> Reply:
        return Reply(await self._locks.set(call.name, locked=call.request.locked))

    @_does(table.LIST_STOPS)
    async def _list_stops(self, _: Call[None]) -> Reply:
        return Reply(StopList(stops=self._stops.all()))

    @_does(table.STOP)
    async def _stop(self, call: Call[StopRequest]) -> Reply:
        return Reply(await self._stops.begin(call.request, call.caller))

    @_does(table.END_STOP)
    async def _end_stop(self, call: Call[StopEndRequest]) -> Reply:
        return Reply(await self._stops.end(call.name, call.request, call.caller))

    @_does(table.LIST_SCHEDULES)
    async def _list_schedules(self, _: Call[None]) -> Reply:
        return Reply(ScheduleList(schedules=self._schedules.all()))

    @_does(table.SHOW_SCHEDULE)
    async def _show_schedule(self, call: Call[None]) -> Reply:
        return Reply(self._schedules.get(call.name))

    @_does(table.PUT_SCHEDULE)
    async def _put_schedule(self, call: Call[ScheduleRequest]) -> Reply:
        schedule, new = await self._schedules.put(call.name, call.request)
        return Reply(schedule, _created(new=new))

    @_does(table.ENABLE_SCHEDULE)
    async def _enable_schedule(self, call: Call[ScheduleSwitch]) -> Reply:
        return Reply(await self._schedules.enable(call.name, enabled=call.request.enabled))

    @_does(table.DELETE_SCHEDULE)
    async def _delete_schedule(self, call: Call[None]) -> Reply:
        return Reply(await self._schedules.delete(call.name))

    @_does(table.LIST_ZONE_SETS)
    async def _list_zone_sets(self, _: Call[None]) -> Reply:
        return Reply(ZoneSetList(zone_sets=self._zones.all()))

    @_does(table.SHOW_ZONE_SET)
    async def _show_zone_set(self, call: Call[None]) -> Reply:
        return Reply(self._zones.get(call.name))

    @_does(table.PUT_ZONE_SET)
    async def _put_zone_set(self, call: Call[ZoneSet]) -> Reply:
        return Reply(await self._zones.put(call.request))

    @_does(table.ENABLE_ZONE_SET)
    async def _enable_zone_set(self, call: Call[None]) -> Reply:
        return Reply(await self._zones.enable(call.name))

    @_does(table.DELETE_ZONE_SET)
    async def _delete_zone_set(self, call: Call[None]) -> Reply:
        return Reply(await self._zones.delete(call.name))

    @_does(table.LIST_PERIPHERALS)
    async def _list_peripherals(self, _: Call[None]) -> Reply:
        return Reply(PeripheralList(peripherals=self._peripherals.devices()))

    @_does(table.SHOW_PERIPHERAL)
    async def _show_peripheral(self, call: Call[None]) -> Reply:
        return Reply(self._peripherals.device(call.name))

    @_does(table.LIST_JOBS)
    async def _list_jobs(self, call: Call[PeripheralJobsQuery]) -> Reply:
        query = call.request
        found = self._peripherals.jobs(query)
        page = found[: query.limit]
        return Reply(
            PeripheralJobList(peripheral_jobs=page, next=page[-1].name if len(found) > query.limit else None)
        )

    @_does(table.SHOW_JOB)
    async def _show_job(self, call: Call[None]) -> Reply:
        return Reply(self._peripherals.job(call.name))

    @_does(table.CREATE_JOB)
    async def _create_job(self, call: Call[PeripheralJobRequest]) -> Reply:
        return Reply(await self._peripherals.create(call.request), HTTPStatus.CREATED)

    @_does(table.WITHDRAW_JOB)
    async def _withdraw_job(self, call: Call[None]) -> Reply:
        return Reply(await self._peripherals.withdraw(call.name, f"by {call.caller}"))

    @_does(table.SUMMARISE)
    async def _summarise(self, _: Call[None]) -> Reply:
        return Reply(await self._requests.summary())

    @_does(table.SHOW_TRAFFIC_PLAN)
    async def _show_traffic_plan(self, _: Call[None]) -> Reply:
        return Reply(await self._requests.traffic_plan())

    @_does(table.LIST_WEBHOOKS)
    async def _list_webhooks(self, _: Call[None]) -> Reply:
        return Reply(WebhookList(webhooks=self._webhooks.statuses))

    @_does(table.LIST_AUDIT)
    async def _list_audit(self, call: Call[AuditQuery]) -> Reply:
        return Reply(await self.trail.page(call.request))

    @_does(table.FETCH_RECORDING)
    async def _fetch_recording(self, _: Call[None]) -> Reply:
        return Reply(await self._recordings.fetch())

    def _parameters(self, vehicle: str, asked: bodies.InstantActionRequest) -> tuple[ActionParameter, ...]:
        """Return the action's parameters; a pose is converted to the frame of the vehicle's map."""
        given = tuple(ActionParameter(key=each.key, value=each.value) for each in asked.parameters)
        if asked.pose is None:
            return given
        pose = PlantPose(asked.pose.x, asked.pose.y, asked.pose.theta)
        robot = self._requests.robot_pose(vehicle, pose, asked.pose.map_id)
        return (
            ActionParameter(key="x", value=robot.pose.x_m),
            ActionParameter(key="y", value=robot.pose.y_m),
            ActionParameter(key="theta", value=robot.pose.heading_rad),
            ActionParameter(key="mapId", value=robot.map_id),
            ActionParameter(key="lastNodeId", value=robot.point),
            *given,
        )


def _changing_request(operation: table.Operation[Any], call: Call[Any]) -> ChangingRequest:
    """Return what the audit trail records of a request."""
    is_batch = operation is table.CREATE_ORDERS
    creates = operation.creates or (operation.path if is_batch or operation is table.STOP else "")
    name = call.request.zone_set_id if operation is table.PUT_ZONE_SET else call.name
    return ChangingRequest(
        origin=call.origin,
        operation=operation.name,
        kind=kind_of(operation.path),
        name=name,
        body=_size_of_batch(call.request) if is_batch else body_of_model(call.request),
        creates=kind_of(creates) if creates else "",
        creates_many=is_batch,
        joins=operation is not table.INSTANT_ACTION,
    )


def _size_of_batch(batch: TransportOrderBatch) -> Callable[[], str]:
    content = {"transportOrders": len(batch.transport_orders), "checkOnly": batch.check_only}
    return lambda: masked(content)


def _outcome(body: BaseModel | bytes) -> str:
    """Return the outcome of requests that end without a change of an object; empty for others."""
    if isinstance(body, bodies.InstantActionAnswer):
        return masked({"actionId": body.action_id, "status": body.status})
    if isinstance(body, TransportOrderBatchAnswer):
        statuses = Counter(each.status for each in body.results)
        return masked({str(status): count for status, count in sorted(statuses.items())})
    return ""


def _creation_answer(request: TransportOrderRequest, made: Creation | Refused) -> CreationAnswer:
    """Return the result of one request of a batch."""
    key = request.idempotency_key
    if isinstance(made, Exception):
        problem = problem_of(made)
        return CreationAnswer(status=problem.status, name=request.name, idempotency_key=key, problem=problem)
    order, new = made
    name = order.name if order else request.name
    return CreationAnswer(status=_created(new=new), name=name, idempotency_key=key, transport_order=order)


def _created(*, new: bool) -> HTTPStatus:
    return HTTPStatus.CREATED if new else HTTPStatus.OK


def _number(after: str | None) -> int | None:
    return int(after) if after else None


def _instant_action_answer(action: Action, end: InstantActionEnded | None) -> bodies.InstantActionAnswer:
    """Return the status of an action; ``end`` None: it is still running."""
    return bodies.InstantActionAnswer(
        action_id=action.action_id,
        action_type=action.action_type,
        status=(end.status or "UNKNOWN") if end else "PENDING",
        **explained(end.reason if end else Reason(ReasonCode.ACTION_PENDING)),
        result=end.result if end else None,
    )
