"""The instantActions message of 2.1 (section 6.9)."""

from __future__ import annotations

from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.v2_1.action import ActionV21
from nena_shared.vda5050.v2_1.base import TimestampV2


class InstantActionsV21(InstantActions):
    """Actions to run at once."""

    timestamp: TimestampV2
    actions: tuple[ActionV21, ...]
