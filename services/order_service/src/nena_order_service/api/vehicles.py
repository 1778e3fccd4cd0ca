"""Vehicles: operations of hosts."""

from __future__ import annotations

from collections.abc import Iterator
from http import HTTPStatus
from math import hypot

from nena_order_service.api.operations import Handler, Reply, page_of
from nena_order_service.api.orders import OrderOperations
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.stops import STOP_PAUSE
from nena_order_service.errors import RefusedError, UnknownError, VehicleNotReachedError
from nena_order_service.fleet.instant_actions import LEAVES, START_PAUSE
from nena_order_service.fleet.robot import NOT_REACHED, LinkStatus
from nena_order_service.fleet.vda_order import unique_id
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.operations import vehicles as table
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.requests import (
    SOMEBODY,
    DispatchRequest,
    InitialPose,
    InstantActionAnswer,
    InstantActionRequest,
    VehicleList,
    VehiclesQuery,
)
from nena_shared.fleet_api.transport_order import TransportOrderRequest, TransportOrderStatus
from nena_shared.fleet_api.vehicle import (
    AcceptableOrderType,
    IntegrationLevel,
    ReroutingAnswer,
    ReroutingType,
    VehicleStatus,
)
from nena_shared.plant import PlantPose, Point
from nena_shared.vda5050.action import STOP_HIBERNATION, Action, ActionParameter

ACTION_TYPES = {"pause": "startPause", "resume": "stopPause"}
"""Names of instant actions in VDA 5050 by the names that hosts may use."""


