"""What hosts may ask for, the same through both doors."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from nena_order_service.errors import (
    KeyReusedError,
    NameTakenError,
    OrderEndedError,
    OrderWithdrawnError,
    SequenceRefusesError,
    UnknownDependencyError,
    UnknownOrderError,
    UnknownSequenceError,
    UnknownVehicleError,
    VehicleNotReachedError,
    VersionChangedError,
)
from nena_order_service.fleet import InstantActionEnded, LinkStatus
from nena_order_service.fleet.operations import fresh_id
from nena_order_service.kernel.delivery_status import delivery_status
from nena_order_service.kernel.etag import ETag
from nena_order_service.kernel.kernel import Kernel
from nena_order_service.kernel.promises import committed, require_store
from nena_order_service.kernel.settings import KernelSettings
from nena_order_service.kernel.vehicles import FleetVehicle
from nena_order_service.orders.names import sortable_id
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.validation import check_request
from nena_order_service.store.database import OrderFilter
from nena_shared.fleet_api.assignment import AssignmentStatus, VehicleForOrder
from nena_shared.fleet_api.delivery import DeliveryStatus
from nena_shared.fleet_api.order_types import AcceptableOrderType
from nena_shared.fleet_api.rerouting import ReroutingAnswer, ReroutingType
from nena_shared.fleet_api.transport_order import (
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import IntegrationLevel, VehicleStatus
from nena_shared.log import get_logger
from nena_shared.plant import MapPose, PlantPose, Point
from nena_shared.vda5050.action import Action, ActionParameter, BlockingType

log = get_logger(__name__)

NAME_PREFIX = "TOrder"

VEHICLES_EXPLAINED = 100
"""Vehicles of which it is said why they do not do an order, unless a host asks for more or less."""


@dataclass(frozen=True, slots=True)
class RobotPose:
    """A pose on a robot's map, and the point of the plant that is there, empty for none."""

    pose: MapPose
    map_id: str
    point: str


