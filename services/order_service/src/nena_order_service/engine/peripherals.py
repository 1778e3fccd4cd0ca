"""Peripheral jobs: request them along routes, send them to their devices, and let vehicles wait for them.

Everything here runs in the engine's units of work. A job is stored before its device is asked; after a
restart the device is asked again, with the same jobId. See decision 0052.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Protocol

from nena_order_service.engine.context import Context
from nena_order_service.fleet.vda_order import order_id
from nena_order_service.orders.transport_order import TransportOrder, sortable_id
from nena_order_service.orders.vda_orders import SentOrder
from nena_order_service.peripherals.devices import Devices, Verdict
from nena_order_service.peripherals.jobs import PeripheralJob
from nena_order_service.peripherals.needs import (
    DESTINATION,
    NOTHING,
    NeededOperation,
    NeedsFinder,
    RouteNeeds,
    devices_of,
)
from nena_order_service.traffic.manager import OPEN, Gate
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    DeviceCancellation,
    DeviceRequest,
    PeripheralJobRequest,
    PeripheralJobState,
    PeripheralJobStatus,
    PeripheralState,
    PeripheralStatus,
    StepOperation,
)
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.log import get_logger
from nena_shared.plant.track import ExecutionTrigger

log = get_logger(__name__)

T = ExecutionTrigger
JOB_PREFIX = "PeripheralJob"
NO_LONGER_NEEDED = "its vehicle no longer needs it"


class DevicePort(Protocol):
    """The line to peripheral devices; sending never waits."""

    def request(self, location: str, request: DeviceRequest) -> None:
        """Ask a device to execute a job."""
        ...

    def cancel(self, location: str, cancellation: DeviceCancellation) -> None:
        """Tell a device that a job is no longer needed."""
        ...


class NoDevices:
    """Reaches no device."""

    def request(self, location: str, request: DeviceRequest) -> None:
        """Do nothing."""

    def cancel(self, location: str, cancellation: DeviceCancellation) -> None:
        """Do nothing."""


class Peripherals:
    """Changes peripheral jobs, and decides how far they let vehicles drive."""

    def __init__(self, context: Context) -> None:
        self.port: DevicePort = NoDevices()
        self.waiting: dict[str, str] = {}
        """The jobs for which vehicles wait, by vehicle."""
        self.answers: Counter[str] = Counter()
        """Number of devices' answers by verdict."""
        self._context = context
        self._clock = context.clock
        self._state = context.state
        self._jobs = context.state.peripheral_jobs
        self._traffic = context.traffic
        settings = context.settings.peripherals
        self._operations = devices_of(context.plant) if settings.enabled else {}
        self._finder = NeedsFinder(context.plant, enabled=settings.enabled)
        self._devices = Devices(settings)
        for location in context.plant.locations:
            self._devices.expect(location)
        self._failed: list[PeripheralJob] = []
        self._last: dict[str, PeripheralJob] = {}
        """The job that each device has executed last."""

    # Vehicles on their routes

    def gate(self, vehicle: FleetVehicle, record: SentOrder | None) -> Gate:
        """Return how far a VDA order may be allocated and released; request its jobs that are due."""
        self.waiting.pop(vehicle.name, None)
        needs = self._needs(record)
        earlier = self._still_required(vehicle, record)
        if record is None or not (needs or earlier):
            return OPEN
        for operation in needs.at_once():
            self.require(operation, vehicle, record)
        return _RouteGate(self, vehicle, record, needs, earlier)

    def moved(
        self, vehicle: FleetVehicle, record: SentOrder, reached: int, *, finished: bool = False
    ) -> None:
        """Request the AFTER_MOVEMENT jobs of the first ``reached`` paths.

        ``finished``: also those of the destination.
        """
        for each in self._needs(record).operations:
            if each.trigger is T.AFTER_MOVEMENT:
                due = finished if each.key.step == DESTINATION else each.step < reached
                if due and self._jobs.at(each.key) is None:
                    self.require(each, vehicle, record)
                    self._state.drive_due = True

    def require(self, operation: NeededOperation, vehicle: FleetVehicle, record: SentOrder) -> PeripheralJob:
        """Return the job for an operation of a route, and create it if there is none yet."""
        job = self._jobs.at(operation.key)
        if job and not self._is_outdated(job):
            return job
        order = None if record.evasion else self._state.order_of(record.robot)
        status = PeripheralJobStatus(
            name=f"{JOB_PREFIX}-{sortable_id()}",
            state=PeripheralJobState.TO_BE_PROCESSED,
            location=operation.location,
            operation=operation.operation,
            execution_trigger=operation.trigger,
            completion_required=operation.required,
            reservation_token=self._token(vehicle, order),
            related_vehicle=vehicle.name,
            related_transport_order=order.name if order else None,
            path=operation.key.path or None,
            created=self._clock.now(),
        )
        key = operation.key
        return self._create(
            PeripheralJob(
                number=self._jobs.next_number(),
                status=status,
                order_id=key.order_id,
                step=key.step,
                place=key.place,
            )
        )

    def requested(self, operation: NeededOperation) -> PeripheralJob | None:
        """Return the job for an operation of a route; None if it was not requested yet."""
        return self._jobs.at(operation.key)

    def why(self, job: PeripheralJob) -> str:
        """Return what an unfinished job waits for, as the end of a sentence about its device."""
        status, location = job.status, job.status.location
        if job.over:
            return f"; {status.operation!r} has failed"
        if status.state is PeripheralJobState.BEING_PROCESSED:
            verb = "finish" if self._devices.acknowledged(location) else "acknowledge"
            return f"to {verb} {status.operation!r}"
        state, other = self._devices.state(location), self._devices.job(location)
        if not state.takes_jobs:
            return f"to execute {status.operation!r}; it reports {state}"
        running = self._jobs.named(other) if other else None
        if running:
            return f"to execute {status.operation!r} after {running.status.operation!r}"
        users = ", ".join(sorted(self._other_users(job)))
        return f"to execute {status.operation!r}" + (f"; {users} uses it" if users else "")

    def note(self, vehicle: str) -> str:
        """Return for which device a vehicle waits; empty if it waits for none."""
        job = self._jobs.named(self.waiting.get(vehicle, ""))
        if job is None:
            return ""
        return f"it waits for peripheral {job.status.location!r} {self.why(job)}"

    def location_waited_for(self, vehicle: str) -> str | None:
        """Return the location of the device for which a vehicle waits; None if it waits for none."""
        job = self._jobs.named(self.waiting.get(vehicle, ""))
        return job.status.location if job else None

    def withdraw_needless(self, unsent: Mapping[str, SentOrder]) -> None:
        """Withdraw the jobs that no route needs any more; ``unsent`` are routes by orderId, not sent yet."""
        for job in self._jobs.unfinished():
            if job.key and not job.after_movement and not self._is_needed(job, unsent):
                self._withdraw(job, NO_LONGER_NEEDED)
        self._jobs.forget_ended(lambda job: self._is_needed(job, unsent))

    def take_failed(self) -> list[PeripheralJob]:
        """Return the failed jobs on which vehicles depend, since the last call."""
        failed, self._failed = self._failed, []
        return failed

    # Hosts

    @property
    def locations(self) -> tuple[str, ...]:
        """The locations with a device."""
        return tuple(self._operations)

    def operations(self, location: str) -> tuple[str, ...] | None:
        """Return the operations of a device; None if the location has none."""
        return self._operations.get(location)

    def status(self, location: str) -> PeripheralStatus:
        """Return the state of a device."""
        name = self._devices.job(location)
        job = self._jobs.visible(name) if name else None
        waiting = [
            each.name
            for each in self._jobs.unfinished()
            if each.status.location == location and each.name != name
        ]
        return PeripheralStatus(
            location=location,
            state=self._devices.state(location),
            operations=self._operations.get(location, ()),
            job=self.job_status(job) if job else None,
            waiting=tuple(waiting),
        )

    def job_status(self, job: PeripheralJob) -> PeripheralJobStatus:
        """Return the state of a committed job, with what it waits for."""
        if job.over:
            return job.status
        return job.status.model_copy(update={"reason": f"waits for the device {self.why(job)}"})

    def create(self, request: PeripheralJobRequest, name: str) -> PeripheralJob:
        """Create the job that a host requests."""
        status = PeripheralJobStatus(
            name=name,
            state=PeripheralJobState.TO_BE_PROCESSED,
            location=request.location,
            operation=request.operation,
            execution_trigger=T.IMMEDIATE,
            completion_required=False,
            reservation_token=request.reservation_token,
            created=self._clock.now(),
        )
        job = self._create(PeripheralJob(number=self._jobs.next_number(), status=status))
        self.dispatch()
        return job

    def withdraw(self, name: str, reason: str) -> None:
        """Withdraw a job; does nothing if it has ended. Its vehicle fails if it needs the job."""
        job = self._jobs.named(name)
        if job and not job.over:
            self._fail(job, f"withdrawn: {reason}", cancel=True)
            self.dispatch()

    # Devices

    def dispatch(self) -> None:
        """Send each free device its next job: the oldest that may begin."""
        for job in self._jobs.unfinished():
            location = job.status.location
            waits = job.status.state is PeripheralJobState.TO_BE_PROCESSED
            if waits and self._devices.is_free(location) and self._may_begin(job):
                self._put(job.begun())
                self._devices.begin(location, job.name, self._clock.monotonic())
                self._ask(job)

    def restore(self, documents: Mapping[str, str]) -> None:
        """Restore jobs after a restart; those under way are sent again when the broker is connected."""
        self._jobs.load(documents)
        for job in self._jobs.all_visible()[::-1]:
            if job.done:
                self._last[job.status.location] = job
        for job in self._jobs.unfinished():
            if job.status.location not in self._operations:
                self._fail(job, "the plant model no longer has its device", cancel=True)
            elif job.status.state is PeripheralJobState.BEING_PROCESSED:
                self._devices.begin(job.status.location, job.name, self._clock.monotonic())

    def under_way(self) -> list[tuple[str, DeviceRequest]]:
        """Return the requests to send at a new connection to the broker: those of the jobs under way."""
        now = self._clock.now()
        self._devices.restart_times(self._clock.monotonic())
        running = PeripheralJobState.BEING_PROCESSED
        committed = [each for each in self._jobs.all_visible() if each.status.state is running]
        return [(each.status.location, each.request(now)) for each in committed]

    def answered(self, location: str, answer: DeviceAnswer) -> None:
        """Handle a device's answer."""
        job = self._jobs.named(answer.job_id)
        known = job is not None and job.status.location == location
        now = self._clock.monotonic()
        verdict = (
            self._devices.answer(location, answer.job_id, answer.state, now) if known else Verdict.IGNORED
        )
        self.answers[verdict.name.lower()] += 1
        if job is None or verdict is Verdict.IGNORED:
            state = job.status.state if job else "unknown"
            log.info(
                "answer ignored", peripheral=location, job=answer.job_id, answer=answer.state, state=state
            )
        elif verdict is Verdict.FINISHED:
            self._devices.end(location, job.name)
            job = job.finished(self._clock.now())
            self._last[location] = job
            self._put(job)
            log.info("peripheral job finished", job=job.name, peripheral=location)
        elif verdict is Verdict.FAILED:
            self._fail(job, answer.reason or "the device gives no reason")
        self._state.drive_due = True
        self._state.peripheral_changed(location)

    def reported(self, location: str, state: PeripheralState) -> None:
        """Handle a device's own state."""
        if location in self._operations and self._devices.report(location, state):
            log.info("peripheral reports its state", peripheral=location, state=state)
            self._state.drive_due = True
            self._state.peripheral_changed(location)

    def check_times(self) -> None:
        """Send jobs again that are not acknowledged, and fail those that are overdue."""
        now = self._clock.monotonic()
        if not self._context.fleet.connected_for():
            self._devices.restart_times(now)
            return
        for each in self._devices.overdue(now):
            job = self._jobs.named(each.job)
            if job is None:
                continue
            if each.reason:
                self._fail(job, each.reason, cancel=True)
            else:
                log.info("peripheral job sent again", job=job.name, peripheral=each.location)
                self._ask(job)

    def _create(self, job: PeripheralJob) -> PeripheralJob:
        self._put(job)
        status = job.status
        log.info(
            "peripheral job created",
            job=job.name,
            peripheral=status.location,
            operation=status.operation,
            trigger=status.execution_trigger,
            vehicle=status.related_vehicle,
        )
        return job

    def _put(self, job: PeripheralJob) -> None:
        self._jobs.put(job)
        self._state.peripheral_changed(job.status.location)

    def _ask(self, job: PeripheralJob) -> None:
        request = job.request(self._clock.now())
        self._state.after_commit(lambda: self.port.request(job.status.location, request))

    def _fail(self, job: PeripheralJob, reason: str, *, cancel: bool = False) -> None:
        """Fail a job, and the vehicle that depends on it; ``cancel``: its device may not know."""
        self._end_early(job, reason, cancel=cancel)
        if job.status.completion_required and job.key:
            self._failed.append(job.failed(reason, self._clock.now()))
        self._state.drive_due = True

    def _withdraw(self, job: PeripheralJob, reason: str) -> None:
        self._end_early(job, reason, cancel=True)

    def _end_early(self, job: PeripheralJob, reason: str, *, cancel: bool) -> None:
        location = job.status.location
        log.warning("peripheral job failed", job=job.name, peripheral=location, reason=reason)
        if cancel and job.status.state is PeripheralJobState.BEING_PROCESSED:
            cancellation = DeviceCancellation(job_id=job.name, reason=reason)
            self._state.after_commit(lambda: self.port.cancel(location, cancellation))
        self._devices.end(location, job.name)
        self._put(job.failed(reason, self._clock.now()))

    def _may_begin(self, job: PeripheralJob) -> bool:
        """Return whether no vehicle would be surprised: another one may be in the door right now."""
        return not self._other_users(job)

    def _other_users(self, job: PeripheralJob) -> list[str]:
        """Return the vehicles with other tokens that use the device of a job which must not disturb them."""
        status = job.status
        if status.execution_trigger in (T.AFTER_ALLOCATION, T.AFTER_MOVEMENT):
            return []
        return [
            name
            for name in self._traffic.holders(status.location) - {status.related_vehicle}
            if self._token_of(name) != status.reservation_token
        ]

    def _token_of(self, name: str) -> str:
        vehicle = self._context.registry.named(name)
        return self._token(vehicle, self._state.order_of(vehicle.key)) if vehicle else name

    @staticmethod
    def _token(vehicle: FleetVehicle, order: TransportOrder | None) -> str:
        own = order.status.peripheral_reservation_token if order else None
        return own or vehicle.name

    def _is_outdated(self, job: PeripheralJob) -> bool:
        """Return whether another vehicle's job has changed the device since a BEFORE_ALLOCATION job."""
        if job.status.execution_trigger is not T.BEFORE_ALLOCATION or not job.done:
            return False
        last = self._last.get(job.status.location)
        other = last is not None and last.order_id != job.order_id
        return other and last is not None and last.status.operation != job.status.operation

    def _still_required(self, vehicle: FleetVehicle, record: SentOrder | None) -> list[PeripheralJob]:
        """Return the jobs after earlier movements for which a vehicle has to wait before it drives again."""
        return [
            job
            for job in self._jobs.unfinished()
            if job.after_movement
            and job.status.completion_required
            and job.status.related_vehicle == vehicle.name
            and (record is None or job.order_id != record.vda_order.order_id)
        ]

    def _needs(self, record: SentOrder | None) -> RouteNeeds:
        if record is None or not self._operations:
            return NOTHING
        destination: tuple[StepOperation, ...] = ()
        order = self._state.order_of(record.robot)
        if order and record.drive_order_index is not None and not record.partial:
            drive_order = order.status.drive_orders[record.drive_order_index]
            destination = drive_order.destination.peripheral_operations
        vda_order = record.vda_order
        edges = [each.edge_id for each in vda_order.edges]
        return self._finder.of(vda_order.order_id, edges, destination, last=len(record.way) - 1)

    def _is_needed(self, job: PeripheralJob, unsent: Mapping[str, SentOrder]) -> bool:
        record = unsent.get(job.order_id) or self._state.sent_orders.find(job.order_id)
        if record:
            return not record.cancelled and job.key in self._needs(record).keys
        order = self._state.orders.named(job.status.related_transport_order or "")
        if order is None or order.state is not TransportOrderState.BEING_PROCESSED or order.held:
            return False
        return order_id(order.name, order.index, order.current.attempts) == job.order_id