class VehicleOperations:
    """Executes requests about vehicles."""

    def __init__(self, engine: Engine, orders: OrderOperations) -> None:
        self._engine = engine
        self._orders = orders

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        yield Handler(table.LIST_VEHICLES, self.list_vehicles)
        yield Handler(table.SHOW_VEHICLE, self.find_status)
        yield Handler(
            table.INTEGRATION_LEVEL,
            lambda name, request, caller: self.set_integration_level(
                name, request.integration_level, request.by or caller
            ),
            {"integrationLevel": "TO_BE_RESPECTED", "by": "Anna"},
        )
        yield Handler(
            table.ORDER_TYPES,
            lambda name, request: self.accept_order_types(name, request.acceptable_order_types),
            {"acceptableOrderTypes": [{"name": "Transport", "priority": 1}]},
        )
        yield Handler(table.DISPATCH, self.dispatch_vehicle, {"point": "Parking bay"})
        yield Handler(table.INSTANT_ACTION, self.send_instant_action, {"actionType": "pause"})
        yield Handler(
            table.REROUTE, lambda name, request: self.reroute_vehicle(name, request.type), {"type": "REGULAR"}
        )

    def list_vehicles(self, request: VehiclesQuery) -> VehicleList:
        """Return a page of vehicles."""
        wanted = (
            vehicle
            for vehicle in self.iterate_statuses(request.after)
            if (not request.state or vehicle.state in request.state)
            and (not request.processing_state or vehicle.processing_state in request.processing_state)
        )
        page, following = page_of(wanted, request.limit)
        return VehicleList(vehicles=page, next=following)

    def iterate_statuses(self, after: str | None = None) -> Iterator[VehicleStatus]:
        """Yield all vehicles, or those after the one named ``after``."""
        vehicles = [*self._engine.registry]
        start = vehicles.index(self._find_vehicle(after)) + 1 if after is not None else 0
        return map(self._engine.reporter.vehicle_status, vehicles[start:])

    def find_status(self, name: str) -> VehicleStatus:
        """Return a vehicle."""
        return self._engine.reporter.vehicle_status(self._find_vehicle(name))

    async def set_integration_level(
        self, name: str, level: IntegrationLevel, by: str = SOMEBODY
    ) -> VehicleStatus:
        """Set the integration level of a vehicle; it survives restarts."""
        vehicle = self._find_vehicle(name)
        async with self._engine.unit_of_work.saved():
            self._engine.set_integration_level(vehicle, level, by)
        return self._engine.reporter.vehicle_status(vehicle)

    async def accept_order_types(self, name: str, types: tuple[AcceptableOrderType, ...]) -> VehicleStatus:
        """Set the order types that a vehicle accepts; they survive restarts."""
        vehicle = self._find_vehicle(name)
        async with self._engine.unit_of_work.saved():
            self._engine.accept_order_types(vehicle, types)
        return self._engine.reporter.vehicle_status(vehicle)

    async def dispatch_vehicle(
        self, name: str, request: DispatchRequest, caller: str
    ) -> tuple[TransportOrderStatus, bool]:
        """Send a vehicle somewhere with a new order; see :meth:`OrderOperations.create_order`."""
        self._find_vehicle(name)
        return await self._orders.create_order(
            TransportOrderRequest(
                destinations=(request.destination(),),
                intended_vehicle=name,
                priority=request.priority,
                idempotency_key=request.idempotency_key,
                traceparent=request.traceparent,
            ),
            caller,
        )

    async def reroute_vehicle(self, name: str, kind: ReroutingType) -> ReroutingAnswer:
        """Replan the route of the order that a vehicle works on; see :meth:`Rerouting.request`."""
        vehicle = self._find_vehicle(name)
        async with self._engine.unit_of_work.saved():
            rerouted = self._engine.reroute(vehicle, kind)
            order = self._engine.reporter.vehicle_status(vehicle).transport_order
        return ReroutingAnswer(
            vehicle=name,
            transport_order=order or "",
            outcome=rerouted.outcome,
            **explained(rerouted.reason),
            route=rerouted.route,
        )

    async def send_instant_action(self, name: str, request: InstantActionRequest) -> Reply:
        """Send an instant action to a vehicle and wait briefly for its end; 202: it is still running."""
        vehicle = self._find_vehicle(name)
        action_type = ACTION_TYPES.get(request.action_type, request.action_type)
        parameters = tuple(
            ActionParameter(key=parameter.key, value=parameter.value) for parameter in request.parameters
        )
        if request.pose:
            parameters = (*self._pose_parameters(vehicle, request.pose), *parameters)
        self._admit_instant_action(vehicle, action_type)
        action = Action(
            action_type=action_type,
            action_id=unique_id(),
            blocking_type=request.blocking_type,
            action_parameters=parameters,
        )
        sent = self._engine.send_instant_action(vehicle, action)
        seconds = self._engine.settings.instant_action_timeout
        end = await self._engine.state.instant_actions.wait(action.action_id, sent, seconds)
        answer = InstantActionAnswer(
            action_id=action.action_id,
            action_type=action_type,
            status=(end.status or "UNKNOWN") if end else "PENDING",
            **explained(end.reason if end else Reason(ReasonCode.ACTION_PENDING)),
            result=end.result if end else None,
        )
        return Reply(answer, HTTPStatus.OK if end else HTTPStatus.ACCEPTED)

    def _admit_instant_action(self, vehicle: FleetVehicle, action_type: str) -> None:
        """Raise an error if a vehicle cannot get an action now; note who stays paused after a stop."""
        link = self._engine.view(vehicle).link
        if link is LinkStatus.HIBERNATING and action_type != STOP_HIBERNATION:
            raise VehicleNotReachedError(
                vehicle.name, f"it is {link} until {STOP_HIBERNATION} or its wake-up time"
            )
        may_hear = link not in NOT_REACHED and self._engine.context.fleet.connected_for() > 0
        sent_unread = action_type == START_PAUSE and may_hear
        if link not in (LinkStatus.ONLINE, LinkStatus.HIBERNATING) and not sent_unread:
            raise VehicleNotReachedError(vehicle.name, f"it is {link}")
        has_order = (
            self._engine.state.drives.sent.get(vehicle.key)
            or self._engine.state.drives.order_number(vehicle.key) is not None
        )
        # 0048: VDA 5050 lets the robot clear its order; a host withdraws it, so that its end has a reason.
        if action_type in LEAVES and has_order:
            order = self._engine.reporter.vehicle_status(vehicle).transport_order
            text = "makes room for another vehicle. Retry when it has arrived."
            if order:
                text = f"works on order {order!r}. Wait for its end, or withdraw it."
            raise RefusedError(Refusal.VEHICLE_BUSY, f"Vehicle {vehicle.name!r} {text}")
        if action_type == START_PAUSE:
            # 0054: a robot that a person pauses stays paused at the end of a stop.
            self._engine.person_pauses(vehicle)
        elif action_type == STOP_PAUSE:
            # 0054: who ends the stop decides for all of its robots.
            if stop := self._engine.stops.stop_of(vehicle):
                raise RefusedError(
                    Refusal.VEHICLE_STOPPED,
                    f"Vehicle {vehicle.name!r} cannot continue: {stop.as_reason}. "
                    f"End the stop {stop.name!r} first.",
                )
            self._engine.stops.person_resumes(vehicle)

    def _pose_parameters(self, vehicle: FleetVehicle, wanted: InitialPose) -> Iterator[ActionParameter]:
        """Yield the parameters of initializePosition on a map of the vehicle's robot."""
        profile = vehicle.profile
        map_id, pose = wanted.map_id or profile.map_id, PlantPose(wanted.x, wanted.y, wanted.theta)
        if not profile.knows_frame(map_id):
            raise VehicleNotReachedError(
                vehicle.name, "its factsheet has not arrived, so it is unknown who transforms poses"
            )

        def distance(point: Point) -> float:
            return hypot(point.x_m - pose.x_m, point.y_m - pose.y_m)

        points = (point for point in self._engine.plant.points if (point.map_id or profile.map_id) == map_id)
        near = [point for point in points if distance(point) <= profile.deviation_xy]
        on_map = profile.on(map_id).pose_to_map(pose)
        yield ActionParameter(key="x", value=on_map.x_m)
        yield ActionParameter(key="y", value=on_map.y_m)
        yield ActionParameter(key="theta", value=on_map.heading_rad)
        yield ActionParameter(key="mapId", value=map_id)
        yield ActionParameter(key="lastNodeId", value=min(near, key=distance).name if near else "")

    def _find_vehicle(self, name: str) -> FleetVehicle:
        vehicle = self._engine.registry.named(name)
        if vehicle is None:
            raise UnknownError(Refusal.UNKNOWN_VEHICLE, name)
        return vehicle
