"""Check a new plant model for conflicts with current orders and vehicles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nena_order_service.engine.engine import Engine
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.validation import InvalidRequestError, check_order
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.plant import PlantModel
from nena_shared.plant.model import BlockType

PROBLEMS_NAMED = 100
"""Maximum number of conflicts that an answer lists."""


def conflicts(engine: Engine, new: PlantModel, registry: VehicleRegistry) -> tuple[str, ...]:
    """Return the conflicts of current orders and vehicles with the plant model ``new``.

    ``registry`` is that of the new plant. The destinations of orders, and everything that vehicles hold or
    have claimed, must be unchanged: robots continue the orders that they were sent, and traffic control keeps
    other vehicles away from them.
    """
    problems = [
        *_of_orders(engine.state.orders.present(), new, registry),
        *_of_sequences(engine.state.sequences.unfinished(), registry),
        *_of_vehicles(engine, new, registry),
    ]
    more = len(problems) - PROBLEMS_NAMED
    return (*problems[:PROBLEMS_NAMED], f"and {more} more") if more > 0 else tuple(problems)


def _of_orders(orders: Iterable[TransportOrder], new: PlantModel, registry: VehicleRegistry) -> Iterator[str]:
    names = registry.names()
    for order in orders:
        try:
            check_order(order.status, new)
        except InvalidRequestError as error:
            yield from (f"transport order {order.name!r}: {finding.text}" for finding in error.findings)
        intended = order.status.intended_vehicle
        if intended is not None and intended not in names:
            yield f"transport order {order.name!r} is for vehicle {intended!r}, which would be removed"


def _of_sequences(sequences: Iterable[OrderSequence], registry: VehicleRegistry) -> Iterator[str]:
    names = registry.names()
    for sequence in sequences:
        vehicle = sequence.bound_vehicle or sequence.status.intended_vehicle
        if vehicle is not None and vehicle not in names:
            yield f"order sequence {sequence.name!r} is for vehicle {vehicle!r}, which would be removed"


def _of_vehicles(engine: Engine, new: PlantModel, registry: VehicleRegistry) -> Iterator[str]:
    differences = _Differences(engine.plant, new)
    for vehicle in engine.registry:
        route = engine.traffic.route_of(vehicle.name)
        if engine.state.drives.order_number(vehicle.key) is not None or route:
            yield from _of_robot(vehicle, registry)
        ahead = route.way[route.allocated :] if route else ()
        for place in (*engine.traffic.held_by(vehicle.name), *ahead):
            for problem in differences.of_place(place, under_way=route is not None):
                yield f"vehicle {vehicle.name!r} uses {problem}"


def _of_robot(vehicle: FleetVehicle, registry: VehicleRegistry) -> Iterator[str]:
    """Yield why a working vehicle would not be the same robot in the new plant."""
    if vehicle.model is None:
        same_robot, same_name = registry.of(vehicle.key), registry.named(vehicle.name)
        if (same_robot and same_robot.name != vehicle.name) or (same_name and same_name.key != vehicle.key):
            yield f"vehicle {vehicle.name!r} has an order, and would have another name"
        return
    successor = registry.named(vehicle.name)
    if successor is None or successor.model is None:
        yield f"vehicle {vehicle.name!r} has an order, and would be removed"
    elif successor.key != vehicle.key or successor.profile.map_id != vehicle.profile.map_id:
        yield f"vehicle {vehicle.name!r} has an order, and would be another robot or on another map"


class _Differences:
    """Compares single resources in two plants."""

    def __init__(self, old: PlantModel, new: PlantModel) -> None:
        self._old = old
        self._new = new
        self._old_blocks, self._new_blocks = _blocks_by_member(old), _blocks_by_member(new)

    def of_place(self, place: ResourceSet, *, under_way: bool) -> Iterator[str]:
        """Yield removals and changes of a resource; with ``under_way``, also moved points and paths."""
        for name in dict.fromkeys((place.point, *place.uses)):
            if name in self._old.blocks_by_name:  # its members are compared instead
                continue
            if self._is_removed(name):
                yield f"{name!r}, which would be removed"
            elif self._old_blocks.get(name) != self._new_blocks.get(name):
                yield f"{name!r}, which would be in other blocks"
            elif under_way and self._is_moved(name):
                yield f"{name!r}, which would be moved"

    def _is_removed(self, name: str) -> bool:
        kinds = (
            (self._old.points_by_name, self._new.points_by_name),
            (self._old.paths_by_name, self._new.paths_by_name),
            (self._old.locations_by_name, self._new.locations_by_name),
        )
        return any(name in old and name not in new for old, new in kinds)

    def _is_moved(self, name: str) -> bool:
        point, new = self._old.points_by_name.get(name), self._new.points_by_name.get(name)
        if point and new:
            return (point.x_mm, point.y_mm, point.map_id) != (new.x_mm, new.y_mm, new.map_id)
        path, changed = self._old.paths_by_name.get(name), self._new.paths_by_name.get(name)
        if path and changed:
            return (path.source, path.destination, path.length_mm) != (
                changed.source,
                changed.destination,
                changed.length_mm,
            )
        return False


def _blocks_by_member(plant: PlantModel) -> dict[str, set[tuple[str, BlockType]]]:
    """Return the blocks that each resource is in."""
    blocks: dict[str, set[tuple[str, BlockType]]] = {}
    for block in plant.blocks:
        for member in block.members:
            blocks.setdefault(member, set()).add((block.name, block.type))
    return blocks
