"""The orders of a simulation: recorded, drawn at random by rates per relation, or an endless backlog."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from heapq import merge
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any

from nena_shared.clock import in_utc
from nena_shared.fleet_api.transport_order import Destination, TransportOrderRequest
from nena_shared.plant import PlantModel
from nena_shared.plant.model import action_of

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

    def timed(self, plant: PlantModel, random: Random) -> Iterator[Order]:
        """Yield the orders with a creation time, earliest first; endless if they are drawn at random."""
        make = Transport(plant)
        drawn = (
            []
            if self.backlog
            else [_draw_orders(relation, make, random.random()) for relation in self.relations]
        )
        return merge(self.orders, *drawn, key=lambda order: order.at)

    def waiting(self, plant: PlantModel, random: Random) -> Iterator[TransportOrderRequest]:
        """Yield orders that refill the backlog, drawn by the relations' rates."""
        make = Transport(plant)
        relations = self.relations or every_relation(plant)
        rates = [each.per_hour for each in relations]
        while True:
            relation = random.choices(relations, rates)[0]
            yield make(relation.source, relation.destination)


def _draw_orders(relation: Relation, make: Transport, seed: float) -> Iterator[Order]:
    """Yield orders at independent random intervals (a Poisson process)."""
    random, at = Random(seed), 0.0  # noqa: S311 - no key
    while relation.per_hour > 0:
        at += random.expovariate(relation.per_hour / HOUR)
        yield Order(at, make(relation.source, relation.destination))


class Transport:
    """Creates requests to pick a load at one location and drop it at another."""

    def __init__(self, plant: PlantModel) -> None:
        self._plant = plant

    def __call__(self, source: str, destination: str) -> TransportOrderRequest:
        """Return the request."""
        return TransportOrderRequest(
            destinations=(
                Destination(location_name=source, operation=self._operation_at(source, "pick")),
                Destination(location_name=destination, operation=self._operation_at(destination, "drop")),
            )
        )

    def _operation_at(self, location: str, action: str) -> str:
        """Return the location's operation that maps to this action, otherwise its first operation."""
        if location in self._plant.points_by_name:
            return "MOVE"
        found = self._plant.location(location)
        allowed = self._plant.location_type(found.type).allowed_operations
        return next((each for each in allowed if action_of(each) == action), allowed[0] if allowed else "NOP")


def stations(plant: PlantModel) -> tuple[str, ...]:
    """Return the locations at which robots pick and drop; if there are none, all reachable ones."""
    reachable = [location for location in plant.locations if location.links]
    both = [
        each.name
        for each in reachable
        if {"pick", "drop"} <= {action_of(name) for name in plant.location_type(each.type).allowed_operations}
    ]
    return tuple(both or (each.name for each in reachable))


def every_relation(plant: PlantModel) -> tuple[Relation, ...]:
    """Return relations of equal rate between all pairs of stations."""
    names = stations(plant)
    return tuple(Relation(one, other, 1.0) for one in names for other in names if one != other)


def read_orders(file: Path, plant: PlantModel) -> Demand:
    """Read orders from CSV (``from,to,per_hour`` or ``at,from,to``) or JSON.

    JSON is a list of requests for transport orders, each with ``at`` in seconds, or the order service's
    answer to GET /v1/transportOrders.

    Raises:
        DemandError: the file has another form, or names locations that the plant does not have.

    """
    # -sig: spreadsheets begin CSV files with a byte order mark, which would belong to the first column.
    text = file.read_text(encoding="utf-8-sig")
    try:
        demand = _of_json(json.loads(text)) if file.suffix == ".json" else _of_csv(text, Transport(plant))
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