class HostRequests:
    """Answers hosts; what it has answered is committed.

    Every method may raise what :mod:`nena_order_service.errors` holds.
    """

    def __init__(self, kernel: Kernel, settings: KernelSettings) -> None:
        self._kernel = kernel
        self._settings = settings

    async def create(self, request: TransportOrderRequest) -> tuple[TransportOrderStatus, bool]:
        """Make an order; False: it is the one that the same request has made before.

        The same request has the same idempotency key, or without one the same name.

        Raises:
            InvalidRequestError: it makes no sense in this plant.

        """
        check_request(request, self._kernel.plant, self._kernel.registry.names())
        name, complete = request.name or NAME_PREFIX, request.name is None or request.incomplete_name
        if complete:
            name = f"{name}-{sortable_id()}"
        known = await self._find(None if complete else name, request.idempotency_key)
        if known is None:
            ended = await self._ended_dependencies(request)
            await self._check_sequence(request)
            known = self._at_hand(None if complete else name, request.idempotency_key)  # it came in between
        if known is None:
            self._require_store()
            known = self._kernel.create(request, name, ended)
            try:
                await self._committed()
            finally:  # so that no robot waits for its order while a line is written
                log.info("order created", order=name, state=known.state.value)
            return self._visible(known), True
        if known.idempotency_key != request.idempotency_key:
            raise NameTakenError(name)
        named = known.name.startswith(f"{request.name or NAME_PREFIX}-") if complete else known.name == name
        if not (named and known.asked_for_by(request)):
            key = request.idempotency_key
            raise NameTakenError(name) if key is None else KeyReusedError(key, known.name)
        await self._committed()
        return self._visible(known), False

    async def withdraw(
        self, name: str, reason: str, *, seen: ETag | None = None, immediate: bool = True
    ) -> TransportOrderStatus:
        """Withdraw an order: it fails at once, or when the vehicle that works on it has let it go.

        Only if it still is as the caller has ``seen`` it; None: whatever it is now. Not ``immediate``, its
        vehicle drives to the end of what it was given.
        """
        order = await self._living(name, seen)
        self._kernel.withdraw(order.number, reason, immediate=immediate)
        await self._committed()
        return self._visible(order)

    async def hold(
        self, name: str, by: str, reason: str, *, seen: ETag | None = None, immediate: bool = True
    ) -> TransportOrderStatus:
        """Let an order wait until it is resumed; one that is held already is held by whom it was.

        ``seen`` and ``immediate`` are as in :meth:`withdraw`.
        """
        order = await self._living(name, seen)
        if order.state is TransportOrderState.WITHDRAWN:
            raise OrderWithdrawnError(name)
        self._kernel.hold(order.number, by, reason, immediate=immediate)
        await self._committed()
        return self._visible(order)

    async def resume(
        self, name: str, by: str, reason: str, *, seen: ETag | None = None
    ) -> TransportOrderStatus:
        """Let a held order go on; one that nobody holds goes on anyway. ``seen`` as in :meth:`withdraw`."""
        order = await self._living(name, seen)
        self._kernel.resume(order.number, by, reason)
        await self._committed()
        return self._visible(order)

    async def order(self, name: str) -> TransportOrderStatus:
        """Give an order."""
        found = self._kernel.book.visible_named(name) or await self._kernel.store.order(name=name)
        if found is None:
            raise UnknownOrderError(name)
        return found.status

    async def orders(self, wanted: OrderFilter) -> tuple[TransportOrder, ...]:
        """Give a page of orders, newest first."""
        return await self._kernel.store.orders(wanted)

    async def delivery(self, name: str) -> DeliveryStatus:
        """Tell how far an order has come on its way to its robot."""
        order = await self.order(name)
        vehicle = self._kernel.registry.named(order.processing_vehicle)
        return delivery_status(order, self._kernel.view(vehicle) if vehicle else None)

    async def assignment(self, name: str, limit: int = VEHICLES_EXPLAINED) -> AssignmentStatus:
        """Tell of each vehicle why it does not do an order, of ``limit`` vehicles at the most."""
        status, order = await self.order(name), self._kernel.book.named(name)
        found = [] if order is None or order.state.final else self._kernel.explain(order)
        return AssignmentStatus(
            transport_order=status.name,
            state=status.state,
            reason=status.reason,
            processing_vehicle=status.processing_vehicle,
            vehicles=tuple(
                VehicleForOrder(vehicle=each.vehicle, fits=each.fits, reason=each.reason, cost=each.cost)
                for each in found[:limit]
            ),
            left_out=len(found[limit:]),
        )

    def vehicles(self) -> tuple[VehicleStatus, ...]:
        """Give all vehicles."""
        return tuple(self._kernel.status(vehicle) for vehicle in self._kernel.registry)

    def vehicle(self, name: str) -> VehicleStatus:
        """Give a vehicle."""
        return self._kernel.status(self._vehicle(name))

    async def set_integration_level(self, name: str, level: IntegrationLevel) -> VehicleStatus:
        """Let a vehicle count so much from now on, also after a restart."""
        vehicle = self._vehicle(name)
        self._require_store()
        self._kernel.set_integration_level(vehicle, level)
        await self._committed()
        return self._kernel.status(vehicle)

    async def accept_order_types(self, name: str, types: tuple[AcceptableOrderType, ...]) -> VehicleStatus:
        """Let a vehicle accept orders of these types from now on, also after a restart."""
        vehicle = self._vehicle(name)
        self._require_store()
        self._kernel.accept_order_types(vehicle, types)
        await self._committed()
        return self._kernel.status(vehicle)

    async def reroute(self, name: str, kind: ReroutingType) -> ReroutingAnswer:
        """Plan the way of the order that a vehicle works on anew; see :meth:`Rerouting.request`."""
        vehicle = self._vehicle(name)
        self._require_store()
        done = self._kernel.reroute(vehicle, kind)
        order = self._kernel.status(vehicle).transport_order
        await self._committed()
        return ReroutingAnswer(
            vehicle=name,
            transport_order=order or "",
            outcome=done.outcome,
            reason=done.reason,
            route=done.route,
        )

    async def instant_action(
        self,
        name: str,
        action_type: str,
        parameters: tuple[ActionParameter, ...] = (),
        blocking_type: BlockingType = BlockingType.NONE,
    ) -> tuple[Action, InstantActionEnded | None]:
        """Send an instant action to a vehicle and wait a while for its end; None: it goes on."""
        vehicle = self._vehicle(name)
        link = self._kernel.view(vehicle).link
        if link is not LinkStatus.ONLINE:
            raise VehicleNotReachedError(name, f"it is {link}")
        action = Action(
            action_type=action_type,
            action_id=fresh_id(),
            blocking_type=blocking_type,
            action_parameters=parameters,
        )
        end = self._kernel.send_instant_action(vehicle, action)
        seconds = self._settings.instant_action_timeout
        return action, await self._kernel.instant_actions.wait(action.action_id, end, seconds)

    def robot_pose(self, name: str, pose: PlantPose, map_id: str | None = None) -> RobotPose:
        """Give a pose of the plant in the words of a vehicle's robot; without a map, on its own."""
        profile = self._vehicle(name).profile
        map_id = map_id or profile.map_id
        if not profile.knows_frame(map_id):
            raise VehicleNotReachedError(name, "its factsheet, which says who transforms poses, has not come")
        points = [each for each in self._kernel.plant.points if (each.map_id or profile.map_id) == map_id]
        near = [each for each in points if _distance(each, pose) <= profile.deviation_xy]
        point = min(near, key=lambda each: _distance(each, pose)).name if near else ""
        return RobotPose(profile.on(map_id).pose_to_map(pose), map_id, point)

    async def _ended_dependencies(self, request: TransportOrderRequest) -> dict[str, TransportOrderState]:
        """Give the final states of dependencies; raises UnknownDependencyError."""
        ended: dict[str, TransportOrderState] = {}
        unknown: list[str] = []
        for name in request.dependencies:
            known = await self._find(name, None)
            if known is None:
                unknown.append(name)
            elif known.state.final:
                ended[name] = known.state
        if unknown:
            raise UnknownDependencyError(unknown)
        return ended

    async def _check_sequence(self, request: TransportOrderRequest) -> None:
        """See to it that the order may be added to the sequence that it names, if it names one."""
        name = request.wrapping_sequence
        if name is None:
            return
        sequence = self._kernel.sequence_book.named(name) or await self._kernel.store.sequence(name=name)
        sequence = self._kernel.sequence_book.named(name) or sequence
        if sequence is None:
            raise UnknownSequenceError(name)
        if reasons := tuple(sequence.refusals(request)):
            raise SequenceRefusesError(name, reasons)

    async def _living(self, name: str, seen: ETag | None) -> TransportOrder:
        """Give an order that can be changed."""
        order = self._kernel.book.named(name) or await self._kernel.store.order(name=name)
        if order is None:
            raise UnknownOrderError(name)
        if order.state.final:
            raise OrderEndedError(name, order.state)
        if seen is not None and not seen.fits(order.status.version):
            raise VersionChangedError(name, str(seen), order.status.version)
        self._require_store()
        return order

    async def _find(self, name: str | None, key: str | None) -> TransportOrder | None:
        """Give the order of this key, else of this name; from the store where it is not at hand."""
        if found := self._at_hand(name, key):
            return found
        if name is None and key is None:
            return None
        stored = await self._kernel.store.order(name=name, idempotency_key=key)
        return stored or self._at_hand(name, key)

    def _at_hand(self, name: str | None, key: str | None) -> TransportOrder | None:
        return self._kernel.book.keyed(key) or (self._kernel.book.named(name) if name else None)

    def _vehicle(self, name: str) -> FleetVehicle:
        vehicle = self._kernel.registry.named(name)
        if vehicle is None:
            raise UnknownVehicleError(name)
        return vehicle

    def _visible(self, order: TransportOrder) -> TransportOrderStatus:
        return (self._kernel.book.visible(order.number) or order).status

    def _require_store(self) -> None:
        require_store(self._kernel.store)

    async def _committed(self) -> None:
        await committed(self._kernel.steps, self._kernel.store, self._settings.commit_timeout)


def _distance(point: Point, pose: PlantPose) -> float:
    """Give the distance in m."""
    return hypot(point.x_m - pose.x_m, point.y_m - pose.y_m)
