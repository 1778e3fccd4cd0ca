"""Which peripheral operations a route needs, and when."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from nena_order_service.peripherals.jobs import JobKey
from nena_shared.fleet_api.peripherals import StepOperation
from nena_shared.plant import BACKWARD_SUFFIX, PlantModel
from nena_shared.plant_terms import ExecutionTrigger

T = ExecutionTrigger

DESTINATION = -1
"""Step of the operations that belong to a destination."""


@dataclass(frozen=True, slots=True)
class NeededOperation:
    """An operation that a route needs at ``step``, and the key of its job."""

    key: JobKey
    step: int
    """The index of its path on the route; that of the last one for an operation of the destination."""
    location: str
    operation: str
    trigger: ExecutionTrigger
    required: bool


class RouteNeeds:
    """The peripheral operations along the route of one VDA order, by step."""

    def __init__(self, operations: Iterable[NeededOperation]) -> None:
        self.operations = tuple(operations)
        self.keys = frozenset(operation.key for operation in self.operations)

    def __bool__(self) -> bool:
        return bool(self.operations)

    def at(self, step: int, *triggers: ExecutionTrigger) -> Iterator[NeededOperation]:
        """Yield the operations of a step with one of these triggers."""
        return (
            operation
            for operation in self.operations
            if operation.step == step and operation.trigger in triggers
        )

    def before(self, step: int) -> Iterator[NeededOperation]:
        """Yield the operations after earlier movements that come before a step.

        Those that are required, and those of the devices that the step needs again: a door that was passed
        is closed before it is opened for the next pass.
        """
        again = {
            operation.location
            for operation in self.operations
            if operation.step == step and operation.required
        }
        for operation in self.operations:
            behind = operation.trigger is T.AFTER_MOVEMENT and operation.step < step
            if behind and (operation.required or operation.location in again):
                yield operation

    def at_once(self) -> Iterator[NeededOperation]:
        """Yield the operations that start with the route."""
        return (operation for operation in self.operations if operation.trigger is T.IMMEDIATE)


class NeedsFinder:
    """Finds the peripheral operations of routes in one plant."""

    def __init__(self, plant: PlantModel, *, enabled: bool) -> None:
        self._by_path = {
            path.name: path.peripheral_operations
            for path in plant.paths
            if enabled and path.peripheral_operations
        }
        self._enabled = enabled

    def of(
        self, order_id: str, edges: Sequence[str], destination: Sequence[StepOperation], *, last: int
    ) -> RouteNeeds:
        """Return what a route over these VDA 5050 edges to a destination needs; ``last`` is its last step."""
        if not self._enabled or not (self._by_path or destination):
            return NOTHING
        needed = []
        for step, edge in enumerate(edges):
            path = edge.removesuffix(BACKWARD_SUFFIX)  # a door is needed in both directions
            for place, operation in enumerate(self._by_path.get(path, ())):
                key, trigger = JobKey(order_id, step, path, place), operation.execution_trigger
                required = operation.completion_required
                needed.append(
                    NeededOperation(key, step, operation.location, operation.name, trigger, required)
                )
        for place, wanted in enumerate(destination):
            key, trigger = JobKey(order_id, DESTINATION, "", place), wanted.execution_trigger
            required = wanted.completion_required
            needed.append(NeededOperation(key, last, wanted.location, wanted.operation, trigger, required))
        return RouteNeeds(needed)


NOTHING = RouteNeeds(())


def devices_of(plant: PlantModel) -> dict[str, tuple[str, ...]]:
    """Return the locations with a device, and the operations that their types and the paths name."""
    devices: dict[str, dict[str, None]] = {}
    for location in plant.locations:
        kind = plant.location_types_by_name.get(location.type)
        if kind and kind.allowed_peripheral_operations:
            devices.setdefault(location.name, {}).update(dict.fromkeys(kind.allowed_peripheral_operations))
    for path in plant.paths:
        for operation in path.peripheral_operations:
            devices.setdefault(operation.location, {})[operation.name] = None
    return {location: tuple(operations) for location, operations in devices.items()}
