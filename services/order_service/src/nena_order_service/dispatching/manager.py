"""Dispatching: joins the dispatcher with the vehicles as they are, and says why orders wait."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from nena_order_service.context import Context
from nena_order_service.dispatching.dispatcher import (
    BUSY,
    Assignment,
    Carried,
    DispatchedVehicle,
    Dispatcher,
    Energy,
    Pick,
    VehicleFit,
    acceptable,
    carried,
    explain,
    why_not_accepted,
)
from nena_order_service.fleet import LinkStatus, NotLocatedError, RobotView, Standing
from nena_order_service.orders.automatic import is_automatic_recharge
from nena_order_service.orders.sequences import Sequences
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import OrderPlanner
from nena_order_service.routing import NoRouteError
from nena_order_service.routing.order_routes import OrderCosts, RouteCost, RouteCosts, RoutePlan
from nena_order_service.state import VehicleRecords
from nena_order_service.traffic.driving import Driving
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry, why_not_on
from nena_shared.fleet_api.transport_order import Destination, DriveOrderState, TransportOrderState
from nena_shared.fleet_api.vehicle import AcceptableOrderType, VehicleState


@dataclass(frozen=True, slots=True)
class OrderFit:
    """Joins what hosts and the plant model say of vehicles and orders."""

    records: VehicleRecords
    sequences: Sequences

    def order_types(self, vehicle: FleetVehicle) -> tuple[AcceptableOrderType, ...]:
        """Return the types of orders that a vehicle accepts: what hosts have said, else the plant model."""
        said = self.records.of(vehicle.key).acceptable_order_types
        if said is not None:
            return said
        return acceptable(vehicle.model.acceptable_order_types if vehicle.model else None)

    def accept(self, vehicle: FleetVehicle, types: tuple[AcceptableOrderType, ...]) -> None:
        """Let a vehicle accept orders of these types from now on; an order that it has it does to the end."""
        self.records.change(vehicle.key, acceptable_order_types=types)

    def misfit(self, order: TransportOrder, vehicle: FleetVehicle) -> str:
        """Return, as a predicate, why a vehicle must not be given an order; empty where it may."""
        if vehicle.name in order.status.excluded_vehicles:
            return "has failed at it"
        why = self.sequences.misfit(order, vehicle.name)
        return why or why_not_accepted(self.order_types(vehicle), order.status.type)


REASONS_KEPT = 1000
"""Why there is no way: asked for again and again for each order that waits for one."""


class KnownCosts:
    """Costs of ways, and why there is none; remembered until the plant changes."""

    def __init__(self, planner: OrderPlanner, registry: VehicleRegistry) -> None:
        self.planner = planner
        self.finder = planner.finder
        self.registry = registry
        self.ways = RouteCosts(planner.plant, planner.finder)
        self._why = lru_cache(REASONS_KEPT)(self._find_out_why)

    def forget(self) -> None:
        """Ask anew why there is no way; the router forgets costs by itself."""
        self._why.cache_clear()

    def why_no_way(self, order: TransportOrder, vehicle: str, start: str) -> str:
        """Return why a vehicle that starts at a point has no way."""
        stops = tuple(_stops(order))
        return self._why(stops, order.resources_to_avoid, vehicle, start)

    def _find_out_why(
        self, stops: Sequence[Destination], avoid: frozenset[str], vehicle: str, start: str
    ) -> str:
        try:
            self.finder.find(start, stops, vehicle=self.registry.model(vehicle), avoid=avoid)
        except NoRouteError as error:
            return str(error)
        return "it costs too much"


class OrderKnowledge:
    """What the dispatcher asks during one decision."""

    def __init__(
        self,
        costs: KnownCosts,
        places: Mapping[str, tuple[FleetVehicle, str]],
        planner: OrderPlanner,
        fit: OrderFit,
    ) -> None:
        """``places`` gives vehicles that may get orders, and the points from which they would start."""
        self._costs = costs
        self._places = places
        self._planner = planner
        self._fit = fit
        self._kinds = {name: costs.finder.kind(each.model) for name, (each, _) in places.items()}
        self._known: dict[tuple[int, int], OrderCosts] = {}

    def misfit(self, order: TransportOrder, vehicle: str) -> str:
        """Return, as a predicate, why a vehicle must not do an order at all; empty where it may."""
        known = self._costs.registry.named(vehicle)
        return "" if known is None or order.status.automatic else self._fit.misfit(order, known)

    def recharges(self, order: TransportOrder) -> bool:
        """Return whether the next thing that an order asks for is to recharge."""
        return self._planner.recharges(order)

    def pick(self, order: TransportOrder) -> Pick | None:
        """Return what an order picks up first; None: nothing, or it drops something before."""
        return self._planner.pick(order)

    def cost(self, order: TransportOrder, vehicle: str) -> RouteCost:
        """Return the cost of a vehicle's route through an order's destinations; infinity: no route."""
        who, start = self._places[vehicle]
        stops = _stops(order)
        if any(each.coordinate for each in stops):
            return self._costs.ways.cost(start, stops, vehicle=who.model, avoid=order.resources_to_avoid)
        key = order.number, self._kinds[vehicle]
        known = self._known.get(key)
        if known is None:
            known = self._costs.ways.of(stops, vehicle=who.model, avoid=order.resources_to_avoid)
            self._known[key] = known
        return known.source(start)

    def why_no_way(self, order: TransportOrder, vehicle: str) -> str:
        """Return why there is no way."""
        return self._costs.why_no_way(order, vehicle, self._places[vehicle][1])


def _stops(order: TransportOrder) -> list[Destination]:
    """Return the destinations that are not reached yet."""
    return [each.destination for each in order.status.drive_orders[order.index :]]


NO_ORDER = "has nothing to do: no order waits"
NO_ORDER_FITS = (
    "has nothing to do: the orders that wait are for other vehicles or of types that it does not accept, "
    "or it cannot reach them, or has no room for what is to be picked up"
)
GIVES_UP = "gives up a dispensable order first"
STANDS_STILL = (VehicleState.UNKNOWN, VehicleState.UNAVAILABLE, VehicleState.ERROR)
"""States in which a robot could not go on with another order than it has."""


@dataclass(frozen=True, slots=True)
class LocatedCandidate:
    """A vehicle as the dispatcher sees it, and where it stands; None where nobody knows."""

    vehicle: FleetVehicle
    seen: DispatchedVehicle
    standing: Standing | None = None

    @property
    def matters(self) -> tuple[object, ...]:
        """What makes a difference for who gets which order; energy alone does not."""
        seen = self.seen
        where = self.standing and self.standing.point
        return seen.obstacle, seen.restriction, seen.gives_up, seen.carried, where


@dataclass(frozen=True, slots=True)
class Dispatched:
    """An assignment, and the vehicle and way by which it is done."""

    assignment: Assignment
    vehicle: FleetVehicle
    way: RoutePlan


class Dispatching:
    """Asks the dispatcher, and says why vehicles have nothing to do."""

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
        self.fit = fit
        self._view = context.view
        self._clock = context.clock
        self._costs = KnownCosts(context.planner, context.registry)
        self._kept: dict[int, str] = {}
        """Vehicles that give up dispensable orders, by the numbers of the orders that they are kept for."""
        self._looked_at: dict[str, tuple[object, ...]] = {}
        """What mattered of each vehicle when it was looked at last."""

    def dispatch(self, orders: Sequence[TransportOrder]) -> tuple[list[Dispatched], dict[str, str]]:
        """Return what is to be assigned of orders, and why the others wait, by name.

        Where a vehicle has to give up a dispensable order first, it is kept for its new one from now on.
        """
        self._forget_kept()
        if not orders:
            return [], {}
        candidates = self._candidates(orders)
        decisions = self._dispatcher.decide(
            orders,
            (each.seen for each in candidates.values()),
            self._knowledge(candidates),
            now=self._clock.now(),
            kept=self._kept,
        )
        for order in orders:
            kept = candidates.get(self._kept.get(order.number, ""))
            if kept and not kept.seen.obstacle and order.name in decisions.reasons:
                del self._kept[order.number]  # it is free, and still the order cannot be given to it
        dispatched = []
        for assignment in decisions.assignments:
            candidate = candidates[assignment.vehicle]
            assert candidate.standing, "who is assigned anything stands somewhere"  # noqa: S101 - for the type
            if assignment.gives_up:
                self._kept[assignment.order.number] = assignment.vehicle
            way = self._planner.way(assignment.order, candidate.vehicle, candidate.standing)
            dispatched.append(Dispatched(assignment, candidate.vehicle, way))
        return dispatched, decisions.reasons

    def explain(self, order: TransportOrder) -> list[VehicleFit]:
        """Say of each vehicle why it does not do this order, or that it could."""
        candidates = self._candidates()
        seen = (each.seen for each in candidates.values())
        return explain(order, seen, self._knowledge(candidates), kept=self._kept)

    def forget(self) -> None:
        """Look anew for each way: the plant has changed."""
        self._costs.forget()

    def has_changed(self, vehicle: FleetVehicle) -> bool:
        """Return whether anything that matters here is new about a vehicle since it was looked at.

        That it works on an order now is no news: whoever gave it the order has looked at those that wait.
        """
        before = self._looked_at.get(vehicle.name)
        now = self._look_at(vehicle)
        return now.matters != before and now.seen.obstacle != BUSY

    def idle_reason(self, vehicle: FleetVehicle, *, orders_wait: bool) -> str:
        """Return why a vehicle that works on no order has none."""
        seen = self.consider(vehicle).seen
        return seen.obstacle or seen.restriction or (NO_ORDER_FITS if orders_wait else NO_ORDER)

    def is_bound(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle does nothing but an order sequence."""
        return self.fit.sequences.bound_to(vehicle.name) is not None

    def consider(self, vehicle: FleetVehicle) -> LocatedCandidate:
        """Return a vehicle as the dispatcher sees it now."""
        if vehicle.obstacle:
            return _hindered(vehicle, vehicle.obstacle)
        order = self._state.order_of(vehicle.key)
        if order is not None and not self._would_give_up(order):
            return _hindered(vehicle, GIVES_UP if self._is_giving_up(vehicle, order) else BUSY)
        view = self._view(vehicle)
        if obstacle := self._obstacle(vehicle, view, order):
            return _hindered(vehicle, obstacle)
        try:
            standing = self._planner.standing(vehicle, view)
        except NotLocatedError as error:
            return _hindered(vehicle, f"cannot be sent anywhere: {error.reason}")
        if obstacle := self._lacks_map(vehicle, view, standing):
            return _hindered(vehicle, obstacle)
        energy = self.energy(vehicle, view)
        seen = DispatchedVehicle(
            vehicle.name,
            restriction=energy.restriction(fully=self._energy.until_fully_recharged) if energy else "",
            energy=energy.level if energy else 100.0,
            idle=order is None and not (energy and energy.charging),
            gives_up=order.name if order else "",
            kept_for=next((number for number, name in self._kept.items() if name == vehicle.name), None),
            order_types=self.fit.order_types(vehicle),
            carried=self._carried(vehicle, view),
        )
        return LocatedCandidate(vehicle, seen, standing)

    def energy(self, vehicle: FleetVehicle, view: RobotView) -> Energy | None:
        """Return how much energy a vehicle has; None where that is of no account."""
        if view.state is None or not self._energy.respected:
            return None
        thresholds = vehicle.model.energy_thresholds if vehicle.model else self._energy.thresholds
        power = view.state.power_supply
        return Energy(power.state_of_charge, power.charging, thresholds)

    def _obstacle(self, vehicle: FleetVehicle, view: RobotView, order: TransportOrder | None) -> str:
        """Return why a vehicle takes no order though it has none, or one that it would give up."""
        if order is None:
            obstacle = self._driving.obstacle(vehicle)
            free = view.availability.can_take_order
            return obstacle or ("" if free else view.availability.reason)
        if view.link is not LinkStatus.ONLINE or view.vehicle_state in STANDS_STILL:
            return BUSY
        return self._driving.obstacle_at(vehicle)

    def _lacks_map(self, vehicle: FleetVehicle, view: RobotView, standing: Standing) -> str:
        """Say that a robot cannot drive on the map of the point where it begins; others it refuses itself."""
        if view.state is None or not self._maps_respected:
            return ""
        return why_not_on(self._planner.map_id(standing.point, vehicle), view.state)

    def _carried(self, vehicle: FleetVehicle, view: RobotView) -> Carried | None:
        """Return the loads that count: not those of a vehicle whose host has planned all that it is to do."""
        if view.state is None or not self._loads_respected or self.is_bound(vehicle):
            return None
        return carried(view.state, view.factsheet)

    def _is_giving_up(self, vehicle: FleetVehicle, order: TransportOrder) -> bool:
        """Return whether a vehicle is about to be free for the order that it is kept for."""
        if order.state is not TransportOrderState.WITHDRAWN or vehicle.name not in self._kept.values():
            return False
        return self._view(vehicle).link is LinkStatus.ONLINE

    def _would_give_up(self, order: TransportOrder) -> bool:
        """Return whether an order is given up for another one; whoever recharges has to be done with that."""
        if order.state is not TransportOrderState.BEING_PROCESSED or order.held:
            return False
        return order.status.dispensable or (is_automatic_recharge(order) and is_operating(order))

    def _candidates(self, orders: Sequence[TransportOrder] = ()) -> dict[str, LocatedCandidate]:
        """Look at all vehicles, or only at those that are meant where each of the orders means one."""
        meant = {each.status.intended_vehicle for each in orders}
        vehicles: Iterable[FleetVehicle] = self._registry
        if meant and None not in meant:
            vehicles = filter(None, map(self._registry.named, sorted(map(str, meant))))
        return {each.name: self._look_at(each) for each in vehicles if not each.obstacle}

    def _look_at(self, vehicle: FleetVehicle) -> LocatedCandidate:
        """Consider a vehicle, and remember what mattered."""
        found = self.consider(vehicle)
        self._looked_at[vehicle.name] = found.matters
        return found

    def _knowledge(self, candidates: dict[str, LocatedCandidate]) -> OrderKnowledge:
        places = {
            name: (each.vehicle, each.standing.point)
            for name, each in candidates.items()
            if each.standing is not None
        }
        return OrderKnowledge(self._costs, places, self._planner, self.fit)

    def _forget_kept(self) -> None:
        """Keep vehicles only for orders that wait, and while they are about to be free."""
        for number, name in tuple(self._kept.items()):
            vehicle = self._registry.named(name)
            order = self._orders.find(number)
            waits = order is not None and order.state is TransportOrderState.DISPATCHABLE and not order.held
            obstacle = self.consider(vehicle).seen.obstacle if vehicle else BUSY
            if not waits or obstacle not in ("", GIVES_UP):
                del self._kept[number]


def is_operating(order: TransportOrder) -> bool:
    """Return whether an order's vehicle does what is to be done at its destination."""
    return order.current.state is DriveOrderState.OPERATING


def _hindered(vehicle: FleetVehicle, obstacle: str) -> LocatedCandidate:
    return LocatedCandidate(vehicle, DispatchedVehicle(vehicle.name, obstacle))
