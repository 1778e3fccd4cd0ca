"""The instantActions message of 3.0 (sections 6.2.1 and 7.4)."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator

from nena_shared.vda5050.action import BlockingType, InstantActions
from nena_shared.vda5050.v3_0.action import ActionV30
from nena_shared.vda5050.wire_names import writes


class InstantActionV30(ActionV30):
    """An action to run at once: it blocks nothing, whatever is said."""

    blocking_type: Annotated[
        BlockingType,
        AfterValidator(lambda _: BlockingType.NONE),
        writes(dict.fromkeys(BlockingType, BlockingType.NONE), BlockingType),
    ]


class InstantActionsV30(InstantActions):
    """Actions to run at once."""

    actions: tuple[InstantActionV30, ...]