class _RouteGate:
    """How far one vehicle may drive on its route, by the peripheral operations along it."""

    def __init__(
        self,
        peripherals: Peripherals,
        vehicle: FleetVehicle,
        record: SentOrder,
        needs: RouteNeeds,
        earlier: Iterable[PeripheralJob],
    ) -> None:
        self._peripherals = peripherals
        self._vehicle = vehicle
        self._record = record
        self._needs = needs
        self._earlier = tuple(earlier)

    def may_allocate(self, index: int) -> bool:
        """Return whether the jobs before the allocation of a set are done; -1: of a route without sets."""
        passed = [
            each
            for each in self._needs.operations
            if each.trigger is T.AFTER_MOVEMENT and each.required and each.step < index
        ]
        for job in self._earlier:
            self._wait(job)
        if self._earlier or not all(map(self._is_done, passed)):
            return False
        return self._all_done(self._needs.at(index, T.IMMEDIATE, T.BEFORE_ALLOCATION))

    def may_release(self, index: int) -> bool:
        """Return whether the jobs after the allocation of a set are done."""
        return self._all_done(self._needs.at(index, T.AFTER_ALLOCATION))

    def _all_done(self, operations: Iterable[NeededOperation]) -> bool:
        """Request the jobs of operations; return whether those are done that the vehicle waits for."""
        done = True
        for each in operations:
            job = self._peripherals.require(each, self._vehicle, self._record)
            if each.required and not job.done:
                done = False
                self._wait(job)
        return done

    def _is_done(self, operation: NeededOperation) -> bool:
        """Return whether the job after a movement is done; it is requested when the vehicle has arrived."""
        job = self._peripherals.requested(operation)
        if job and not job.over:
            self._wait(job)
        return job is not None and job.done

    def _wait(self, job: PeripheralJob) -> None:
        self._peripherals.waiting[self._vehicle.name] = job.name
