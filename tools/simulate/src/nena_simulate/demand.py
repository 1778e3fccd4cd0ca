"""The orders of a simulation: recorded, drawn at random by rates per relation, or an endless backlog."""

from __future__ import annotations

import csv
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from heapq import merge
from io import StringIO
from itertools import accumulate, zip_longest
from math import inf
from pathlib import Path
from random import Random
from typing import Any

from nena_order_service.routing.router import RouteFinder, Router
from nena_shared.clock import in_utc
from nena_shared.fleet_api.transport_order import Destination, TransportOrderRequest
from nena_shared.plant import NO_OPERATION, PlantModel, Vehicle
from nena_simulate.operations import Operations, Purpose

HOUR = 3600.0


class DemandError(ValueError):
    """A file of orders cannot be used, for the reason in the message."""


@dataclass(frozen=True, slots=True)
class Order:
    """An order, and the time at which a host creates it, seconds from the start."""

    at: float
    request: TransportOrderRequest


@dataclass(frozen=True, slots=True)
class Relation:
    """Loads per hour from one location to another."""

    source: str
    destination: str
    per_hour: float


@dataclass(frozen=True, slots=True)
class Demand:
    """The demand of hosts: orders at fixed times, relations with rates, or a backlog of such orders."""

    orders: tuple[Order, ...] = ()
    relations: tuple[Relation, ...] = ()
    backlog: int = 0
    """Number of orders that wait at any time, drawn by the relations' rates, or between any two stations;
    0: orders arrive at those rates."""

    def timed(self, make: Transport, random: Random) -> Iterator[Order]:
        """Yield the orders with a creation time, earliest first; endless if they are drawn at random."""
        drawn = (
            []
            if self.backlog
            else [_draw_orders(relation, make, random.random()) for relation in self.relations]
        )
        return merge(self.orders, *drawn, key=lambda order: order.at)

    def waiting(
        self, make: Transport, relations: Sequence[Relation], random: Random
    ) -> Iterator[TransportOrderRequest]:
        """Yield orders that refill the backlog, drawn by the rates of these relations."""
        rates = [*accumulate(each.per_hour for each in relations)]
        while True:
            relation = random.choices(relations, cum_weights=rates)[0]
            yield make(relation.source, relation.destination)


def _draw_orders(relation: Relation, make: Transport, seed: float) -> Iterator[Order]:
    """Yield orders at independent random intervals (a Poisson process)."""
    random, at = Random(seed), 0.0  # noqa: S311 - no key
    while relation.per_hour > 0:
        at += random.expovariate(relation.per_hour / HOUR)
        yield Order(at, make(relation.source, relation.destination))


class Transport:
    """Creates requests to pick a load at one location and drop it at another."""

    def __init__(self, plant: PlantModel, operations: Operations) -> None:
        self._plant = plant
        self._operations = operations

    def __call__(self, source: str, destination: str) -> TransportOrderRequest:
        """Return the request.

        Unless one can pick and the other can drop, both get another operation of theirs, or none: a robot
        that only picked could not pick again.
        """
        pick, drop = self.operation_at(source, Purpose.PICK), self.operation_at(destination, Purpose.DROP)
        if not pick or not drop:
            pick, drop = (self.operation_at(place, Purpose.OTHER) for place in (source, destination))
        return TransportOrderRequest(destinations=(self.stop(source, pick), self.stop(destination, drop)))

    def operation_at(self, location: str, purpose: Purpose) -> str | None:
        """Return the location's first operation for this purpose."""
        if location not in self._plant.locations_by_name:
            return None
        found = self._plant.location(location)
        allowed = (name for link in found.links for name in self._plant.link_operations(found, link))
        return next((name for name in allowed if self._operations.purpose_of(name) is purpose), None)

    def stop(self, place: str, operation: str | None) -> Destination:
        """Return a destination; without an operation, the robot only drives there."""
        nothing = NO_OPERATION if place in self._plant.locations_by_name else "MOVE"
        return Destination(location_name=place, operation=operation or nothing)


class Ways:
    """Tells between which places the vehicles of a plant can drive."""

    def __init__(self, plant: PlantModel, operations: Operations) -> None:
        self.router = Router(plant)
        self._finder = RouteFinder(plant, self.router, action_type=operations.action_type)

    def is_way(self, starts: Collection[str], goals: Iterable[str], vehicle: Vehicle) -> bool:
        """Return whether a vehicle can drive from one of the points to one of the others."""
        costs = (self.router.costs_to(goal, vehicle=vehicle) for goal in goals)
        return any(each.cost_from(start) < inf for each in costs for start in starts)

    def pairs(
        self,
        sources: Sequence[Destination],
        goals: Sequence[Destination],
        vehicle: Vehicle,
        start: str | None,
    ) -> Iterator[tuple[str | None, str | None]]:
        """Yield the places that a vehicle can serve one after the other, and drive back to the first one."""
        ends = [
            [(each.location_name, self._finder.access_points(each, vehicle)) for each in stops]
            for stops in (sources, goals)
        ]
        for one, at_one in ends[0]:
            if start is None or self.is_way((start,), at_one, vehicle):
                for other, at_other in ends[1]:
                    there = one != other and self.is_way(at_one, at_other, vehicle)
                    if there and self.is_way(at_other, at_one, vehicle):
                        yield one, other


POINTS = 30
"""Maximum number of points between which orders are drawn, if there are no stations to draw them between."""


