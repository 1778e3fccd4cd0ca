"""Declarations of actions, and those of the predefined actions (sections 6.2.3 and 7.10)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from math import isfinite, pi, radians, remainder
from sys import float_info
from types import MappingProxyType
from typing import Final

from pydantic import JsonValue

from nena_shared.vda5050.action import (
    LOAD_HANDLING_DEVICE,
    SHUTDOWN,
    START_HIBERNATION,
    STATION_ACTIONS,
    STOP_HIBERNATION,
    WAKE_UP_TIME,
    Action,
    ActionStatus,
    BlockingType,
    wake_up_time,
)
from nena_shared.vda5050.base import ANGLE_LIMIT
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.malformed import QUOTE, quoted
from nena_shared.vda5050.repair import FULL_TURN, FULL_TURN_DEGREES
from nena_shared.vda5050.rules import Rules

ALL_BLOCKING_TYPES = tuple(BlockingType)

Check = Callable[[Action], str | None]
"""Returns why an action cannot be executed, None if it can. It must not block: orders wait for it."""


class LoadChange(StrEnum):
    """Effect of an action on the load."""

    TAKE = "take"
    """Loads the robot, which must be empty."""
    GIVE = "give"
    """Unloads the robot, which must be loaded."""


def _read_number(text: str) -> float:
    value = float(text)
    if "_" in text or not isfinite(value):
        raise ValueError(text)
    return value


_FROM_TEXT: Final[Mapping[ValueDataType, Callable[[str], JsonValue]]] = MappingProxyType(
    {
        ValueDataType.NUMBER: _read_number,
        # Python reads "1_000" as a number, fleet control does not mean one.
        ValueDataType.INTEGER: lambda text: int(text.replace("_", "?")),
        ValueDataType.BOOL: lambda text: {"true": True, "false": False}[text.strip().lower()],
    }
)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an action; ``choices``, if any, are its allowed values."""

    key: str
    data_type: ValueDataType
    required: bool = True
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[JsonValue, ...] = ()
    angle: bool = False

    def problem(self, value: JsonValue) -> str | None:
        """Return what is wrong with ``value``, None if it is valid (section 7.3.1).

        None and an empty array count as missing.
        """
        if value is None or (value == [] and self.data_type is ValueDataType.ARRAY):
            return f"parameter '{self.key}' is missing" if self.required else None
        # A number must fit a float64 (7.1). A bool is no number, although Python's is an int.
        fits = type(value) in _PYTHON_TYPES[self.data_type]
        if not fits or (isinstance(value, int) and abs(value) > float_info.max):
            return f"parameter '{self.key}' must be of type {self.data_type}{QUOTE}{quoted(value)})"
        if self.choices and value not in self.choices:
            return f"parameter '{self.key}' must be one of {self._list_choices}"
        if not isinstance(value, int | float):
            return None
        low = self.minimum is not None and value < self.minimum
        high = self.maximum is not None and value > self.maximum
        return f"parameter '{self.key}' must be {self._describe_range}" if low or high else None

    def read(self, value: JsonValue) -> JsonValue:
        """Convert a number or boolean that was sent as a string, and an angle to radians within half a turn.

        Some fleet controls can only send strings, or send degrees.
        """
        if isinstance(value, str) and self.data_type in _FROM_TEXT:
            with suppress(KeyError, ValueError):
                value = _FROM_TEXT[self.data_type](value)
        # beyond a full turn in degrees, the unit is unknown
        if self.angle and isinstance(value, int | float) and ANGLE_LIMIT < abs(value) <= FULL_TURN_DEGREES:
            return remainder(radians(value) if abs(value) > FULL_TURN else value, 2 * pi)
        return value

    @property
    def words(self) -> str:
        """Return the description, followed by the allowed values."""
        limits = [
            self.description,
            self._describe_range,
            f"one of {self._list_choices}" if self.choices else "",
        ]
        return ", ".join(limit for limit in limits if limit)

    @property
    def _list_choices(self) -> str:
        return ", ".join(map(str, self.choices))

    @property
    def _describe_range(self) -> str:
        least = "" if self.minimum is None else f"at least {self.minimum:g}"
        most = "" if self.maximum is None else f"at most {self.maximum:g}"
        return " and ".join(limit for limit in (least, most) if limit)


