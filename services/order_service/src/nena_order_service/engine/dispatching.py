"""Dispatching: how vehicles look to the dispatcher, its decisions, and why vehicles have no orders."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from nena_order_service.dispatching.candidates import DispatchedVehicle, Energy, reported_loads
from nena_order_service.dispatching.dispatcher import BUSY, Assignment, Dispatcher, VehicleFit, explain_fits
from nena_order_service.engine.context import Context
from nena_order_service.engine.driving import Driving
from nena_order_service.engine.order_knowledge import OrderFit, OrderKnowledge
from nena_order_service.fleet.availability import with_received
from nena_order_service.fleet.position import NotLocatedError
from nena_order_service.fleet.robot import LinkStatus, RobotView
from nena_order_service.fleet.vda_order import DROP
from nena_order_service.orders.automatic import is_automatic_recharge
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing.router import RoutePlan
from nena_order_service.vehicles.registry import FleetVehicle, why_not_on
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import VehicleState

R = ReasonCode

NO_ORDER = Reason(R.NO_ORDERS)
NO_ORDER_FITS = Reason(R.NO_ORDER_FITS)
GIVES_UP = Reason(R.ENDS_DISPENSABLE_ORDER)

STANDS_STILL = (VehicleState.UNKNOWN, VehicleState.UNAVAILABLE, VehicleState.ERROR)
"""Vehicle states in which a robot can at most continue its current order."""


@dataclass(frozen=True, slots=True)
class Dispatched:
    """An assignment, with its vehicle and route."""

    assignment: Assignment
    vehicle: FleetVehicle
    way: RoutePlan


class Dispatching:
    """Runs the dispatcher over the current vehicles."""

    def __init__(self, context: Context, driving: Driving, fit: OrderFit) -> None:
        settings = context.settings.dispatch
        self._dispatcher = Dispatcher(settings)
        self._energy = settings.energy
        self._loads_respected = settings.loads_respected
        self._maps_respected = settings.maps_respected
        self._registry = context.registry
        self._state = context.state
        self._orders = context.state.orders
        self._planner = context.planner
        self._driving = driving
        self._traffic = context.traffic
        self.fit = fit
        self._view = context.view
        self._clock = context.clock
        self.knowledge = OrderKnowledge(context, fit)
        self._reserved: dict[int, str] = {}
        """Vehicles that give up dispensable orders, by the number of the order for which each is reserved."""
        self._decided_on: dict[str, DispatchedVehicle] = {}
        """The vehicles as they were at the last decision: only other ones are a reason for the next."""

    def decide(self, orders: Sequence[TransportOrder]) -> tuple[list[Dispatched], dict[str, Reason]]:
        """Return the assignments to make, and the wait reasons of the other orders by name.

        ``orders`` wait and are not held, the most urgent ones first. A vehicle that first has to give up a
        dispensable order is reserved for its new one.
        """
        self._drop_reservations()
        if not orders:
            return [], {}
        candidates: Iterable[FleetVehicle] = self._registry
        intended = {self._reserved.get(order.number, order.status.intended_vehicle) for order in orders}
        if None not in intended:  # no order can go to any other vehicle, so none needs to be looked at
            candidates = filter(None, (self._registry.named(name) for name in intended if name))
        vehicles = {
            vehicle.name: self.to_candidate(vehicle) for vehicle in candidates if not vehicle.obstacle
        }
        self._decided_on.update(vehicles)
        decisions = self._dispatcher.decide(
            orders, vehicles.values(), self.knowledge, now=self._clock.now(), kept=self._reserved
        )
        for order in orders:
            reserved = vehicles.get(self._reserved.get(order.number, ""))
            if reserved and not reserved.obstacle and order.name in decisions.reasons:
                # The vehicle is free, but the order cannot be assigned to it.
                del self._reserved[order.number]
        return [*map(self._to_dispatched, decisions.assignments)], decisions.reasons

    def _to_dispatched(self, assignment: Assignment) -> Dispatched:
        vehicle = self._registry.named(assignment.vehicle)
        assert vehicle, "only vehicles of the registry get orders"  # noqa: S101 - for the type
        if assignment.gives_up:
            self._reserved[assignment.order.number] = vehicle.name
        standing = self._planner.standing(vehicle, self._view(vehicle))
        return Dispatched(assignment, vehicle, self._planner.way(assignment.order, vehicle, standing))

    def is_due_for(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle has changed since the last decision so that waiting orders may suit it."""
        if vehicle.obstacle or not self._orders.any_waiting:
            return False
        candidate, decided_on = self.to_candidate(vehicle), self._decided_on.get(vehicle.name)
        if decided_on and (decided_on.group, decided_on.start) == (candidate.group, candidate.start):
            return False
        # A new order of its own does not count: all waiting orders were considered when it was assigned.
        return candidate.obstacle != BUSY

    def explain(self, order: TransportOrder) -> list[VehicleFit]:
        """Return for each vehicle whether it could execute this order, or why not; best ones first."""
        vehicles = (self.to_candidate(vehicle) for vehicle in self._registry if not vehicle.obstacle)
        return explain_fits(order, vehicles, self.knowledge, kept=self._reserved)

    def idle_reason(self, vehicle: FleetVehicle) -> Reason:
        """Return why a vehicle without an order has none."""
        candidate = self.to_candidate(vehicle)
        no_order = NO_ORDER_FITS if self._orders.any_waiting else NO_ORDER
        return candidate.obstacle or candidate.restriction or no_order

    def to_candidate(self, vehicle: FleetVehicle) -> DispatchedVehicle:
        """Return a vehicle as the dispatcher sees it now."""
        order = self._state.order_of(vehicle.key)
        obstacle, soon = vehicle.obstacle, False
        if not obstacle and order is not None and not _is_given_up_for_others(order):
            # A vehicle that ends a dispensable order for a new one, or is about to unload at the end of its
            # order, may be planned with before it is free.
            is_giving_up = (
                order.state is TransportOrderState.WITHDRAWN
                and vehicle.name in self._reserved.values()
                and self._view(vehicle).link is LinkStatus.ONLINE
            )
            soon = not is_giving_up and self._unloads_at_end(order)
            obstacle = GIVES_UP if is_giving_up else None if soon else BUSY
        start, view = "", None
        if not obstacle:
            view = self._view(vehicle)
            obstacle, start = self._obstacle_and_start(vehicle, view, order)
        types, bound = self.fit.order_types(vehicle), self.fit.sequences.bound_to(vehicle.name)
        if view is None or obstacle:
            return DispatchedVehicle(
                vehicle.name, BUSY if soon else obstacle, order_types=types, sequence=bound
            )
        energy, carried_loads = self.energy_of(vehicle, view), None
        restriction = energy.restriction(fully=self._energy.until_fully_recharged) if energy else None
        # A host that plans all orders of a vehicle as a sequence knows itself what the vehicle carries.
        if not soon and view.state and self._loads_respected and not bound:
            carried_loads = reported_loads(view.state, view.factsheet)
        return DispatchedVehicle(
            vehicle.name,
            BUSY if soon else None,
            restriction=restriction and with_received(restriction, view.substituted),
            energy=energy.level if energy else 100.0,
            idle=(order is None or soon) and not (energy and energy.charging),
            gives_up=order.name if order and not soon else "",
            kept_for=next((number for number, name in self._reserved.items() if name == vehicle.name), None),
            order_types=types,
            carried=carried_loads,
            soon=soon,
            sequence=bound,
            start=start,
            routing_kind=self._planner.finder.router.kind_of(vehicle.model),
        )

    def _obstacle_and_start(
        self, vehicle: FleetVehicle, view: RobotView, order: TransportOrder | None
    ) -> tuple[Reason | None, str]:
        """Return why a vehicle, whose order does not keep it, takes none, or from which point it drives."""
        if obstacle := self._obstacle_of(vehicle, view, order):
            return obstacle, ""
        try:
            start = self._planner.standing(vehicle, view).point
        except NotLocatedError as error:
            return Reason(R.NOT_DISPATCHABLE, with_received(error.reason, view.substituted)), ""
        if view.state is None or not view.state.maps or not self._maps_respected:
            return None, start
        # Only the map of the start point: a robot itself rejects routes that lead over maps that it lacks.
        return why_not_on(self._planner.map_id(start, vehicle), view.state), start

    def energy_of(self, vehicle: FleetVehicle, view: RobotView) -> Energy | None:
        """Return the energy of a vehicle; None if it is unknown or the settings ignore it."""
        if view.state is None or not self._energy.respected:
            return None
        thresholds = vehicle.model.energy_thresholds if vehicle.model else self._energy.thresholds
        power = view.state.power_supply
        return Energy(power.state_of_charge, power.charging, thresholds)

    def _obstacle_of(
        self, vehicle: FleetVehicle, view: RobotView, order: TransportOrder | None
    ) -> Reason | None:
        """Return why a vehicle, with no order or with one that it would give up, cannot take an order."""
        if stop := self._driving.stops.stop_of(vehicle):
            return Reason(R.IS_STOPPED, stop.as_reason)
        if order is None:
            reason = None if view.availability.can_take_order else view.availability.reason
            if view.link is LinkStatus.UNREADABLE:
                return reason
            if self._traffic.route_of(vehicle.name):
                return Reason(R.MAKES_ROOM)
            return self._driving.positions.obstacle_of(vehicle) or reason
        if view.link is not LinkStatus.ONLINE or view.vehicle_state in STANDS_STILL:
            return BUSY  # it could not be told to give its order up, or could not drive for the next one
        return self._driving.positions.obstacle_of(vehicle)

    def _unloads_at_end(self, order: TransportOrder) -> bool:
        """Return whether a vehicle is about to be free, because it unloads at the end of its order."""
        if order.index < len(order.status.drive_orders) - 1 or not order.is_operating:
            return False
        if order.state is not TransportOrderState.BEING_PROCESSED or order.held:
            return False
        return self._planner.action_type(order.current.destination.operation) == DROP

    def _drop_reservations(self) -> None:
        """Drop reservations unless the order still waits and the vehicle is about to be free."""
        for number, name in tuple(self._reserved.items()):
            vehicle = self._registry.named(name)
            order = self._orders.find(number)
            waits = order and order.state is TransportOrderState.DISPATCHABLE and not order.held
            intended = order.status.intended_vehicle if order else None
            obstacle = self.to_candidate(vehicle).obstacle if vehicle else BUSY
            if not waits or intended not in (None, name) or obstacle not in (None, GIVES_UP):
                del self._reserved[number]


def _is_given_up_for_others(order: TransportOrder) -> bool:
    """Return whether an order is given up for another one; an automatic recharge only while charging."""
    if order.state is not TransportOrderState.BEING_PROCESSED or order.held:
        return False
    # On its way to recharge, a vehicle still lacks the energy for others.
    return order.status.dispensable or (is_automatic_recharge(order) and order.is_operating)
