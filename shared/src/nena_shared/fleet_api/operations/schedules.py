"""Operations on schedules."""

from __future__ import annotations

from http import HTTPStatus
from typing import Final

from nena_shared.fleet_api.operations.operation import SCHEDULES, Operation
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.schedules import ScheduleList, ScheduleRequest, ScheduleStatus, ScheduleSwitch

_CHANGE: Final = (Refusal.UNKNOWN_SCHEDULE, Refusal.NOT_SAVED)

LIST_SCHEDULES = Operation(
    "schedules",
    "List the schedules with their next and last runs, by name.",
    "GET",
    SCHEDULES,
    ScheduleList,
    result="schedules",
)
SHOW_SCHEDULE = Operation(
    "schedule",
    "Return a schedule with its next and last runs.",
    "GET",
    f"{SCHEDULES}/{{name}}",
    ScheduleStatus,
    result="schedule",
    refusals=(Refusal.UNKNOWN_SCHEDULE,),
)
PUT_SCHEDULE = Operation(
    "putSchedule",
    "Create a schedule, which creates transport orders at planned times, or replace its definition.",
    # 0057: PUT, so that clients may repeat it over a takeover without an idempotency key
    "PUT",
    f"{SCHEDULES}/{{name}}",
    ScheduleStatus,
    request=ScheduleRequest,
    also={HTTPStatus.CREATED: "Created."},
    result="schedule",
    refusals=(
        Refusal.INVALID_SCHEDULE,
        Refusal.NOT_IN_PLANT,
        Refusal.UNKNOWN_IN_PLANT,
        Refusal.TOO_MANY_SCHEDULES,
        Refusal.NOT_SAVED,
    ),
)
ENABLE_SCHEDULE = Operation(
    "enableSchedule",
    "Enable or disable a schedule. Runs that it misses while disabled are not caught up.",
    "PUT",
    f"{SCHEDULES}/{{name}}/enabled",
    ScheduleStatus,
    request=ScheduleSwitch,
    result="schedule",
    refusals=_CHANGE,
)
DELETE_SCHEDULE = Operation(
    "deleteSchedule",
    "Delete a schedule. The transport orders that it has created stay.",
    "DELETE",
    f"{SCHEDULES}/{{name}}",
    ScheduleStatus,
    result="schedule",
    refusals=_CHANGE,
)
