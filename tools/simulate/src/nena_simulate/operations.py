"""The operations of a plant: what they are for, and the actions that simulated robots offer for them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum
from itertools import chain
from typing import Literal

from nena_edge_agent.actions.settings import OperationBase, OperationSettings, default_operations
from nena_order_service.fleet.vda_order import DROP, NO_ACTION, PICK, RECHARGE_ACTION, OperationMap
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from nena_shared.plant import Location, Path, PlantModel, Point
from nena_shared.plant import property_keys as keys
from nena_shared.plant.driver_properties import find_actions
from nena_shared.vda5050.factsheet import ActionScope


class Purpose(StrEnum):
    """What an operation is for."""

    PICK = "pick"
    DROP = "drop"
    CHARGE = "charge"
    OTHER = "other"
    NONE = "none"
    """The robot only has to arrive."""


_WORDS = (
    (Purpose.CHARGE, r"charg|recharg|batter"),
    (Purpose.DROP, r"unload|drop|deliver|deposit|put|place|entlad|ablad|abgeb|abgabe"),
    (Purpose.PICK, r"load|pick|fetch|collect|take|get|belad|auflad|abhol|aufnahme|aufnehm"),
)
"""Beginnings of words in the names of public models' operations; the first that fits counts."""

Effect = Literal["take", "give", ""]
_EFFECTS: dict[Purpose, Effect] = {Purpose.PICK: "take", Purpose.DROP: "give"}


class Operations:
    """The operations of a plant, under the order service's setting ``action_types``."""

    def __init__(self, plant: PlantModel, action_types: Mapping[str, str]) -> None:
        self._plant = plant
        self._map = OperationMap(action_types)
        vehicles = (vehicle.properties for vehicle in plant.vehicles)
        self._recharging = {found.get(keys.VDA5050_RECHARGE_OPERATION) for found in vehicles}

    def action_type(self, operation: str) -> str:
        """Return the action type of an operation; empty for none."""
        return self._map.action_type(operation)

    def purpose_of(self, operation: str) -> Purpose:
        """Return what an operation is for, by its action or by the words of its name."""
        action = self.action_type(operation)
        if action == RECHARGE_ACTION or operation in self._recharging:
            return Purpose.CHARGE
        known = {NO_ACTION: Purpose.NONE, PICK: Purpose.PICK, DROP: Purpose.DROP}
        words = re.sub(r"(?<=[a-z])(?=[A-Z])|[\W_\d]+", " ", operation).casefold()
        named = (purpose for purpose, begins in _WORDS if re.search(rf"\b({begins})", words))
        return known.get(action) or next(named, Purpose.OTHER)

    def actions(self, requests: Iterable[TransportOrderRequest], seconds: float) -> tuple[OperationBase, ...]:
        """Return the actions that orders in the plant may carry, those of ``requests`` included.

        Picking and dropping take ``seconds``, other operations too; actions on the way take no time.
        """
        plant = self._plant
        usual = {each.action_type: each for each in default_operations()}
        loading = {name: usual[name].model_copy(update={"seconds": seconds}) for name in (PICK, DROP)}
        found = {**usual, **loading}
        allowed = chain.from_iterable(each.allowed_operations for each in plant.location_types)
        asked = (each.operation for request in requests for each in request.destinations)
        for operation in dict.fromkeys((*allowed, *asked)):
            # a property vda5050:destinationAction sends the operation itself instead of its action
            for action in {self.action_type(operation): None, operation: None}:
                if action:
                    load = _EFFECTS.get(self.purpose_of(operation), "")
                    found.setdefault(action, _timed(action, seconds, load=load))
        for action in self._on_the_way():
            found.setdefault(action, _timed(action, 0.0))
        return tuple(found.values())

    def _on_the_way(self) -> Iterator[str]:
        """Yield the types of the actions that the layout and properties demand at nodes and on edges."""
        plant = self._plant
        for point in plant.points:
            yield from (action.action_type for use in point.vehicle_types for action in use.actions)
        for path in plant.paths:
            yield from (action.action_type for use in path.vehicle_types for action in use.actions)
        objects: tuple[Point | Path | Location, ...] = (*plant.points, *plant.paths, *plant.locations)
        for each in objects:
            yield from (action.action_type for action in find_actions(each.properties))


def _timed(action_type: str, seconds: float, *, load: Effect = "") -> OperationSettings:
    scopes = (ActionScope.NODE, ActionScope.EDGE)
    return OperationSettings(action_type=action_type, seconds=seconds, load=load, scopes=scopes)
