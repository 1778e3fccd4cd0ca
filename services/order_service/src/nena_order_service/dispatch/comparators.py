"""By what orders, vehicles and pairs of them are compared: the keys of the settings, in openTCS's words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from math import inf
from types import MappingProxyType
from typing import Final

from nena_order_service.dispatch.vehicle import DispatchedVehicle
from nena_order_service.dispatch.way_costs import WayCost
from nena_order_service.orders.transport_order import TransportOrder

Rank = tuple[float | str, ...]
"""What comes first is less."""


class OrderKey(StrEnum):
    """By what orders that wait are compared."""

    BY_PRIORITY = "BY_PRIORITY"
    """The greater priority first."""
    BY_DEADLINE = "BY_DEADLINE"
    """The earlier deadline first, those without one last."""
    DEADLINE_AT_RISK_FIRST = "DEADLINE_AT_RISK_FIRST"
    """First those whose deadline is near or past."""
    BY_AGE = "BY_AGE"
    """The older one first."""
    BY_NAME = "BY_NAME"


class VehicleKey(StrEnum):
    """By what vehicles that are free are compared."""

    BY_ENERGY_LEVEL = "BY_ENERGY_LEVEL"
    """The one with more energy first."""
    IDLE_FIRST = "IDLE_FIRST"
    """First those that neither charge nor have a dispensable order."""
    BY_NAME = "BY_NAME"


class CandidateKey(StrEnum):
    """By what pairs of one order and one vehicle are compared."""

    BY_COMPLETE_ROUTING_COSTS = "BY_COMPLETE_ROUTING_COSTS"
    """The cheaper way through all destinations first."""
    BY_INITIAL_ROUTING_COSTS = "BY_INITIAL_ROUTING_COSTS"
    """The cheaper way to the first destination first."""
    BY_ORDER_TYPE_PRIORITY = "BY_ORDER_TYPE_PRIORITY"
    """By the priority that the vehicle has for orders of this type, the smaller number first."""
    BY_PRIORITY = "BY_PRIORITY"
    BY_DEADLINE = "BY_DEADLINE"
    DEADLINE_AT_RISK_FIRST = "DEADLINE_AT_RISK_FIRST"
    BY_AGE = "BY_AGE"
    BY_ORDER_NAME = "BY_ORDER_NAME"
    BY_ENERGY_LEVEL = "BY_ENERGY_LEVEL"
    IDLE_FIRST = "IDLE_FIRST"
    BY_VEHICLE_NAME = "BY_VEHICLE_NAME"


@dataclass(frozen=True, slots=True)
class Candidate:
    """A vehicle that could do an order now, and what that costs."""

    order: TransportOrder
    vehicle: DispatchedVehicle
    cost: WayCost


@dataclass(frozen=True, slots=True)
class Now:
    """When a comparison is made, and how near a deadline is at risk."""

    time: datetime
    at_risk: timedelta

    def risks(self, order: TransportOrder) -> bool:
        """Whether an order's deadline is at risk."""
        deadline = order.status.deadline
        return deadline is not None and deadline <= self.time + self.at_risk


def _deadline(order: TransportOrder) -> float:
    deadline = order.status.deadline
    return deadline.timestamp() if deadline else inf


ORDER_VALUES: Final[Mapping[OrderKey, Callable[[TransportOrder, Now], float | str]]] = MappingProxyType(
    {
        OrderKey.BY_PRIORITY: lambda order, _: -order.status.priority,
        OrderKey.BY_DEADLINE: lambda order, _: _deadline(order),
        OrderKey.DEADLINE_AT_RISK_FIRST: lambda order, now: not now.risks(order),
        OrderKey.BY_AGE: lambda order, _: order.number,
        OrderKey.BY_NAME: lambda order, _: order.name,
    }
)

VEHICLE_VALUES: Final[Mapping[VehicleKey, Callable[[DispatchedVehicle], float | str]]] = MappingProxyType(
    {
        VehicleKey.BY_ENERGY_LEVEL: lambda vehicle: -vehicle.energy,
        VehicleKey.IDLE_FIRST: lambda vehicle: not vehicle.idle,
        VehicleKey.BY_NAME: lambda vehicle: vehicle.name,
    }
)

CANDIDATE_VALUES: Final[Mapping[CandidateKey, Callable[[Candidate, Now], float | str]]] = MappingProxyType(
    {
        CandidateKey.BY_COMPLETE_ROUTING_COSTS: lambda pair, _: pair.cost.complete,
        CandidateKey.BY_INITIAL_ROUTING_COSTS: lambda pair, _: pair.cost.initial,
        CandidateKey.BY_ORDER_TYPE_PRIORITY: lambda pair, _: pair.vehicle.type_priority(pair.order),
        CandidateKey.BY_PRIORITY: lambda pair, _: -pair.order.status.priority,
        CandidateKey.BY_DEADLINE: lambda pair, _: _deadline(pair.order),
        CandidateKey.DEADLINE_AT_RISK_FIRST: lambda pair, now: not now.risks(pair.order),
        CandidateKey.BY_AGE: lambda pair, _: pair.order.number,
        CandidateKey.BY_ORDER_NAME: lambda pair, _: pair.order.name,
        CandidateKey.BY_ENERGY_LEVEL: lambda pair, _: -pair.vehicle.energy,
        CandidateKey.IDLE_FIRST: lambda pair, _: not pair.vehicle.idle,
        CandidateKey.BY_VEHICLE_NAME: lambda pair, _: pair.vehicle.name,
    }
)


def rank_orders(keys: Sequence[OrderKey], now: Now) -> Callable[[TransportOrder], Rank]:
    """Give what orders are sorted by; orders that are alike in all ``keys`` by their age."""
    values = [ORDER_VALUES[key] for key in keys]
    return lambda order: (*(value(order, now) for value in values), order.number)


def rank_vehicles(keys: Sequence[VehicleKey]) -> Callable[[DispatchedVehicle], Rank]:
    """Give what vehicles are sorted by; those that are alike in all ``keys`` by their names."""
    values = [VEHICLE_VALUES[key] for key in keys]
    return lambda vehicle: (*(value(vehicle) for value in values), vehicle.name)


def rank_candidates(keys: Sequence[CandidateKey], now: Now) -> Callable[[Candidate], Rank]:
    """Give what pairs are sorted by; those that are alike in all ``keys`` by vehicle, then by age."""
    values = [CANDIDATE_VALUES[key] for key in keys]
    return lambda pair: (*(value(pair, now) for value in values), pair.vehicle.name, pair.order.number)