@dataclass(frozen=True, slots=True)
class ActionDeclaration:
    """One action type (section 7.10, mobileRobotActions).

    Attributes:
        open_ended: it has no end of its own, such as a signal light, and is FINISHED when its edge ends.
        restartable: it may start again if a restart of the agent has interrupted it.
        result: description of its actionResult.
        load: its effect on the load.
        check: an additional check of its parameters.
        unavailable: why this robot cannot execute it; empty if it can.
        timeout: maximum duration without pauses, seconds; None: unlimited.
        needs_idle: it is refused while an order is active.
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
    result: str = ""
    load: LoadChange | None = None
    check: Check | None = None
    unavailable: str = ""
    timeout: float | None = None
    needs_idle: bool = False

    @property
    def only_instant(self) -> bool:
        """Return whether it is offered only as an instant action; its blocking type is then NONE."""
        return self.scopes == (ActionScope.INSTANT,)

    def problem(self, action: Action, scope: ActionScope) -> str | None:
        """Return why ``action`` cannot be executed in ``scope``, None if it can."""
        if self.unavailable:
            return f"action '{self.action_type}' is not possible: {self.unavailable}"
        if scope not in self.scopes:
            allowed = ", ".join(self.scopes)
            return f"action '{self.action_type}' is not possible with scope {scope}, only {allowed}"
        if scope is not ActionScope.INSTANT and action.blocking_type not in self.blocking_types:
            return f"action '{self.action_type}' cannot have the blocking type {action.blocking_type}"
        problems = (parameter.problem(action.parameter(parameter.key)) for parameter in self.parameters)
        problem = _device_conflict(action) or next((text for text in problems if text), None)
        if problem is None and self.check is not None:
            problem = self.check(action)
        return problem and f"action '{self.action_type}': {problem}"

    def read(self, action: Action) -> Action:
        """Return the action with its parameter values converted by :meth:`Parameter.read`.

        The load handling device of pick and drop gets the declared key: 3.0.1 has renamed it.
        """
        declared = {parameter.key: parameter for parameter in self.parameters}
        key = next((name for name in LOAD_HANDLING_DEVICE if name in declared), None)
        if key is not None and action.action_type in STATION_ACTIONS:
            action = _with_device_key(action, key)
        return action.with_values(
            lambda sent: declared[sent.key].read(sent.value) if sent.key in declared else sent.value
        )

    def load_problem(self, *, loaded: bool) -> str | None:
        """Return why the robot's load prevents the action, None if it does not."""
        if self.load is LoadChange.TAKE and loaded:
            return f"action '{self.action_type}' picks up a load, but the robot is already loaded"
        if self.load is LoadChange.GIVE and not loaded:
            return f"action '{self.action_type}' drops a load, but the robot carries none"
        return None


def _device_conflict(action: Action) -> str | None:
    """Return the problem of a pick or drop that names different load handling devices by its two keys."""
    values = [action.parameter(key) for key in LOAD_HANDLING_DEVICE]
    if action.action_type not in STATION_ACTIONS or None in values or values[0] == values[1]:
        return None
    return f"parameters {' and '.join(LOAD_HANDLING_DEVICE)} name different load handling devices"


def _with_device_key(action: Action, key: str) -> Action:
    if all(
        parameter.key == key or parameter.key not in LOAD_HANDLING_DEVICE
        for parameter in action.action_parameters
    ):
        return action
    if _device_conflict(action):
        return action  # refused later
    parameters = tuple(
        parameter.model_copy(update={"key": key}) if parameter.key in LOAD_HANDLING_DEVICE else parameter
        for parameter in action.action_parameters
    )
    return action.model_copy(update={"action_parameters": parameters})


_PYTHON_TYPES: dict[ValueDataType, tuple[type, ...]] = {
    ValueDataType.BOOL: (bool,),
    ValueDataType.NUMBER: (int, float),
    ValueDataType.INTEGER: (int,),
    ValueDataType.STRING: (str,),
    ValueDataType.OBJECT: (dict,),
    ValueDataType.ARRAY: (list,),
}


CANCEL_ORDER = "cancelOrder"
START_PAUSE = "startPause"
STOP_PAUSE = "stopPause"
STATE_REQUEST = "stateRequest"
FACTSHEET_REQUEST = "factsheetRequest"
INITIALIZE_POSITION = "initializePosition"
"""``initPosition`` in 2.x."""
CLEAR_INSTANT_ACTIONS = "clearInstantActions"
RETRY = "retry"
SKIP_RETRY = "skipRetry"
TRIGGER = "trigger"
ENABLE_ZONE_SET = "enableZoneSet"
DELETE_ZONE_SET = "deleteZoneSet"
WAIT_FOR_TRIGGER = "waitForTrigger"
DOWNLOAD_ZONE_SET = "downloadZoneSet"
DOWNLOAD_MAP = "downloadMap"
ENABLE_MAP = "enableMap"
DELETE_MAP = "deleteMap"
MAP_ACTIONS = frozenset({DOWNLOAD_MAP, ENABLE_MAP, DELETE_MAP})
HIBERNATION = frozenset({START_HIBERNATION, STOP_HIBERNATION})
POWER_ACTIONS = HIBERNATION | {SHUTDOWN}
"""Offered only by a robot that is configured for them."""
TRIGGER_TYPE = "triggerType"

