"""Actions and their states (VDA 5050 3.0 sections 6.2, 6.6.9 and 7.3)."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import datetime
from enum import StrEnum
from typing import Annotated, Final

from pydantic import AfterValidator, JsonValue
from pydantic_core import to_json

from nena_shared.vda5050.base import CommandHeader, Identifier, WireObject, finite

LOAD_HANDLING_DEVICE: Final = ("loadHandlingDevice", "lhd")
"""Parameter of pick and drop for the load handling device: name in 3.0.1, and in earlier versions."""

STATION_ACTIONS: Final = frozenset({"pick", "drop"})

START_HIBERNATION: Final = "startHibernation"
STOP_HIBERNATION: Final = "stopHibernation"
SHUTDOWN: Final = "shutdown"
WAKE_UP_TIME: Final = "wakeUpTime"
"""Parameter of startHibernation: ISO 8601 in UTC, ``YYYY-MM-DDTHH:mm:ss.fffZ`` (section 6.2.3)."""


class BlockingType(StrEnum):
    """Whether the robot may drive or run other actions during an action (section 6.2.2)."""

    NONE = "NONE"
    SINGLE = "SINGLE"
    SOFT = "SOFT"
    HARD = "HARD"


class ActionStatus(StrEnum):
    """State of an action (section 6.6.9)."""

    WAITING = "WAITING"
    INITIALIZING = "INITIALIZING"
    RUNNING = "RUNNING"
    PAUSED = "PAUSED"
    RETRIABLE = "RETRIABLE"
    FINISHED = "FINISHED"
    FAILED = "FAILED"

    @property
    def ended(self) -> bool:
        """Return whether the action has ended (section 6.6.9): FINISHED or FAILED."""
        return self in (ActionStatus.FINISHED, ActionStatus.FAILED)


def _check_sendable(value: JsonValue) -> JsonValue:
    if value is None:
        raise ValueError("null is not a parameter value; omit the parameter")
    return finite(value)


ParameterValue = Annotated[JsonValue, AfterValidator(_check_sendable)]
"""Any JSON value except null, NaN and infinity."""


def text_of(value: JsonValue) -> str:
    """Return a parameter value as text; values of other types as JSON."""
    return value if isinstance(value, str) else to_json(value).decode()


class ActionParameter(WireObject):
    """One parameter of an action, with its value (section 6.2)."""

    key: str
    value: ParameterValue


class Action(WireObject):
    """An action of the robot, such as picking up a load (section 6.2)."""

    action_type: Identifier
    action_id: Identifier
    blocking_type: BlockingType
    action_descriptor: str | None = None
    action_parameters: tuple[ActionParameter, ...] = ()
    retriable: bool | None = None

    def parameter(self, key: str) -> JsonValue:
        """Return the value of the parameter ``key``, or None (section 7.3.1)."""
        return next((parameter.value for parameter in self.action_parameters if parameter.key == key), None)

    def with_values(self, change: Callable[[ActionParameter], JsonValue]) -> Action:
        """Return a copy with the parameter values from ``change``; ``self`` if none differs."""
        values = tuple(map(change, self.action_parameters))
        if all(new is old.value for new, old in zip(values, self.action_parameters, strict=True)):
            return self
        parameters = tuple(
            old.model_copy(update={"value": new})
            for new, old in zip(values, self.action_parameters, strict=True)
        )
        return self.model_copy(update={"action_parameters": parameters})


_UTC: Final = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?Z", re.ASCII)


def wake_up_time(action: Action) -> datetime | None:
    """Return the end of a hibernation, UTC; None if missing or not in 3.0.1's format (section 6.2.3)."""
    value = action.parameter(WAKE_UP_TIME)
    if not isinstance(value, str) or not _UTC.fullmatch(value):
        return None
    try:
        return datetime.fromisoformat(value)
    except ValueError:
        return None


class ActionState(WireObject):
    """State of one action as reported by the robot (section 6.6.9)."""

    action_id: Identifier
    action_type: Identifier | None = None
    action_descriptor: str | None = None
    action_status: ActionStatus
    action_result: str | None = None


class InstantActions(CommandHeader):
    """Actions to execute immediately, in addition to the order (section 7.4)."""

    actions: tuple[Action, ...]
