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
"""What 3.0.1 and the versions before call the parameter of pick and drop for the load handling device."""

STATION_ACTIONS: Final = frozenset({"pick", "drop"})

START_HIBERNATION: Final = "startHibernation"
STOP_HIBERNATION: Final = "stopHibernation"
SHUTDOWN: Final = "shutdown"
WAKE_UP_TIME: Final = "wakeUpTime"
"""Parameter of startHibernation: ISO 8601 in UTC, ``YYYY-MM-DDTHH:mm:ss.fffZ`` (section 6.2.3)."""


class BlockingType(StrEnum):
    """What may continue while an action runs (section 6.2.2)."""

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


def _sendable(value: JsonValue) -> JsonValue:
    if value is None:
        message = "null is not a parameter value; omit the parameter"
        raise ValueError(message)
    return finite(value)


ParameterValue = Annotated[JsonValue, AfterValidator(_sendable)]
"""Any JSON but null, and but numbers without an end."""


def text_of(value: JsonValue) -> str:
    """Return the value of a parameter as text: what is none already, as JSON."""
    return value if isinstance(value, str) else to_json(value).decode()


class ActionParameter(WireObject):
    """One parameter of an action, with its value (section 6.2)."""

    key: str
    value: ParameterValue


class Action(WireObject):
    """Something that a robot does besides driving (section 6.2)."""

    action_type: Identifier
    action_id: Identifier
    blocking_type: BlockingType
    action_descriptor: str | None = None
    action_parameters: tuple[ActionParameter, ...] = ()
    retriable: bool | None = None

    def parameter(self, key: str) -> JsonValue:
        """Return the value under ``key``, or None (section 7.3.1)."""
        return next((each.value for each in self.action_parameters if each.key == key), None)

    def with_values(self, change: Callable[[ActionParameter], JsonValue]) -> Action:
        """Return the action with the values that ``change`` returns; itself if all stay the same."""
        values = tuple(map(change, self.action_parameters))
        if all(new is each.value for new, each in zip(values, self.action_parameters, strict=True)):
            return self
        parameters = tuple(
            each.model_copy(update={"value": new})
            for new, each in zip(values, self.action_parameters, strict=True)
        )
        return self.model_copy(update={"action_parameters": parameters})


_UTC: Final = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?Z", re.ASCII)


def wake_up_time(action: Action) -> datetime | None:
    """Return when a hibernation is to end; None unless it is a time as 3.0.1 writes it (section 6.2.3)."""
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
    """Actions to run at once, beside the order (section 7.4)."""

    actions: tuple[Action, ...]
