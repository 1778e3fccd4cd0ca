"""Peripheral devices such as doors and lifts, and their jobs: in the API and in messages of devices."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from nena_shared.fleet_api.base import CamelCase, Moment, ObjectName, OrderName, Request, Resource
from nena_shared.fleet_api.reasons import OptionalReason
from nena_shared.plant_terms import ExecutionTrigger

ReservationToken = Annotated[str, Field(min_length=1, max_length=200)]


class PeripheralState(StrEnum):
    """State of a peripheral device, with openTCS's names."""

    UNKNOWN = "UNKNOWN"
    """Not reported. Jobs are sent nevertheless."""
    UNAVAILABLE = "UNAVAILABLE"
    ERROR = "ERROR"
    IDLE = "IDLE"
    EXECUTING = "EXECUTING"

    @property
    def takes_jobs(self) -> bool:
        """Whether a device in this state is sent jobs."""
        return self not in (PeripheralState.UNAVAILABLE, PeripheralState.ERROR)


class PeripheralJobState(StrEnum):
    """State of a peripheral job, with openTCS's names."""

    TO_BE_PROCESSED = "TO_BE_PROCESSED"
    BEING_PROCESSED = "BEING_PROCESSED"
    """Sent to its device."""
    FINISHED = "FINISHED"
    FAILED = "FAILED"

    @property
    def final(self) -> bool:
        """Whether the job has ended."""
        return self in (PeripheralJobState.FINISHED, PeripheralJobState.FAILED)


class StepOperation(Request):
    """A peripheral operation that belongs to a destination of a transport order."""

    location: ObjectName
    """Location of the device."""
    operation: Annotated[str, Field(min_length=1, max_length=200)]
    execution_trigger: ExecutionTrigger = ExecutionTrigger.AFTER_ALLOCATION
    """AFTER_MOVEMENT: after the drive order, including the vehicle's own operation."""
    completion_required: bool = True
    """Whether the vehicle waits for the end of the operation."""


class PeripheralJobRequest(Request):
    """Request to create a peripheral job that belongs to no transport order."""

    name: OrderName | None = None
    """None: the order service makes one."""
    location: ObjectName
    operation: Annotated[str, Field(min_length=1, max_length=200)]
    reservation_token: ReservationToken
    """While a vehicle uses the device, only jobs with the vehicle's token are sent."""


class PeripheralJobStatus(Resource):
    """State of a peripheral job."""

    name: str
    state: PeripheralJobState
    reason: str = ""
    """What it waits for, or why it failed, as text."""
    coded_reason: OptionalReason = None
    location: str
    operation: str
    execution_trigger: ExecutionTrigger
    completion_required: bool
    reservation_token: str
    related_vehicle: str | None = None
    related_transport_order: str | None = None
    path: str | None = None
    """The path whose operation it is; None: that of a destination, or requested by a host."""
    created: Moment
    finished: Moment | None = None


class PeripheralStatus(Resource):
    """State of a peripheral device."""

    location: str
    state: PeripheralState
    operations: tuple[str, ...]
    """Operations that its location type and the paths name."""
    job: PeripheralJobStatus | None = None
    """The job that it executes."""
    waiting: tuple[str, ...] = ()
    """Names of the jobs that wait for it, in order."""
    used_by: tuple[str, ...] = ()
    """Vehicles that hold a part of their route for which the device is needed."""
    # 0052: so the panel shows why a job failed, also while the order service is down
    jobs: tuple[PeripheralJobStatus, ...] = ()
    """Its first unfinished jobs, at most 10, then the last ended ones, at most 5, newest first."""


class PeripheralList(Resource):
    """All peripheral devices."""

    peripherals: tuple[PeripheralStatus, ...]


class PeripheralJobsQuery(Request):
    """Filter and page of peripheral jobs."""

    location: ObjectName | None = None
    vehicle: ObjectName | None = None
    transport_order: OrderName | None = None
    state: Annotated[tuple[PeripheralJobState, ...], Field(max_length=4)] | None = None
    since: Moment | None = None
    """Only jobs created at this time or later."""
    until: Moment | None = None
    """Only jobs created before this time."""
    limit: Annotated[int, Field(ge=1, le=10_000)] = 10_000
    after: ObjectName | None = None
    """Value of ``next`` of the previous page."""


class PeripheralJobList(Resource):
    """A page of the unfinished peripheral jobs and the last ended ones, newest first."""

    peripheral_jobs: tuple[PeripheralJobStatus, ...]
    next: str | None = None
    """Value of ``after`` for the next page; None: this is the last one."""


class DeviceRequest(Resource):
    """Asks a device to execute an operation; sent again with the same ``jobId`` until it is acknowledged."""

    # 0052: without this, "sent" and "executed" could not be told apart after a crash
    job_id: str
    """A device that already has this job does not begin it again, but repeats its last answer."""
    operation: str
    execution_trigger: ExecutionTrigger
    completion_required: bool
    vehicle: str | None = None
    transport_order: str | None = None
    path: str | None = None
    timestamp: Moment


class DeviceCancellation(Resource):
    """Tells a device that a job is no longer needed."""

    job_id: str
    reason: str


class DeviceJobState(StrEnum):
    """A device's answer about a job."""

    ACKNOWLEDGED = "ACKNOWLEDGED"
    """The device has begun, or will."""
    FINISHED = "FINISHED"
    FAILED = "FAILED"


class DeviceAnswer(CamelCase):
    """A device's answer about a job; unknown fields are ignored."""

    job_id: str
    state: DeviceJobState
    reason: Annotated[str, Field(max_length=2000)] = ""


class DeviceReport(CamelCase):
    """A device's own state, which it publishes retained; its last will reports UNAVAILABLE."""

    state: PeripheralState
