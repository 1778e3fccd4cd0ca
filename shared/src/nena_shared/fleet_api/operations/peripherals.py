"""Operations on peripheral devices and their jobs."""

from __future__ import annotations

from nena_shared.fleet_api.operations.operation import PERIPHERAL_JOBS, PERIPHERALS, Operation
from nena_shared.fleet_api.peripherals import (
    PeripheralJobList,
    PeripheralJobRequest,
    PeripheralJobsQuery,
    PeripheralJobStatus,
    PeripheralList,
    PeripheralStatus,
)
from nena_shared.fleet_api.refusals import Refusal

LIST_PERIPHERALS = Operation(
    "peripherals",
    "List the peripheral devices, such as doors, with the job that each executes.",
    "GET",
    PERIPHERALS,
    PeripheralList,
    result="peripherals",
)

SHOW_PERIPHERAL = Operation(
    "peripheral",
    "Return the peripheral device of a location.",
    "GET",
    f"{PERIPHERALS}/{{name:path}}",
    PeripheralStatus,
    result="peripheral",
    refusals=(Refusal.UNKNOWN_PERIPHERAL,),
)

LIST_JOBS = Operation(
    "peripheralJobs",
    "List the unfinished peripheral jobs and the last 1000 ended ones, newest first.",
    "GET",
    PERIPHERAL_JOBS,
    PeripheralJobList,
    request=PeripheralJobsQuery,
    refusals=(Refusal.UNKNOWN_JOB,),
    result="peripheral_jobs",
)

SHOW_JOB = Operation(
    "peripheralJob",
    "Return a peripheral job.",
    "GET",
    f"{PERIPHERAL_JOBS}/{{name}}",
    PeripheralJobStatus,
    result="peripheral_job",
    refusals=(Refusal.UNKNOWN_JOB,),
)

CREATE_JOB = Operation(
    "createPeripheralJob",
    "Create a peripheral job for no vehicle. It waits while a vehicle with another token uses the device.",
    "POST",
    PERIPHERAL_JOBS,
    PeripheralJobStatus,
    request=PeripheralJobRequest,
    creates=PERIPHERAL_JOBS,
    result="peripheral_job",
    refusals=(
        Refusal.NAME_TAKEN,
        Refusal.UNKNOWN_PERIPHERAL,
        Refusal.NOT_IN_PLANT,
        Refusal.NOT_SAVED,
    ),
)

WITHDRAW_JOB = Operation(
    "withdrawPeripheralJob",
    "Withdraw a peripheral job. Its device is told, and a vehicle that requires the job fails its drive.",
    "POST",
    f"{PERIPHERAL_JOBS}/{{name}}/withdrawal",
    PeripheralJobStatus,
    result="peripheral_job",
    refusals=(Refusal.UNKNOWN_JOB, Refusal.JOB_ENDED, Refusal.NOT_SAVED),
)
