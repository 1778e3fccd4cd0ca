"""What an action is, as its plug-in declares it: for the checks of orders and for the factsheet."""

from __future__ import annotations

from dataclasses import dataclass
from sys import float_info

from pydantic import JsonValue

from nena_shared.vda5050.action import Action, BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType

ALL_BLOCKING_TYPES = tuple(BlockingType)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter that an action takes."""

    key: str
    data_type: ValueDataType
    required: bool = True
    description: str = ""

    def problem(self, value: JsonValue) -> str | None:
        """Say what is wrong with ``value`` (None: not given); None if nothing is. An empty list is none."""
        if value is None or (value == [] and self.data_type is ValueDataType.ARRAY):
            return f"parameter '{self.key}' is missing" if self.required else None
        if not _fits(value, self.data_type):
            return f"parameter '{self.key}' must be of type {self.data_type}"
        return None


@dataclass(frozen=True, slots=True)
class ActionDeclaration:
    """One action type (section 7.10, mobileRobotActions).

    ``open_ended``: it has no goal of its own, like a lamp, and has succeeded when its edge ends.
    ``restartable``: it may be begun anew after the agent was interrupted in it.
    """

    action_type: str
    scopes: tuple[ActionScope, ...]
    parameters: tuple[Parameter, ...] = ()
    blocking_types: tuple[BlockingType, ...] = ALL_BLOCKING_TYPES
    pause_allowed: bool = False
    cancel_allowed: bool = False
    open_ended: bool = False
    restartable: bool = False
    description: str = ""

    def problem(self, action: Action, scope: ActionScope) -> str | None:
        """Say why ``action`` cannot be done in ``scope``; None if it can."""
        if scope not in self.scopes:
            allowed = ", ".join(self.scopes)
            return f"action '{self.action_type}' is not possible with scope {scope}, only {allowed}"
        if scope is not ActionScope.INSTANT and action.blocking_type not in self.blocking_types:
            return f"action '{self.action_type}' cannot have the blocking type {action.blocking_type}"
        problems = (each.problem(action.parameter(each.key)) for each in self.parameters)
        found = next((each for each in problems if each), None)
        return found and f"action '{self.action_type}': {found}"


_PYTHON_TYPES: dict[ValueDataType, tuple[type, ...]] = {
    ValueDataType.BOOL: (bool,),
    ValueDataType.NUMBER: (int, float),
    ValueDataType.INTEGER: (int,),
    ValueDataType.STRING: (str,),
    ValueDataType.OBJECT: (dict,),
    ValueDataType.ARRAY: (list,),
}


def _fits(value: JsonValue, data_type: ValueDataType) -> bool:
    """Tell whether ``value`` is of the type; a number is one that a float64 can hold (section 7.1)."""
    if type(value) not in _PYTHON_TYPES[data_type]:
        return False
    return not isinstance(value, int) or abs(value) <= float_info.max
