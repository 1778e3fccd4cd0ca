"""Requests of hosts about peripheral devices and their jobs."""

from __future__ import annotations

from itertools import dropwhile, islice

from nena_order_service.engine.engine import Engine
from nena_order_service.engine.peripherals import JOB_PREFIX
from nena_order_service.errors import (
    NameTakenError,
    PeripheralJobEndedError,
    UnknownPeripheralError,
    UnknownPeripheralJobError,
)
from nena_order_service.orders.transport_order import sortable_id
from nena_order_service.orders.validation import Finding, InvalidRequestError
from nena_order_service.peripherals.jobs import PeripheralJob
from nena_shared.fleet_api.peripherals import (
    PeripheralJobRequest,
    PeripheralJobsQuery,
    PeripheralJobStatus,
    PeripheralStatus,
)


class PeripheralRequests:
    """Executes requests about peripheral devices; changes are committed before the answer."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._peripherals = engine.peripherals
        self._jobs = engine.state.peripheral_jobs

    def devices(self) -> tuple[PeripheralStatus, ...]:
        """Return all devices."""
        return tuple(map(self._peripherals.status, self._peripherals.locations))

    def device(self, location: str) -> PeripheralStatus:
        """Return the device of a location; raises UnknownPeripheralError."""
        if self._peripherals.operations(location) is None:
            raise UnknownPeripheralError(location)
        return self._peripherals.status(location)

    def jobs(self, query: PeripheralJobsQuery) -> tuple[PeripheralJobStatus, ...]:
        """Return the jobs that fit the query, the newest first; one more than its limit if there are more.

        Raises:
            UnknownPeripheralJobError: there is no job with the name ``after``, or it is no longer in memory.

        """
        jobs = iter(self._jobs.all_visible())
        if query.after is not None:
            self.job(query.after)
            jobs = islice(dropwhile(lambda job: job.status.name != query.after, jobs), 1, None)
        fitting = (job for job in jobs if _fits(job, query))
        return tuple(map(self._peripherals.job_status, islice(fitting, query.limit + 1)))

    def job(self, name: str) -> PeripheralJobStatus:
        """Return a job; raises UnknownPeripheralJobError."""
        job = self._jobs.visible(name)
        if job is None:
            raise UnknownPeripheralJobError(name)
        return self._peripherals.job_status(job)

    async def create(self, request: PeripheralJobRequest) -> PeripheralJobStatus:
        """Create a job.

        Raises:
            UnknownPeripheralError: no device is at the location.
            InvalidRequestError: the device has no such operation.
            NameTakenError: a job has this name.
            StoreNotReadyError: the job may be lost.

        """
        possible = self._peripherals.operations(request.location)
        if possible is None:
            raise UnknownPeripheralError(request.location)
        if request.operation not in possible:
            text = (
                f"peripheral operation {request.operation!r} is not possible at {request.location!r}; "
                f"possible: {', '.join(possible)}."
            )
            raise InvalidRequestError([Finding(text)])
        name = request.name or f"{JOB_PREFIX}-{sortable_id()}"
        if self._jobs.named(name):
            raise NameTakenError(name, "Peripheral job")
        self._engine.unit_of_work.require_store()
        self._engine.create_peripheral_job(request, name)
        await self._engine.unit_of_work.wait_committed()
        return self.job(name)

    async def withdraw(self, name: str, reason: str) -> PeripheralJobStatus:
        """Withdraw a job.

        Raises:
            UnknownPeripheralJobError: no such job.
            PeripheralJobEndedError: it has ended.
            StoreNotReadyError: the change may be lost.

        """
        job = self._jobs.visible(name)
        if job is None:
            raise UnknownPeripheralJobError(name)
        if job.over:
            raise PeripheralJobEndedError(name, job.status.state)
        self._engine.unit_of_work.require_store()
        self._engine.withdraw_peripheral_job(name, reason)
        await self._engine.unit_of_work.wait_committed()
        return self.job(name)


def _fits(job: PeripheralJob, query: PeripheralJobsQuery) -> bool:
    status = job.status
    return (
        query.location in (None, status.location)
        and query.vehicle in (None, status.related_vehicle)
        and query.transport_order in (None, status.related_transport_order)
        and (query.state is None or status.state in query.state)
        and (query.since is None or status.created >= query.since)
        and (query.until is None or status.created < query.until)
    )
