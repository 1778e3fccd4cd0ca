"""From the operations of a plant model to the actions of VDA 5050 (3.0 section 6.2.3, 2.1 section 6.8)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final
from uuid import uuid4

from nena_shared.plant import Location
from nena_shared.vda5050.action import Action, ActionParameter, BlockingType

NO_ACTION: Final = ""
"""What an operation is mapped to that is nothing but the drive."""

RECHARGE_ACTION: Final = "startCharging"

PICK: Final = "pick"
DROP: Final = "drop"

STATION_ACTIONS: Final = frozenset({PICK, DROP})
"""Actions that take and give loads, at a station."""

DEFAULT_ACTION_TYPES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Load cargo": "pick",
        "Load": "pick",
        "Unload cargo": "drop",
        "Unload": "drop",
        "Charge": "startCharging",
        "CHARGE": "startCharging",
        "MOVE": NO_ACTION,
        "PARK": NO_ACTION,
        "NOP": NO_ACTION,
    }
)

STATION_PARAMETERS: Final = frozenset({"stationType", "stationName", "loadType"})
"""What pick and drop are told of their place and load, whether or not anybody has asked for it."""

UNSPECIFIED_LOAD: Final = "unspecified"
"""The loadType where nobody says one; 2.1 demands the parameter of pick and drop."""


def fresh_id() -> str:
    """Give an id that nothing else has; 32 characters, for some robots take no longer ones."""
    return uuid4().hex


@dataclass(frozen=True, slots=True)
class OperationMap:
    """Which action an operation stands for; an unknown operation is an action of the same name.

    ``action_types`` is laid over the defaults; an empty action type means that there is nothing to do but to
    be there.
    """

    action_types: Mapping[str, str] = field(default_factory=dict)
    new_id: Callable[[], str] = fresh_id

    def action_type(self, operation: str) -> str:
        """Give the action type that an operation stands for."""
        usual = DEFAULT_ACTION_TYPES.get(operation, operation)
        return self.action_types.get(operation, usual)

    def recharges(self, operation: str) -> bool:
        """Tell whether an operation is to recharge."""
        return self.action_type(operation) == RECHARGE_ACTION

    def actions(
        self,
        operation: str,
        properties: Mapping[str, str],
        location: Location | None = None,
        *,
        retriable: bool = False,
    ) -> tuple[Action, ...]:
        """Give the actions of ``operation`` with fresh ids; ``properties`` become parameters.

        For pick and drop the location's name and type become stationName and stationType, unless the
        properties say something else.
        """
        action_type = self.action_type(operation)
        if action_type == NO_ACTION:
            return ()
        parameters = {**_station(action_type, location), **properties}
        action = Action(
            action_type=action_type,
            action_id=self.new_id(),
            action_descriptor=operation,
            blocking_type=BlockingType.HARD,
            action_parameters=tuple(_parameters(parameters.items())),
            retriable=retriable or None,
        )
        return (action,)


def _station(action_type: str, location: Location | None) -> dict[str, str]:
    if action_type not in STATION_ACTIONS:
        return {}
    station = {"stationType": location.type, "stationName": location.name} if location else {}
    return {"stationType": "point", **station, "loadType": UNSPECIFIED_LOAD}


def _parameters(values: Iterable[tuple[str, str]]) -> Iterable[ActionParameter]:
    return (ActionParameter(key=key, value=value) for key, value in values)
