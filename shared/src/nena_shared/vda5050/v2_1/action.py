"""Actions of 2.1 (section 6.8) and their states (section 6.11)."""

from __future__ import annotations

from typing import Annotated, Final, Self

from pydantic import Field, JsonValue, ValidationInfo, field_serializer, model_validator

from nena_shared.vda5050.action import Action, ActionParameter, ActionState, ActionStatus, BlockingType
from nena_shared.vda5050.base import Identifier
from nena_shared.vda5050.wire_names import Absent, reads, writes

ActionTypeV21 = Annotated[
    Identifier,
    reads({"initPosition": "initializePosition"}),
    writes({"initializePosition": "initPosition"}),
]

BlockingTypeV21 = Annotated[BlockingType, writes({"SINGLE": "HARD"}, BlockingType)]
"""2.1 lacks SINGLE: HARD also keeps other actions away, and never allows more."""


TRIGGER: Final = ("waitForTrigger", "triggerType")
"""3.0 gives a list of triggers, 2.x a single one."""

CANCELLED_ORDER: Final = ("cancelOrder", "orderId")
"""In 2.x it is always the order that the robot has."""


class ActionV21(Action):
    """An action; 2.1 knows no retry, and some parameters otherwise."""

    action_type: ActionTypeV21
    action_descriptor: Annotated[str | None, Field(alias="actionDescription")] = None
    blocking_type: BlockingTypeV21
    retriable: Absent = None

    @model_validator(mode="after")
    def _read_trigger(self, info: ValidationInfo) -> Self:
        action_type, key = TRIGGER
        if self.action_type != action_type or info.mode != "json":
            return self
        parameters = tuple(
            each.model_copy(update={"value": [each.value]})
            if each.key == key and isinstance(each.value, str)
            else each
            for each in self.action_parameters
        )
        return self.model_copy(update={"action_parameters": parameters})

    @field_serializer("action_parameters", when_used="json")
    def _written_parameters(self, parameters: tuple[ActionParameter, ...]) -> tuple[ActionParameter, ...]:
        if self.action_type not in (TRIGGER[0], CANCELLED_ORDER[0]):
            return parameters
        return tuple(
            each.model_copy(update={"value": _first(each.value)})
            if (self.action_type, each.key) == TRIGGER
            else each
            for each in parameters
            if (self.action_type, each.key) != CANCELLED_ORDER
        )


def _first(value: JsonValue) -> JsonValue:
    return value[0] if isinstance(value, list) and value else value


class ActionStateV21(ActionState):
    """Where an action stands; one that waits for a retry is still running for a 2.1 fleet control."""

    action_type: ActionTypeV21 | None = None
    action_descriptor: Annotated[str | None, Field(alias="actionDescription")] = None
    action_status: Annotated[ActionStatus, writes({"RETRIABLE": "RUNNING"}, ActionStatus)]
    action_result: Annotated[str | None, Field(alias="resultDescription")] = None
