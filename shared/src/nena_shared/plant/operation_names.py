"""Operations of plant models, and the actions of VDA 5050 that do them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from nena_shared.plant.model import RECHARGE_OPERATION

ACTION_TYPES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Load cargo": "pick",
        "Load": "pick",
        "Unload cargo": "drop",
        "Unload": "drop",
        RECHARGE_OPERATION: "startCharging",
        "CHARGE": "startCharging",
    }
)
"""An operation that is not here is an action of the same name."""


def action_of(operation: str) -> str:
    """Return the action that does an operation."""
    return ACTION_TYPES.get(operation, operation)


def operation_of(action_type: str) -> str:
    """Return the operation for an action; only charging has one that everybody must know by its name."""
    return RECHARGE_OPERATION if action_type == ACTION_TYPES[RECHARGE_OPERATION] else action_type
