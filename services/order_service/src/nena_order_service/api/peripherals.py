"""Peripheral devices and their jobs: operations of hosts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import dropwhile, islice

from nena_order_service.api.operations import Handler, page_of
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.peripherals import JOB_PREFIX
from nena_order_service.errors import NameTakenError, RefusedError, UnknownError
from nena_order_service.orders.transport_order import sortable_id
from nena_order_service.orders.validation import Finding, InvalidRequestError
from nena_order_service.peripherals.jobs import PeripheralJob
from nena_shared.fleet_api.operations import peripherals as table
from nena_shared.fleet_api.peripherals import (
    PeripheralJobList,
    PeripheralJobRequest,
    PeripheralJobsQuery,
    PeripheralJobStatus,
    PeripheralList,
    PeripheralStatus,
)
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.refusals import Refusal


class PeripheralOperations:
    """Executes requests about peripheral devices."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._peripherals = engine.peripherals
        self._jobs = engine.state.peripheral_jobs

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        yield Handler(table.LIST_PERIPHERALS, self.list_devices)
        yield Handler(table.SHOW_PERIPHERAL, self.find_status)
        yield Handler(table.LIST_JOBS, self.list_jobs)
        yield Handler(table.SHOW_JOB, self.find_job)
        example = {"location": "Door 1", "operation": "open", "reservationToken": "host"}
        yield Handler(table.CREATE_JOB, self.create_job, example)
        yield Handler(table.WITHDRAW_JOB, lambda name, caller: self.withdraw_job(name, f"by {caller}"))

    def list_devices(self) -> PeripheralList:
        """Return all devices."""
        return PeripheralList(
            peripherals=tuple(map(self._peripherals.device_status, self._peripherals.operations))
        )

    def find_status(self, name: str) -> PeripheralStatus:
        """Return the device of a location; raises UnknownError."""
        if name not in self._peripherals.operations:
            raise UnknownError(Refusal.UNKNOWN_PERIPHERAL, name)
        return self._peripherals.device_status(name)

    def list_jobs(self, request: PeripheralJobsQuery) -> PeripheralJobList:
        """Return a page of jobs, the newest first.

        Raises:
            UnknownError: there is no job with the name ``after``, or it is no longer in memory.
        """
        jobs = iter(self._jobs.all_visible())
        if request.after is not None:
            self.find_job(request.after)
            jobs = islice(dropwhile(lambda job: job.status.name != request.after, jobs), 1, None)
        statuses = (self._peripherals.job_status(job) for job in jobs if _fits_query(job, request))
        page, following = page_of(statuses, request.limit)
        return PeripheralJobList(peripheral_jobs=page, next=following)

    def find_job(self, name: str) -> PeripheralJobStatus:
        """Return a job; raises UnknownError."""
        return self._peripherals.job_status(self._visible_job(name))

    async def create_job(self, request: PeripheralJobRequest) -> PeripheralJobStatus:
        """Create a job.

        Raises:
            UnknownError: no device is at the location.
            InvalidRequestError: the device has no such operation.
            NameTakenError: a job has this name.
        """
        possible = self._peripherals.operations.get(request.location)
        if possible is None:
            raise UnknownError(Refusal.UNKNOWN_PERIPHERAL, request.location)
        if request.operation not in possible:
            text = (
                f"peripheral operation {request.operation!r} is not possible at {request.location!r}; "
                f"possible: {', '.join(possible)}."
            )
            raise InvalidRequestError([Finding(Reason.of(text))])
        name = request.name or f"{JOB_PREFIX}-{sortable_id()}"
        if self._jobs.named(name):
            raise NameTakenError(name, "Peripheral job")
        async with self._engine.unit_of_work.saved():
            self._engine.create_peripheral_job(request, name)
        return self.find_job(name)

    async def withdraw_job(self, name: str, reason: str) -> PeripheralJobStatus:
        """Withdraw a job; raises UnknownError or RefusedError."""
        job = self._visible_job(name)
        if job.over:
            text = f"Peripheral job {name!r} is already {job.status.state} and cannot be withdrawn."
            raise RefusedError(Refusal.JOB_ENDED, text)
        async with self._engine.unit_of_work.saved():
            self._engine.withdraw_peripheral_job(name, reason)
        return self.find_job(name)

    def _visible_job(self, name: str) -> PeripheralJob:
        job = self._jobs.visible(name)
        if job is None:
            raise UnknownError(Refusal.UNKNOWN_JOB, name)
        return job


def _fits_query(job: PeripheralJob, query: PeripheralJobsQuery) -> bool:
    status = job.status
    return (
        query.location in (None, status.location)
        and query.vehicle in (None, status.related_vehicle)
        and query.transport_order in (None, status.related_transport_order)
        and (query.state is None or status.state in query.state)
        and (query.since is None or status.created >= query.since)
        and (query.until is None or status.created < query.until)
    )
