"""All operations, and their table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from nena_shared.fleet_api.operations import (
    fleet,
    operation,
    orders,
    peripherals,
    plant,
    plant_drafts,
    schedules,
    sequences,
    vehicles,
)
from nena_shared.fleet_api.operations.fleet import *  # noqa: F403
from nena_shared.fleet_api.operations.operation import *  # noqa: F403
from nena_shared.fleet_api.operations.orders import *  # noqa: F403
from nena_shared.fleet_api.operations.peripherals import *  # noqa: F403
from nena_shared.fleet_api.operations.plant import *  # noqa: F403
from nena_shared.fleet_api.operations.plant_drafts import *  # noqa: F403
from nena_shared.fleet_api.operations.schedules import *  # noqa: F403
from nena_shared.fleet_api.operations.sequences import *  # noqa: F403
from nena_shared.fleet_api.operations.vehicles import *  # noqa: F403

OPERATIONS: Final[tuple[operation.Operation[Any], ...]] = tuple(
    entry
    for noun in (orders, sequences, schedules, vehicles, plant, plant_drafts, fleet, peripherals)
    for entry in vars(noun).values()
    if isinstance(entry, operation.Operation) and entry is not plant.CHANGE_PLANT
)
"""All operations that are served alike, in the order of their modules: all but the one whose body is a file.

A route that also matches another one's path comes after it.
"""

COMMANDS: Final[Mapping[str, operation.Operation[Any]]] = {
    entry.name: entry for entry in OPERATIONS if entry.result
}
"""Operations of MQTT commands, by name."""
