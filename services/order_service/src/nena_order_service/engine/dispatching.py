"""Dispatching: run the dispatcher over the current vehicles, and report why orders wait."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import inf

from nena_order_service.dispatching.candidates import (
    Candidates,
    Carried,
    DispatchedVehicle,
    Energy,
    FreeKind,
    LocatedCandidate,
    OrderKind,
    carried,
)
from nena_order_service.dispatching.dispatcher import (
    BUSY,
    NONE_LEFT_OUT,
    Assignment,
    Decisions,
    Dispatcher,
    VehicleFit,
    best_first,
    explain,
    why_no_vehicle,
)
from nena_order_service.engine.context import Context
from nena_order_service.engine.driving import Driving
from nena_order_service.engine.order_knowledge import KnownCosts, OrderFit, OrderKnowledge, stops_of
from nena_order_service.fleet.position import NotLocatedError, Standing
from nena_order_service.fleet.robot import LinkStatus, RobotView
from nena_order_service.fleet.vda_order import DROP
from nena_order_service.orders.automatic import is_automatic_recharge
from nena_order_service.orders.transport_order import TransportOrder, Urgency
from nena_order_service.routing.router import RoutePlan
from nena_order_service.vehicles.registry import FleetVehicle, why_not_on
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.plant import UnknownObjectError

R = ReasonCode

NO_ORDER = Reason(R.NO_ORDERS)
NO_ORDER_FITS = Reason(R.NO_ORDER_FITS)
GIVES_UP = Reason(R.ENDS_DISPENSABLE_ORDER)

EXPLAINED_FIRST = 20
"""Number of orders at the head of the queue whose wait reason is updated at once; the others follow."""
LOOKED_AT_ONCE = 500
"""Number of other orders whose wait reason is checked in each round."""
EXPLAINED_AT_ONCE = 50
"""Number of vehicles explained before other tasks run."""
REASONS_AT_ONCE = 100
"""Maximum number of wait reasons updated in each round."""
VEHICLES_AT_ONCE = 100
"""Number of changed vehicles read again in one turn of the event loop; each takes about 0.1 ms."""
ORDERS_FOR_ONE = 32
"""Number of orders compared when vehicles have become free, plus ORDERS_FOR_EACH per vehicle."""
ORDERS_FOR_EACH = 4
"""Number of additional orders compared for each of these vehicles."""
FEW = 8
"""Maximum number of free vehicles to which this applies."""
ORDERS_FOR_MANY = 16
"""Number of orders compared at once for more vehicles; assigning an order takes milliseconds."""
ALL_COMPARED = 50
"""Number of free vehicles up to which all are compared with orders; of more, only the nearest ones."""

STANDS_STILL = (VehicleState.UNKNOWN, VehicleState.UNAVAILABLE, VehicleState.ERROR)
"""Vehicle states in which a robot can at most continue its current order."""


@dataclass(frozen=True, slots=True)
class Dispatched:
    """An assignment, with its vehicle and route."""

    assignment: Assignment
    vehicle: FleetVehicle
    way: RoutePlan


class Dispatching:
    """Runs the dispatcher, and reports why vehicles have no orders."""

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
        self._candidates = Candidates(context.registry, self.consider)
        self._kept: dict[int, str] = {}
        """Vehicles that give up dispensable orders, by the number of the order for which each is reserved."""
        self._explained_to = 0
        """Position in the queue up to which wait reasons have been updated."""
        self._read_again: dict[str, None] = {}
        """Changed vehicles that have been read again since orders were last due."""

    @property
    def reads_fleet(self) -> bool:
        """Whether so many vehicles have changed that they are read in parts, before any order is assigned."""
        return bool(self._read_again) or len(self._state.touched) > VEHICLES_AT_ONCE

    def due(self) -> Iterator[Sequence[TransportOrder]]:
        """Yield orders that may be assigned now, or whose wait reason may have changed.

        These are the orders that are new to free vehicles, the most urgent ones for vehicles that have become
        free, the first ones of the queue, and those that name a vehicle that has changed. The work therefore
        does not grow with the queue. Sets ``dispatch_later`` if there are vehicles that have not been offered
        all orders. If a whole fleet has changed, no order is due before all vehicles have been read again,
        which takes several turns of the event loop.
        """
        self._read_again.update(dict.fromkeys(self._refresh(VEHICLES_AT_ONCE)))
        if self._state.touched:
            self._state.dispatch_later = True
            return
        touched, self._read_again = self._read_again, {}
        self._forget_kept()
        if not self._orders.any_waiting:
            self._candidates.fresh.clear()  # there is nothing to offer
            self._state.dispatch_later = False
            return
        numbers = self._with_new_reasons(touched)
        numbers.update(self._fresh_orders())
        limit = self._part_limit()
        after, vehicles = self._candidates.take_hindmost()
        offered = self._offered(vehicles, after, limit)
        numbers.update(dict.fromkeys(offered))
        if orders := self._waiting_of(numbers):
            yield orders
        self._refresh()
        if len(offered) == limit:
            self._candidates.offer_on(vehicles, self._orders.get(offered[-1]).urgency)
        self._state.dispatch_later = bool(self._candidates.fresh)

    def dispatch(self, orders: Sequence[TransportOrder]) -> tuple[list[Dispatched], dict[str, str]]:
        """Return the assignments to make, and the wait reasons of the other orders by name.

        A vehicle that first has to give up a dispensable order is reserved for its new one.
        """
        self._refresh()
        self._forget_kept()
        for order in orders:
            self._orders.waiting.fresh.pop(order.number, None)
        if not orders:
            return [], {}
        decisions, candidates = self._decide(orders)
        for order in orders:
            kept = candidates.get(self._kept.get(order.number, ""))
            if kept and not kept.seen.obstacle and order.name in decisions.reasons:
                self._keep(order.number, None)  # the vehicle is free, but the order cannot be assigned to it
        dispatched = []
        for assignment in decisions.assignments:
            candidate = candidates[assignment.vehicle]
            assert candidate.standing, "an assigned vehicle has a position"  # noqa: S101 - for the type
            if assignment.gives_up:
                self._keep(assignment.order.number, assignment.vehicle)
            way = self._planner.way(assignment.order, candidate.vehicle, candidate.standing)
            dispatched.append(Dispatched(assignment, candidate.vehicle, way))
        return dispatched, decisions.reasons

    def look_at(self, vehicles: Iterable[FleetVehicle]) -> None:
        """Update the dispatcher's view of these vehicles, except of those that just drive for their order."""
        self._candidates.refresh(each.name for each in vehicles if not self.just_drives(each))

    def just_drives(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle is busy as before, and only a change of its order can end that."""
        known, order = self._candidates.get(vehicle.name), self._state.order_of(vehicle.key)
        if known is None or order is None or vehicle.name in self._state.touched:
            return False
        if order.state is not TransportOrderState.BEING_PROCESSED or order.is_operating:
            return False
        return known.view is None and known.seen.obstacle == BUSY

    def offer_all(self) -> None:
        """Offer all orders to the free vehicles again."""
        self._candidates.offer_all()

    def outdated_reasons(self) -> Iterator[tuple[TransportOrder, str]]:
        """Yield some of the orders further back in the queue whose wait reason has changed, with the reason.

        Orders that a free vehicle could execute are left to :meth:`dispatch`.
        """
        numbers = self._orders.waiting.part(self._explained_to, LOOKED_AT_ONCE)
        self._explained_to = self._explained_to + len(numbers) if numbers else 0
        found = 0
        reasons: dict[OrderKind, str | None] = {}
        for order in self._waiting_of(numbers):
            kind = self._orders.waiting.kind(order.number)
            if kind is None or order.number in self._kept:
                continue
            if kind not in reasons:
                reasons[kind] = self._why_no_vehicle(order)
            reason = reasons[kind]
            if reason and reason != order.status.reason and found < REASONS_AT_ONCE:
                found += 1
                yield order, reason

    async def explain(self, order: TransportOrder) -> list[VehicleFit]:
        """Return for each vehicle whether it could execute this order, or why not; best ones first."""
        vehicles = [each for each in self._registry if not each.obstacle]
        found: list[VehicleFit] = []
        for start in range(0, len(vehicles), EXPLAINED_AT_ONCE):
            part = vehicles[start : start + EXPLAINED_AT_ONCE]
            candidates = {each.name: self.consider(each) for each in part}
            seen = (each.seen for each in candidates.values())
            found += explain(order, seen, self._knowledge(candidates), kept=self._kept)
            await asyncio.sleep(0)
        return best_first(found)

    def forget(self) -> None:
        """Drop all cached routes, because the plant has changed."""
        self._costs.forget()
        self._candidates.fresh.clear()
        self._candidates.offer_all()

    def has_changed(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle has changed, as far as dispatching is concerned, since the last check.

        A new order does not count: the waiting orders were checked when it was assigned.
        """
        if vehicle.obstacle or vehicle.name not in self._state.touched:
            return False
        self._state.touched.discard(vehicle.name)
        is_new = self._candidates.look_at(vehicle)
        now = self._candidates.get(vehicle.name)
        return is_new and now is not None and now.seen.obstacle != BUSY

    def idle_reason(self, vehicle: FleetVehicle, *, orders_wait: bool) -> str:
        """Return why a vehicle without an order has none."""
        known = self._candidates.get(vehicle.name)
        if known and vehicle.name not in self._state.touched:
            view = None if known.view is None else self._view(vehicle)
            seen = known.seen if known.view is view else self.consider(vehicle).seen
        else:
            seen = self.consider(vehicle).seen
        return seen.obstacle or seen.restriction or (NO_ORDER_FITS if orders_wait else NO_ORDER)

    def is_bound(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle is bound to an order sequence."""
        return self.fit.sequences.bound_to(vehicle.name) is not None

    def consider(self, vehicle: FleetVehicle) -> LocatedCandidate:
        """Return a vehicle as the dispatcher sees it now."""
        if vehicle.obstacle:
            return self._unavailable(vehicle, vehicle.obstacle)
        order = self._state.order_of(vehicle.key)
        if order is not None and not self._would_give_up(order):
            giving_up = self._is_giving_up(vehicle, order)
            soon = None if giving_up else self._free_soon(vehicle, order)
            return soon or self._unavailable(vehicle, GIVES_UP if giving_up else BUSY)
        view = self._view(vehicle)
        if obstacle := self._obstacle(vehicle, view, order):
            return self._unavailable(vehicle, obstacle, view)
        try:
            standing = self._planner.standing(vehicle, view)
        except NotLocatedError as error:
            return self._unavailable(vehicle, Reason(R.NOT_DISPATCHABLE, error.reason), view)
        if obstacle := self._lacks_map(vehicle, view, standing):
            return self._unavailable(vehicle, obstacle, view)
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
        return LocatedCandidate(
            vehicle,
            seen,
            standing,
            self.fit.sequences.bound_to(vehicle.name),
            seen.order_types,
            view,
            self._costs.finder.router.kind(vehicle.model),
        )

    def _free_soon(self, vehicle: FleetVehicle, order: TransportOrder) -> LocatedCandidate | None:
        """Return a vehicle that is unloading at the end of its order as it will be afterwards.

        None if it is not unloading, cannot continue, or has no known position.
        """
        last = order.index == len(order.status.drive_orders) - 1
        if not (last and order.is_operating):
            return None
        if self._planner.action_type(order.current.destination.operation) != DROP:
            return None
        view = self._view(vehicle)
        processed = order.state is TransportOrderState.BEING_PROCESSED and not order.held
        if not processed or view.link is not LinkStatus.ONLINE or view.vehicle_state in STANDS_STILL:
            return None
        if self._driving.stopped(vehicle):
            return None
        try:
            standing = self._planner.standing(vehicle, view)
        except NotLocatedError:
            return None
        energy, types = self.energy(vehicle, view), self.fit.order_types(vehicle)
        restriction = energy.restriction(fully=self._energy.until_fully_recharged) if energy else ""
        seen = DispatchedVehicle(
            vehicle.name,
            BUSY,
            restriction=restriction,
            energy=energy.level if energy else 100.0,
            order_types=types,
            soon=True,
        )
        return LocatedCandidate(vehicle, seen, standing, self.fit.sequences.bound_to(vehicle.name), types)

    def _unavailable(
        self, vehicle: FleetVehicle, obstacle: str, view: RobotView | None = None
    ) -> LocatedCandidate:
        seen = DispatchedVehicle(vehicle.name, obstacle)
        bound = self.fit.sequences.bound_to(vehicle.name)
        return LocatedCandidate(vehicle, seen, None, bound, self.fit.order_types(vehicle), view)

    def energy(self, vehicle: FleetVehicle, view: RobotView) -> Energy | None:
        """Return the energy of a vehicle; None if it is unknown or the settings ignore it."""
        if view.state is None or not self._energy.respected:
            return None
        thresholds = vehicle.model.energy_thresholds if vehicle.model else self._energy.thresholds
        power = view.state.power_supply
        return Energy(power.state_of_charge, power.charging, thresholds)

    def _obstacle(self, vehicle: FleetVehicle, view: RobotView, order: TransportOrder | None) -> str:
        """Return why a vehicle, with no order or with one that it would give up, cannot take an order."""
        if stopped := self._driving.stopped(vehicle):
            return stopped
        if order is None:
            obstacle = self._driving.obstacle(vehicle)
            reason = "" if view.availability.can_take_order else view.availability.reason
            return reason if view.link is LinkStatus.UNREADABLE else obstacle or reason
        if view.link is not LinkStatus.ONLINE or view.vehicle_state in STANDS_STILL:
            return BUSY
        return self._driving.positions.obstacle(vehicle)

    def _lacks_map(self, vehicle: FleetVehicle, view: RobotView, standing: Standing) -> str:
        """Return why a robot cannot drive on the map of its start point; it rejects other maps itself."""
        if view.state is None or not self._maps_respected:
            return ""
        return why_not_on(self._planner.map_id(standing.point, vehicle), view.state)

    def _carried(self, vehicle: FleetVehicle, view: RobotView) -> Carried | None:
        """Return the carried loads, unless a host plans all orders of the vehicle as a sequence."""
        if view.state is None or not self._loads_respected or self.is_bound(vehicle):
            return None
        return carried(view.state, view.factsheet)

    def _is_giving_up(self, vehicle: FleetVehicle, order: TransportOrder) -> bool:
        """Return whether a vehicle is about to be free for the order for which it is reserved."""
        if order.state is not TransportOrderState.WITHDRAWN or vehicle.name not in self._kept.values():
            return False
        return self._view(vehicle).link is LinkStatus.ONLINE

    def _would_give_up(self, order: TransportOrder) -> bool:
        """Return whether an order is given up for another one; an automatic recharge only while charging."""
        if order.state is not TransportOrderState.BEING_PROCESSED or order.held:
            return False
        return order.status.dispensable or (is_automatic_recharge(order) and order.is_operating)

    def _refresh(self, at_most: int | None = None) -> list[str]:
        """Update the vehicles that have changed, or some of them; return their names."""
        touched = [*islice(self._state.touched, at_most)]
        self._state.touched.difference_update(touched)
        self._candidates.refresh(touched)
        return touched

    def _decide(self, orders: Sequence[TransportOrder]) -> tuple[Decisions, Mapping[str, LocatedCandidate]]:
        """Run the dispatcher; repeat while a vehicle has changed since it was last read."""
        while True:
            candidates, left_out = self._nearest(orders) or (self._relevant(orders), NONE_LEFT_OUT)
            decisions = self._dispatcher.decide(
                orders,
                (each.seen for each in candidates.values()),
                self._knowledge(candidates),
                now=self._clock.now(),
                kept=self._kept,
                left_out=left_out,
            )
            chosen = [candidates[each.vehicle] for each in decisions.assignments]
            doubtful = [each.vehicle for each in chosen if not self._is_as_read(each)]
            if sum(map(self._candidates.look_at, doubtful)) == 0:
                return decisions, candidates

    def _is_as_read(self, known: LocatedCandidate) -> bool:
        """Return whether a vehicle that may get orders certainly has not changed since it was last read."""
        vehicle = known.vehicle
        if vehicle.name in self._state.touched or self._view(vehicle) is not known.view:
            return False
        return not self._obstacle(vehicle, known.view, self._state.order_of(vehicle.key))

    def _relevant(self, orders: Sequence[TransportOrder]) -> Mapping[str, LocatedCandidate]:
        """Return the relevant vehicles for orders; only the intended ones if each order has one."""
        named = self._named(orders)
        if all(each.status.intended_vehicle for each in orders):
            return {name: found for name in sorted(named) if (found := self._candidates.get(name))}
        return self._candidates.relevant(named)

    def _named(self, orders: Iterable[TransportOrder]) -> set[str]:
        """Return the vehicles that any of the orders names, excludes or has reserved."""
        named: set[str] = set()
        for order in orders:
            status = order.status
            named.update(status.excluded_vehicles)
            named.update(filter(None, (status.intended_vehicle, self.fit.sequences.meant(order))))
            named.update(filter(None, (self._kept.get(order.number),)))
        return named

    def _nearest(
        self, orders: Sequence[TransportOrder]
    ) -> tuple[Mapping[str, LocatedCandidate], Mapping[int, int]] | None:
        """Return the relevant vehicles for orders, and how many free ones are left out for each order.

        Of many free vehicles only those are needed that are nearest to an order, as many as there are orders,
        and one of each kind for its wait reason. None: all of them are needed.
        """
        known = self._candidates
        many = len(known.free) > ALL_COMPARED and self._dispatcher.by_cost
        if not many or all(each.status.intended_vehicle for each in orders):
            return None
        named = self._named(orders)
        unnamed = {
            kind: example
            for kind, members in known.alike.items()
            if (example := next((each for each in members if each not in named), None))
        }
        knowledge = self._knowledge({each: known.free[each] for each in unnamed.values()})
        fitting: dict[int, list[FreeKind]] = {}
        nearest = {*unnamed.values()}
        for order in orders:
            if order.status.intended_vehicle or order.number in self._kept:
                continue
            recharges, pick = knowledge.recharges(order), knowledge.pick(order)
            kinds = fitting[order.number] = [
                kind
                for kind, example in unnamed.items()
                if not knowledge.why_unsuitable(order, example)
                and not known.free[example].seen.why_not(order, recharges=recharges, pick=pick)
            ]
            near = self._near(order, kinds, len(orders) + len(named))
            if near is None:
                return None
            nearest.update(near)
        wanted = nearest | named
        left_out = {
            number: sum(len(known.alike[kind]) - len(known.alike[kind].keys() & wanted) for kind in kinds)
            for number, kinds in fitting.items()
        }
        return known.relevant(named, nearest), left_out

    def _near(self, order: TransportOrder, kinds: Iterable[FreeKind], number: int) -> Iterable[str] | None:
        """Return the free vehicles of these kinds that are nearest to an order, at least ``number``.

        None: their costs are not cached, or none of them has a route.
        """
        if any(each.coordinate for each in stops_of(order)):
            return None
        names, costs = list[str](), list[float]()
        for kind in kinds:
            members = self._candidates.alike[kind]
            example = self._candidates.free[next(iter(members))].vehicle
            try:
                found = self._costs.known(order, kind.routing_kind)
                found = found or self._costs.of(order, example, kind.routing_kind)
            except UnknownObjectError:  # a resource to avoid that the plant lacks
                return None
            names += members
            costs += found.complete([*members.values()])
        if not names:
            return ()
        limit = sorted(costs)[:number][-1]
        near = [name for name, cost in zip(names, costs, strict=True) if cost <= limit and cost < inf]
        return near or None

    def _with_new_reasons(self, touched: Iterable[str]) -> dict[int, None]:
        """Return the orders whose wait reasons may have changed."""
        waiting = self._orders.waiting
        found = dict.fromkeys((*waiting.part(0, EXPLAINED_FIRST), *self._kept))
        for name in touched:
            found.update(dict.fromkeys(waiting.first(waiting.naming(name), EXPLAINED_FIRST)))
        return found

    def _fresh_orders(self) -> dict[int, None]:
        """Remove and return the orders that may be new to free vehicles."""
        waiting = self._orders.waiting
        found = dict.fromkeys([*waiting.fresh][: None if self._candidates.free else EXPLAINED_FIRST])
        waiting.fresh.clear()
        return found

    def _part_limit(self) -> int:
        """Return how many orders are offered at once to the free vehicles."""
        if not self._dispatcher.by_urgency:
            return len(self._orders.waiting) + 1
        fresh = len(self._candidates.fresh)
        return ORDERS_FOR_ONE + ORDERS_FOR_EACH * fresh if fresh <= FEW else ORDERS_FOR_MANY

    def _offered(self, vehicles: Sequence[str], after: Urgency | None, limit: int) -> list[int]:
        """Return the numbers of the next orders after ``after`` that these free vehicles may take."""
        if not vehicles:
            return []
        waiting = self._orders.waiting
        seen = {name: self._candidates.free[name] for name in vehicles}
        knowledge = self._knowledge(seen)

        def fits(kind: OrderKind) -> bool:
            order = self._orders.get(waiting.example(kind))
            recharges, pick = knowledge.recharges(order), knowledge.pick(order)
            return any(
                kind.intended_vehicle in (None, name)
                and not knowledge.why_unsuitable(order, name)
                and not each.seen.why_not(order, recharges=recharges, pick=pick)
                for name, each in seen.items()
            )

        return waiting.first(filter(fits, waiting.kinds(vehicles)), limit, after)

    def _waiting_of(self, numbers: Iterable[int]) -> list[TransportOrder]:
        """Return the orders that may be assigned, most urgent first."""
        orders = map(self._orders.find, numbers)
        waiting = TransportOrderState.DISPATCHABLE
        found = [each for each in orders if each and each.state is waiting and not each.held]
        return sorted(found, key=lambda order: order.urgency)

    def _why_no_vehicle(self, order: TransportOrder) -> str | None:
        """Return why no vehicle can take an order now; None if a free one may execute it."""
        candidates = self._relevant((order,))
        knowledge = self._knowledge({})
        recharges, pick = knowledge.recharges(order), knowledge.pick(order)
        wait_reasons = {
            name: knowledge.why_unsuitable(order, name)
            or each.seen.why_not(order, recharges=recharges, pick=pick)
            for name, each in candidates.items()
        }
        intended = order.status.intended_vehicle
        return why_no_vehicle(intended, wait_reasons) if all(wait_reasons.values()) else None

    def _knowledge(self, candidates: Mapping[str, LocatedCandidate]) -> OrderKnowledge:
        places = {
            name: (each.vehicle, each.standing.point)
            for name, each in candidates.items()
            if each.standing is not None
        }
        return OrderKnowledge(self._costs, places, self._planner, self.fit, self._assigned)

    def _assigned(self) -> Iterator[TransportOrder]:
        return map(self._orders.get, self._state.sent_orders.assigned)

    def _keep(self, number: int, name: str | None) -> None:
        """Reserve a vehicle for an order, or release it."""
        before = self._kept.pop(number, None)
        if name is not None:
            self._kept[number] = name
        self._candidates.refresh(filter(None, (before, name)))

    def _forget_kept(self) -> None:
        """Drop reservations unless the order still waits and the vehicle is about to be free."""
        for number, name in tuple(self._kept.items()):
            vehicle = self._registry.named(name)
            order = self._orders.find(number)
            waits = order is not None and order.state is TransportOrderState.DISPATCHABLE and not order.held
            intended = order.status.intended_vehicle if order else None
            obstacle = self.consider(vehicle).seen.obstacle if vehicle else BUSY
            if not waits or intended not in (None, name) or obstacle not in ("", GIVES_UP):
                self._keep(number, None)
