"""Checks a request for a transport order against the plant, and reports all problems at once."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import chain
from operator import is_

from nena_order_service.orders.transport_order import RESOURCES_TO_AVOID
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import (
    Destination,
    Property,
    TransportOrderRequest,
    TransportOrderStatus,
)
from nena_shared.plant import NO_OPERATION, PlantModel

R = ReasonCode

MOVE = "MOVE"
PARK = "PARK"
POINT_OPERATIONS = (MOVE, PARK)
"""What can be done at a point or coordinate."""

NAMES_SHOWN = 10


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem of a request; ``unknown``: it names something that does not exist."""

    text: Reason
    unknown: bool = False


class InvalidRequestError(Exception):
    """A request that does not fit this plant."""

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings = tuple(findings)
        texts = [finding.text for finding in self.findings]
        super().__init__(texts[0] if len(texts) == 1 else Reason(R.FINDINGS, *texts))

    @property
    def only_unknown(self) -> bool:
        """Whether the only problems are unknown names."""
        return all(finding.unknown for finding in self.findings)


def check_request(request: TransportOrderRequest, plant: PlantModel, vehicles: Collection[str]) -> None:
    """Raise InvalidRequestError with all errors of ``request``; ``vehicles`` are the known ones."""
    findings = [*_check_destinations(request.destinations, plant, new=True)]
    name = request.intended_vehicle
    if name is not None and name not in vehicles:
        why = Reason(R.UNKNOWN_VEHICLE, *_similar_names(name, vehicles), vehicle=name)
        findings.append(Finding(why, unknown=True))
    findings += _check_resources_to_avoid(request.properties, plant)
    _raise_if_any(findings)


def set_operations(request: TransportOrderRequest, plant: PlantModel) -> TransportOrderRequest:
    """Return the request with NOP at locations without an operation, unless MOVE is possible there."""
    destinations = tuple(_set_operation(destination, plant) for destination in request.destinations)
    if all(map(is_, destinations, request.destinations)):
        return request
    return request.model_copy(update={"destinations": destinations})


def _set_operation(destination: Destination, plant: PlantModel) -> Destination:
    name = destination.location_name
    if (
        "operation" in destination.model_fields_set
        or name is None
        or name not in plant.locations_by_name
        or plant.access_points(name, MOVE)
    ):
        return destination
    return destination.model_copy(update={"operation": NO_OPERATION})


def check_order(order: TransportOrderStatus, plant: PlantModel) -> None:
    """Raise InvalidRequestError if the rest of an existing order no longer fits the plant, locks aside."""
    left = order.drive_orders[max(order.current_drive_order_index, 0) :]
    destinations = [drive_order.destination for drive_order in left]
    _raise_if_any(
        [
            *_check_destinations(destinations, plant, new=False),
            *_check_resources_to_avoid(order.properties, plant),
        ]
    )


def _raise_if_any(findings: Sequence[Finding]) -> None:
    if findings:
        raise InvalidRequestError(findings)


def _check_destinations(
    destinations: Iterable[Destination], plant: PlantModel, *, new: bool
) -> Iterator[Finding]:
    for number, destination in enumerate(destinations, start=1):
        findings = [*_check_destination(destination, plant)]
        location = plant.locations_by_name.get(destination.location_name or "")
        # A locked location takes no new orders; those that exist go on.
        if new and location and location.locked:
            findings.insert(0, Finding(Reason(R.LOCATION_LOCKED, location=location.name)))
        for finding in findings:
            yield Finding(Reason(R.AT_DESTINATION, finding.text, number=number), finding.unknown)


def _check_destination(destination: Destination, plant: PlantModel) -> Iterator[Finding]:
    yield from _check_peripherals(destination, plant)
    name = destination.location_name
    if name is not None and name in plant.locations_by_name:
        location = plant.location(name)
        if not location.links:
            yield Finding(Reason(R.NO_LINK, location=name))
        elif not plant.access_points(name, destination.operation):
            linked = (plant.link_operations(location, link) for link in location.links)
            # openTCS: NOP is possible at every link, listed or not.
            names = ", ".join(sorted({NO_OPERATION, *chain.from_iterable(linked)}))
            values = {"operation": destination.operation, "location": name, "names": names}
            yield Finding(Reason(R.NOT_AT_LOCATION, **values))
    elif name is not None and name not in plant.points_by_name:
        places = [*plant.locations_by_name, *plant.points_by_name]
        yield Finding(Reason(R.UNKNOWN_PLACE, *_similar_names(name, places), name=name), unknown=True)
    elif destination.operation not in POINT_OPERATIONS:
        operation = destination.operation
        at_coordinate = Reason(R.NOT_AT_COORDINATE, operation=operation)
        yield Finding(Reason(R.NOT_AT_POINT, operation=operation, name=name) if name else at_coordinate)


def _check_peripherals(destination: Destination, plant: PlantModel) -> Iterator[Finding]:
    for operation in destination.peripheral_operations:
        location = plant.locations_by_name.get(operation.location)
        if location is None:
            like = _similar_names(operation.location, plant.locations_by_name)
            yield Finding(Reason(R.UNKNOWN_DEVICE, *like, location=operation.location), unknown=True)
            continue
        possible = plant.location_types_by_name[location.type].allowed_peripheral_operations
        if operation.operation not in possible:
            values = {"location": operation.location, "operation": operation.operation}
            none = Reason(R.NO_DEVICE, **values)
            yield Finding(Reason(R.NOT_AT_DEVICE, names=", ".join(possible), **values) if possible else none)


def _check_resources_to_avoid(properties: Iterable[Property], plant: PlantModel) -> Iterator[Finding]:
    listed = next((property_.value for property_ in properties if property_.key == RESOURCES_TO_AVOID), "")
    tables = (plant.points_by_name, plant.paths_by_name, plant.locations_by_name)
    for name in filter(None, map(str.strip, listed.split(","))):
        if not any(name in names for names in tables):
            why = Reason(R.UNKNOWN_AVOIDED, property=RESOURCES_TO_AVOID, name=name)
            yield Finding(why, unknown=True)


def _similar_names(name: str, known: Collection[str]) -> Iterator[Reason]:
    """Yield what may have been meant, if it is known."""
    alike = get_close_matches(name, list(known), n=3)
    if alike:
        yield Reason(R.DID_YOU_MEAN, *map(repr, alike))
    elif not known:
        yield Reason(R.NONE_KNOWN)
    elif len(known) <= NAMES_SHOWN:
        yield Reason(R.KNOWN_NAMES, names=", ".join(map(repr, sorted(known))))