def describe_drawn(request: TransportOrderRequest, operations: Operations, plant: PlantModel) -> str:
    """Return what drawn orders do instead of picking and dropping; empty if they do that."""
    done = [each.operation for each in request.destinations]
    purposes = [operations.purpose_of(name) for name in done]
    if purposes == [Purpose.PICK, Purpose.DROP]:
        return ""
    instead = "execute other operations" if Purpose.OTHER in purposes else "only drive"
    why = "No robot can drive from a station with an operation to pick to one with an operation to drop, "
    why = why + "and back" if plant.locations else "The plant has no stations"
    return f"{why}: the orders {instead} ({', '.join(dict.fromkeys(done))})."


def every_relation(
    plant: PlantModel, operations: Operations, starts: Sequence[str | None] = ()
) -> tuple[Relation, ...]:
    """Return relations of equal rate between all locations that a vehicle can serve one after the other.

    From where something is picked to where it is dropped; if there is no such pair, between locations with
    other operations; if there is none, between any two; at last, or in a plant without locations, between
    some points. ``starts`` are the vehicles' start points.
    """
    make, ways = Transport(plant, operations), Ways(plant, operations)
    fleet = {
        (ways.router.kind_of(vehicle), start): (vehicle, start)
        for vehicle, start in zip_longest(plant.vehicles or (Vehicle(name="any"),), starts)
        if vehicle is not None
    }
    names = [each.name for each in plant.locations if each.links and not each.locked]
    spread = plant.points[:: len(plant.points) // POINTS + 1] if names or not plant.locations else ()
    points = [each.name for each in spread]
    picks, drops, others = (
        [make.stop(name, found) for name in names if (found := make.operation_at(name, purpose))]
        for purpose in (Purpose.PICK, Purpose.DROP, Purpose.OTHER)
    )
    anywhere, driving = ([make.stop(name, None) for name in places] for places in (names, points))
    for stops in ((picks, drops), (others, others), (anywhere, anywhere), (driving, driving)):
        pairs = dict.fromkeys(pair for each in fleet.values() for pair in ways.pairs(*stops, *each))
        if pairs:
            return tuple(Relation(one or "", other or "", 1.0) for one, other in pairs)
    return ()


def read_orders(file: Path, plant: PlantModel, operations: Operations) -> Demand:
    """Read orders from CSV (``from,to,per_hour`` or ``at,from,to``) or JSON.

    JSON is a list of requests for transport orders, each with ``at`` in seconds, or the order service's
    answer to GET /v1/transportOrders.

    Raises:
        DemandError: the file has another form, or names locations that the plant does not have.

    """
    # -sig: spreadsheets begin CSV files with a byte order mark, which would belong to the first column.
    text = file.read_text(encoding="utf-8-sig")
    try:
        demand = (
            _of_json(json.loads(text))
            if file.suffix == ".json"
            else _of_csv(text, Transport(plant, operations))
        )
    except (KeyError, TypeError, ValueError) as error:
        message = f"{file}: {type(error).__name__}: {error}"
        raise DemandError(message) from error
    known = plant.locations_by_name.keys() | plant.points_by_name.keys()
    named = {each for one in demand.relations for each in (one.source, one.destination)}
    named |= {each.location_name or "" for one in demand.orders for each in one.request.destinations}
    if unknown := sorted(named - known):
        message = f"{file}: the plant has no location {', '.join(map(repr, unknown[:10]))}"
        raise DemandError(message)
    return demand


def _of_csv(text: str, make: Transport) -> Demand:
    rows = list(csv.DictReader(StringIO(text)))
    columns = set(rows[0]) if rows else set()
    if columns >= {"from", "to", "per_hour"}:
        return Demand(
            relations=tuple(Relation(row["from"], row["to"], float(row["per_hour"])) for row in rows)
        )
    if not columns >= {"at", "from", "to"}:
        message = "the columns must be from, to, per_hour, or at, from, to"
        raise DemandError(message)
    return Demand(_from_the_first([(row["at"], make(row["from"], row["to"])) for row in rows]))


def _of_json(content: Any) -> Demand:  # noqa: ANN401 - whatever the file holds
    found = content["transportOrders"] if isinstance(content, Mapping) else content
    return Demand(_from_the_first([_timed_request(each) for each in found]))


def _timed_request(
    content: Mapping[str, Any],
) -> tuple[str | float, TransportOrderRequest]:
    if "driveOrders" in content:  # an order as returned by the order service
        destinations = [each["destination"] for each in content["driveOrders"]]
        kept = {key: content[key] for key in ("type", "priority") if key in content}
        body = {"destinations": destinations, **kept}
        return content["created"], TransportOrderRequest.model_validate(body)
    body = {key: value for key, value in content.items() if key not in ("at", "name", "intendedVehicle")}
    return content["at"], TransportOrderRequest.model_validate(body)


def _from_the_first(
    timed: Sequence[tuple[str | float, TransportOrderRequest]],
) -> tuple[Order, ...]:
    """Sort orders; times of day count from the first order."""
    read = sorted(((_seconds_of(at), number) for number, (at, _) in enumerate(timed)))
    dated = any(isinstance(at, str) and not _is_number(at) for at, _ in timed)
    first = read[0][0] if read and dated else 0.0
    return tuple(Order(at - first, timed[number][1]) for at, number in read)


def _seconds_of(at: str | float) -> float:
    if isinstance(at, str) and not _is_number(at):
        return in_utc(datetime.fromisoformat(at)).timestamp()
    return float(at)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