_POSITION = (
    Parameter("x", ValueDataType.NUMBER, description="m"),
    Parameter("y", ValueDataType.NUMBER, description="m"),
    Parameter("theta", ValueDataType.NUMBER, description="rad", angle=True),
    Parameter("mapId", ValueDataType.STRING),
    Parameter("lastNodeId", ValueDataType.STRING),
)


_RETRIABLE_ACTION = (Parameter("actionId", ValueDataType.STRING, description="of the RETRIABLE action"),)


_ZONE_SET = (Parameter("zoneSetId", ValueDataType.STRING),)


def _wake_up_problem(action: Action) -> str | None:
    value = action.parameter(WAKE_UP_TIME)
    if value is None or wake_up_time(action) is not None:
        return None
    return (
        f"parameter '{WAKE_UP_TIME}' is '{str(value)[:40]}', not a UTC time such as 2026-01-31T05:30:00.000Z"
    )


def _instant_action(
    action_type: str, description: str, parameters: tuple[Parameter, ...] = (), *, on_nodes: bool = False
) -> ActionDeclaration:
    scopes = (ActionScope.INSTANT, ActionScope.NODE) if on_nodes else (ActionScope.INSTANT,)
    return ActionDeclaration(action_type, scopes=scopes, parameters=parameters, description=description)


PREDEFINED: dict[str, ActionDeclaration] = {
    declaration.action_type: declaration
    for declaration in (
        _instant_action(
            CANCEL_ORDER,
            "Stops the robot where it is and ends the order.",
            (Parameter("orderId", ValueDataType.STRING, required=False),),
        ),
        _instant_action(START_PAUSE, "Stops driving and pauses actions that can be paused."),
        _instant_action(STOP_PAUSE, "Resumes driving and paused actions."),
        _instant_action(STATE_REQUEST, "Requests a state message."),
        _instant_action(FACTSHEET_REQUEST, "Requests a factsheet message."),
        _instant_action(INITIALIZE_POSITION, "Sets the robot's pose in the localisation.", _POSITION),
        _instant_action(
            CLEAR_INSTANT_ACTIONS, "Removes ended instant actions from the state.", on_nodes=True
        ),
        _instant_action(
            ENABLE_ZONE_SET,
            "Enables a zone set and disables the other sets of its map.",
            _ZONE_SET,
            on_nodes=True,
        ),
        _instant_action(DELETE_ZONE_SET, "Deletes a zone set that is not enabled.", _ZONE_SET),
        _instant_action(RETRY, "Starts a RETRIABLE action again.", _RETRIABLE_ACTION),
        _instant_action(SKIP_RETRY, "Ends a RETRIABLE action as FAILED.", _RETRIABLE_ACTION),
        _instant_action(TRIGGER, "Releases the actions that wait for fleet control."),
        replace(
            _instant_action(
                START_HIBERNATION,
                "Ends the order, reports it, and goes to a low-power mode without states.",
                (Parameter(WAKE_UP_TIME, ValueDataType.STRING, required=False, description="UTC, ISO 8601"),),
            ),
            check=_wake_up_problem,
        ),
        _instant_action(STOP_HIBERNATION, "Wakes the robot."),
        replace(_instant_action(SHUTDOWN, "Disconnects and shuts the robot down."), needs_idle=True),
        ActionDeclaration(
            WAIT_FOR_TRIGGER,
            scopes=(ActionScope.NODE,),
            parameters=(
                Parameter(TRIGGER_TYPE, ValueDataType.ARRAY, description="FLEET_CONTROL, LOCAL or others"),
            ),
            cancel_allowed=True,
            description="Waits until one of the triggers is released.",
        ),
    )
}
"""Declarations by action type."""


def supported_actions(
    declarations: Mapping[str, ActionDeclaration], rules: Rules, power: frozenset[str] = frozenset()
) -> dict[str, ActionDeclaration]:
    """Return the declarations without predefined actions that the version lacks (section 6.2.3).

    Of the actions for hibernation and shutdown, only those in ``power`` are included.
    """
    unknown = set(POWER_ACTIONS - power if rules.hibernation else POWER_ACTIONS)
    if ActionStatus.RETRIABLE not in rules.action_statuses:
        unknown |= {RETRY, SKIP_RETRY}
    if not rules.instant_states_until_cleared:
        unknown.add(CLEAR_INSTANT_ACTIONS)
    if not rules.trigger_by_action:
        unknown.add(TRIGGER)
    if not rules.maps:
        unknown |= MAP_ACTIONS
    if not rules.zones:
        unknown |= {ENABLE_ZONE_SET, DELETE_ZONE_SET, DOWNLOAD_ZONE_SET}
    return {name: declaration for name, declaration in declarations.items() if name not in unknown}
