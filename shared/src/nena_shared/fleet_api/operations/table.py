"""All operations, and their table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from nena_shared.fleet_api.operations import (
    fleet,
    orders,
    peripherals,
    plant,
    schedules,
    sequences,
    vehicles,
)
from nena_shared.fleet_api.operations.fleet import (
    END_STOP,
    FETCH_RECORDING,
    LIST_AUDIT,
    LIST_STOPS,
    LIST_WEBHOOKS,
    SHOW_TRAFFIC_PLAN,
    STOP,
    SUMMARISE,
)
from nena_shared.fleet_api.operations.operation import PLANT_MODEL, Operation
from nena_shared.fleet_api.operations.orders import (
    ASSIGNMENT,
    CREATE_ORDER,
    CREATE_ORDERS,
    DELIVERY,
    HOLD,
    LIST_ORDERS,
    RESUME,
    SHOW_ORDER,
    WITHDRAW,
)
from nena_shared.fleet_api.operations.peripherals import (
    CREATE_JOB,
    LIST_JOBS,
    LIST_PERIPHERALS,
    SHOW_JOB,
    SHOW_PERIPHERAL,
    WITHDRAW_JOB,
)
from nena_shared.fleet_api.operations.plant import (
    CHANGE_PLANT,
    DELETE_ZONE_SET,
    ENABLE_ZONE_SET,
    LIST_LOCATIONS,
    LIST_PATHS,
    LIST_POINTS,
    LIST_ZONE_SETS,
    LOCK_PATH,
    PUT_ZONE_SET,
    SHOW_LOCATION,
    SHOW_PATH,
    SHOW_POINT,
    SHOW_ZONE_SET,
)
from nena_shared.fleet_api.operations.schedules import (
    DELETE_SCHEDULE,
    ENABLE_SCHEDULE,
    LIST_SCHEDULES,
    PUT_SCHEDULE,
    SHOW_SCHEDULE,
)
from nena_shared.fleet_api.operations.sequences import (
    COMPLETE_SEQUENCE,
    CREATE_SEQUENCE,
    LIST_SEQUENCES,
    SHOW_SEQUENCE,
)
from nena_shared.fleet_api.operations.vehicles import (
    DISPATCH,
    INSTANT_ACTION,
    INTEGRATION_LEVEL,
    LIST_VEHICLES,
    ORDER_TYPES,
    REROUTE,
    SHOW_VEHICLE,
)

OPERATIONS: Final[tuple[Operation[Any], ...]] = (
    *orders.OPERATIONS,
    *sequences.OPERATIONS,
    *schedules.OPERATIONS,
    *vehicles.OPERATIONS,
    *plant.OPERATIONS,
    *fleet.OPERATIONS,
    *peripherals.OPERATIONS,
)
"""All operations with generated routes. A route that also matches another one's path comes after it."""

COMMANDS: Final[Mapping[str, Operation[Any]]] = {each.name: each for each in OPERATIONS if each.result}
"""Operations of MQTT commands, by name."""

__all__ = [
    "ASSIGNMENT",
    "CHANGE_PLANT",
    "COMMANDS",
    "COMPLETE_SEQUENCE",
    "CREATE_JOB",
    "CREATE_ORDER",
    "CREATE_ORDERS",
    "CREATE_SEQUENCE",
    "DELETE_SCHEDULE",
    "DELETE_ZONE_SET",
    "DELIVERY",
    "DISPATCH",
    "ENABLE_SCHEDULE",
    "ENABLE_ZONE_SET",
    "END_STOP",
    "FETCH_RECORDING",
    "HOLD",
    "INSTANT_ACTION",
    "INTEGRATION_LEVEL",
    "LIST_AUDIT",
    "LIST_JOBS",
    "LIST_LOCATIONS",
    "LIST_ORDERS",
    "LIST_PATHS",
    "LIST_PERIPHERALS",
    "LIST_POINTS",
    "LIST_SCHEDULES",
    "LIST_SEQUENCES",
    "LIST_STOPS",
    "LIST_VEHICLES",
    "LIST_WEBHOOKS",
    "LIST_ZONE_SETS",
    "LOCK_PATH",
    "OPERATIONS",
    "ORDER_TYPES",
    "PLANT_MODEL",
    "PUT_SCHEDULE",
    "PUT_ZONE_SET",
    "REROUTE",
    "RESUME",
    "SHOW_JOB",
    "SHOW_LOCATION",
    "SHOW_ORDER",
    "SHOW_PATH",
    "SHOW_PERIPHERAL",
    "SHOW_POINT",
    "SHOW_SCHEDULE",
    "SHOW_SEQUENCE",
    "SHOW_TRAFFIC_PLAN",
    "SHOW_VEHICLE",
    "SHOW_ZONE_SET",
    "STOP",
    "SUMMARISE",
    "WITHDRAW",
    "WITHDRAW_JOB",
    "Operation",
]
