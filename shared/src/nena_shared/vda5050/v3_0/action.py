"""Actions of 3.0 (sections 6.2.3 and 7.3)."""

from __future__ import annotations

from typing import Annotated

from nena_shared.vda5050.action import Action
from nena_shared.vda5050.base import Identifier
from nena_shared.vda5050.wire_names import reads

ActionTypeV30 = Annotated[Identifier, reads({"initPosition": "initializePosition"})]


class ActionV30(Action):
    """An action."""

    action_type: ActionTypeV30
