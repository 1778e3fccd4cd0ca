"""Actions of 2.1 (section 6.8) and their states (section 6.11)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.vda5050.action import Action, ActionState, ActionStatus, BlockingType
from nena_shared.vda5050.base import Identifier
from nena_shared.vda5050.v2_1.base import Absent, reads, writes

ActionTypeV21 = Annotated[
    Identifier,
    reads({"initPosition": "initializePosition"}),
    writes({"initializePosition": "initPosition"}),
]

BlockingTypeV21 = Annotated[BlockingType, writes({"SINGLE": "HARD"})]
"""2.1 lacks SINGLE: HARD also keeps other actions away, and never allows more."""


class ActionV21(Action):
    """An action; 2.1 knows no retry."""

    action_type: ActionTypeV21
    action_descriptor: Annotated[str | None, Field(alias="actionDescription")] = None
    blocking_type: BlockingTypeV21
    retriable: Absent = None


class ActionStateV21(ActionState):
    """Where an action stands; one that waits for a retry is still running for a 2.1 fleet control."""

    action_type: ActionTypeV21 | None = None
    action_descriptor: Annotated[str | None, Field(alias="actionDescription")] = None
    action_status: Annotated[ActionStatus, writes({"RETRIABLE": "RUNNING"})]
    action_result: Annotated[str | None, Field(alias="resultDescription")] = None
