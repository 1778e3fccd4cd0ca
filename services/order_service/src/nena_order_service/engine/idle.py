"""Send idle vehicles to recharge and to park."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from nena_order_service.dispatching.candidates import DispatchedVehicle
from nena_order_service.engine.context import Context
from nena_order_service.engine.dispatching import Dispatching
from nena_order_service.engine.life_cycle import LifeCycle
from nena_order_service.orders.automatic import PARK_TYPE, goal_of, park_request, recharge_request
from nena_order_service.vehicles.parking import ParkingPositions, Prospect, RechargeLocations
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import TransportOrderRequest

R = ReasonCode

PAUSE = 10.0
"""Seconds before the same order is created for a vehicle again."""

DISPLACES_AT_MOST = 2
"""Maximum number of times that others make room for a parking vehicle between two orders of hosts. The others
may have to park again and displace it in turn: without a limit, two vehicles could do this forever, and a
recharging one would never finish."""


@dataclass(slots=True)
class _Idle:
    """The idle handling of one vehicle."""

    since: float | None = None
    """Time since which the vehicle is idle; None: it is not idle."""
    not_before: dict[str, float] = field(default_factory=dict)
    """Time from which it may be sent again, by order type."""
    displaced: int = 0
    """How often others had to make room for it to park since its last order from a host."""
    note: Reason | None = None
    """Why it cannot recharge although it should; None otherwise."""
    parking_note: Reason | None = None
    """Why it cannot park although it should; None otherwise."""


@dataclass(frozen=True, slots=True)
class _IdleRound:
    """Data of one check of the vehicles."""

    now: float
    goals: dict[str, str] = field(default_factory=dict)
    """Final positions of vehicles with orders, by vehicle name."""


class IdleVehicles:
    """Creates recharge and park orders for idle vehicles.

    Call it after dispatching: a vehicle that is still idle then is one that no waiting order suits.
    """

    def __init__(self, context: Context, dispatching: Dispatching, life_cycle: LifeCycle) -> None:
        self._settings = context.settings.dispatch
        self._locations = RechargeLocations(context.plant, context.planner.recharging)
        parking = self._settings.parking
        self._positions = ParkingPositions(
            context.plant, priorities=parking.priorities, repark=parking.repark
        )
        self._context = context
        self._state = context.state
        self._registry = context.registry
        self._dispatching = dispatching
        self._traffic = context.traffic
        self._life_cycle = life_cycle
        self._idle: dict[str, _Idle] = {}

    def send_idle(self, vehicles: Iterable[FleetVehicle]) -> None:
        """Send idle vehicles with low energy to recharge, and the others to park."""
        if not (self._settings.recharging.enabled or self._settings.parking.enabled):
            return
        if self._state.dispatch_due:
            return  # orders may wait for these vehicles
        round_ = _IdleRound(self._context.clock.monotonic(), self._current_goals())
        for vehicle in vehicles:
            candidate = self._dispatching.to_candidate(vehicle)
            record = self._idle.setdefault(vehicle.name, _Idle())
            if candidate.obstacle or candidate.gives_up or candidate.kept_for is not None:
                record.since = record.note = record.parking_note = None
                order = self._state.order_of(vehicle.key)
                if order and not order.status.automatic:
                    record.displaced = 0
                continue
            if record.since is None:
                record.since = round_.now
            self._send_vehicle(vehicle, candidate, record, round_)

    def why_not_sent(self, vehicle: FleetVehicle) -> Reason | None:
        """Return why an idle vehicle cannot recharge or park although it should; None otherwise."""
        record = self._idle.get(vehicle.name)
        if record and record.note and record.parking_note:
            return Reason(R.ALL, record.note, record.parking_note)
        return record.note or record.parking_note if record else None

    def _send_vehicle(
        self, vehicle: FleetVehicle, candidate: DispatchedVehicle, record: _Idle, round_: _IdleRound
    ) -> None:
        record.note = None
        energy = self._dispatching.energy_of(vehicle, self._context.view(vehicle))
        if energy and energy.charging:
            return
        request = None
        # Between two orders of a sequence, a vehicle stays for the next one as long as its energy allows.
        is_bound = self._dispatching.fit.sequences.bound_to(vehicle.name) is not None
        needs_energy = energy and (energy.critical if is_bound else energy.degraded)
        if self._settings.recharging.enabled and energy and needs_energy:
            request = self._recharge_request(vehicle, candidate, record, round_, urgent=energy.critical)
        parking = self._settings.parking
        idle_s = 0.0 if record.since is None else round_.now - record.since
        may_park = parking.enabled and not candidate.restriction and idle_s >= parking.delay
        if request is not None or is_bound or not may_park:
            record.parking_note = None
        elif round_.now >= record.not_before.get(PARK_TYPE, 0.0):
            request = self._park_request(vehicle, candidate, record, round_)
        if request and round_.now >= record.not_before.get(request.type, 0.0):
            record.not_before[request.type] = round_.now + PAUSE
            displaces = request.type == PARK_TYPE and self._displaces_others(vehicle, goal_of(request))
            if self._life_cycle.create_automatic_order(request):
                record.since = None
                record.displaced += displaces
                round_.goals.update(self._current_goals())

    def _recharge_request(
        self,
        vehicle: FleetVehicle,
        candidate: DispatchedVehicle,
        record: _Idle,
        round_: _IdleRound,
        *,
        urgent: bool,
    ) -> TransportOrderRequest | None:
        choice = self._locations.choose(
            vehicle.model,
            cost=self._cost_function(vehicle, candidate),
            taken=lambda point: bool(self._users_of(point, vehicle, round_)),
            idly_occupied=lambda point: urgent and self._is_idly_occupied(point, vehicle, round_),
        )
        if choice.reason:
            record.note = Reason(R.CANNOT_RECHARGE, choice.reason)
            return None
        # openTCS: dispensable unless the energy is critical.
        return recharge_request(vehicle.name, choice.location, choice.operation, dispensable=not urgent)

    def _park_request(
        self, vehicle: FleetVehicle, candidate: DispatchedVehicle, record: _Idle, round_: _IdleRound
    ) -> TransportOrderRequest | None:
        standing = self._context.planner.standing(vehicle, self._context.view(vehicle))
        choice = self._positions.choose(
            vehicle.model,
            standing.point if standing.on_point else None,
            Prospect(
                cost=self._cost_function(vehicle, candidate),
                taken=lambda point: bool(self._users_of(point, vehicle, round_)),
                displaces=lambda point: self._displaces_others(vehicle, point),
                may_displace=record.displaced < DISPLACES_AT_MOST,
            ),
        )
        record.parking_note = Reason(R.CANNOT_PARK, choice.reason) if choice.reason else None
        if choice.reason:  # finding none may need many route searches
            record.not_before[PARK_TYPE] = round_.now + PAUSE
        return park_request(vehicle.name, choice.point) if choice.point else None

    def _cost_function(self, vehicle: FleetVehicle, candidate: DispatchedVehicle) -> Callable[[str], float]:
        """Return a function that computes the cost for a vehicle to reach a point."""
        router, model = self._context.finder.router, vehicle.model
        return lambda point: router.costs_to(point, vehicle=model).cost_from(candidate.start)

    def _displaces_others(self, vehicle: FleetVehicle, point: str) -> bool:
        return vehicle.name in self._traffic and self._traffic.would_displace(vehicle.name, point)

    def _current_goals(self) -> dict[str, str]:
        goals = {}
        for vehicle in self._registry:
            order = self._state.order_of(vehicle.key)
            if order and (route := order.status.drive_orders[-1].route):
                goals[vehicle.name] = route[-1]
        return goals

    def _users_of(self, point: str, vehicle: FleetVehicle, round_: _IdleRound) -> set[str]:
        """Return the other vehicles that are at a point, will pass it or are going to it."""
        coming = {name for name, goal in round_.goals.items() if goal == point}
        return {*self._traffic.scheduler.users_of(point), *coming} - {vehicle.name}

    def _is_idly_occupied(self, point: str, vehicle: FleetVehicle, round_: _IdleRound) -> bool:
        """Return whether all vehicles at a point have enough energy and nothing to do."""
        users = (self._registry.named(name) for name in self._users_of(point, vehicle, round_))
        candidates = (self._dispatching.to_candidate(user) for user in users if user)
        return not any(user.obstacle or user.restriction or user.gives_up for user in candidates)
