"""Peripheral jobs: request them along routes, send them to their devices, and let vehicles wait for them.

Everything here runs in the engine's units of work. A job is stored before its device is asked; after a
restart the device is asked again, with the same jobId. See decision 0052.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import partial
from itertools import islice
from typing import Protocol

from nena_order_service.engine.context import Context
from nena_order_service.fleet.vda_order import order_id
from nena_order_service.orders.drive import Drive
from nena_order_service.orders.transport_order import TransportOrder, sortable_id
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
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.log import get_logger
from nena_shared.plant_terms import ExecutionTrigger

R = ReasonCode

log = get_logger(__name__)

T = ExecutionTrigger
JOB_PREFIX = "PeripheralJob"
MOST_WAITING = 100
"""Maximum number of jobs for which no vehicle waits, of each device; the oldest ones fail beyond it."""
UNFINISHED_SHOWN, ENDED_SHOWN = 10, 5
"""Maximum numbers of jobs in a device's status."""
NO_LONGER_NEEDED = Reason(R.JOB_NEEDLESS)


class DevicePort(Protocol):
    """The line to peripheral devices; sending never waits."""

    def request(self, location: str, request: DeviceRequest) -> None:
        """Ask a device to execute a job."""
        ...

    def cancel(self, location: str, cancellation: DeviceCancellation) -> None:
        """Tell a device that a job is no longer needed."""
        ...


class Peripherals:
    """Changes peripheral jobs, and decides how far they let vehicles drive."""

    def __init__(self, context: Context) -> None:
        self.ports: list[DevicePort] = []
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
        self._users: dict[str, frozenset[str]] = {}
        """The vehicles that hold each device, as published."""
        self._last: dict[str, PeripheralJob] = {}
        """The job that each device was sent last: its state is what this job made of it."""

    # Vehicles on their routes

    def gate(self, vehicle: FleetVehicle, drive: Drive | None) -> Gate:
        """Return how far a VDA order may be allocated and released; request its jobs that are due."""
        self.waiting.pop(vehicle.name, None)
        needs = self._needs(drive)
        earlier = self.behind(vehicle, drive)
        if drive is None or not (needs or earlier):
            return OPEN
        for operation in needs.at_once():
            if self.requested(operation) is None:
                self.require(operation, vehicle, drive)
        return _RouteGate(self, vehicle, drive, needs, earlier)

    def moved(self, vehicle: FleetVehicle, drive: Drive, reached: int, *, finished: bool = False) -> None:
        """Request the AFTER_MOVEMENT jobs of the first ``reached`` paths.

        ``finished``: also those of the destination.
        """
        for each in self._needs(drive).operations:
            if each.trigger is T.AFTER_MOVEMENT:
                due = finished if each.key.step == DESTINATION else each.step < reached
                if due and self._jobs.at(each.key) is None:
                    self.require(each, vehicle, drive)
                    self._state.drive_due = True

    def require(self, operation: NeededOperation, vehicle: FleetVehicle, drive: Drive) -> PeripheralJob:
        """Return the job that an operation of a route waits for; create it unless there is a valid one."""
        job = self._jobs.at(operation.key)
        if job and (valid := self._valid(job, last_step=len(drive.way) - 1)):
            return valid
        order = None if drive.relocation else self._state.order_of(drive.robot)
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

    def why(self, job: PeripheralJob) -> Reason:
        """Return what an unfinished job waits for, as the end of a sentence about its device."""
        status, location = job.status, job.status.location
        state, other = self._devices.state(location), self._devices.job(location)
        awaited, reported = R.TO_EXECUTE, R.TO_EXECUTE_REPORTS
        if status.state is PeripheralJobState.BEING_PROCESSED:
            acknowledged = self._devices.acknowledged(location)
            awaited = R.TO_FINISH if acknowledged else R.TO_ACKNOWLEDGE
            reported = R.TO_FINISH_REPORTS if acknowledged else R.TO_ACKNOWLEDGE_REPORTS
        if not state.takes_jobs:
            return Reason(reported, operation=status.operation, reported=state)
        if other == job.name:
            return Reason(awaited, operation=status.operation)
        if running := self._jobs.named(other) if other else None:
            return Reason(R.TO_EXECUTE_AFTER, operation=status.operation, other=running.status.operation)
        if users := sorted(self._other_users(job)):
            return Reason(R.TO_EXECUTE_USED, operation=status.operation, vehicles=", ".join(users))
        return Reason(R.TO_EXECUTE, operation=status.operation)

    def note(self, vehicle: str) -> Reason | None:
        """Return for which device a vehicle waits; None if it waits for none."""
        job = self._jobs.named(self.waiting.get(vehicle, ""))
        return self.wait_for(job) if job else None

    def wait_for(self, job: PeripheralJob) -> Reason:
        """Return that a vehicle waits for a job."""
        location, operation = job.status.location, job.status.operation
        if job.over:
            return Reason(R.PERIPHERAL_FAILED, location=location, operation=operation)
        return Reason(R.WAITS_FOR_PERIPHERAL, self.why(job), location=location)

    def location_waited_for(self, vehicle: str) -> str | None:
        """Return the location of the device for which a vehicle waits; None if it waits for none."""
        job = self._jobs.named(self.waiting.get(vehicle, ""))
        return job.status.location if job else None

    def withdraw_needless(self) -> None:
        """Withdraw the jobs that no route needs any more."""
        if not self._jobs.any_known:
            return
        drives = {each.order_id: each for each in self._state.drives.with_routes()}
        for job in self._jobs.unfinished():
            if job.key and not job.after_movement and not self._is_needed(job, drives):
                self._withdraw(job, NO_LONGER_NEEDED)
        self._jobs.forget_ended(lambda job: self._is_needed(job, drives))

    def failed_behind(self, drive: Drive) -> PeripheralJob | None:
        """Return a required job after a movement of a VDA order that has failed; None if there is none."""
        required = (
            self.requested(each)
            for each in self._needs(drive).operations
            if each.required and each.trigger is T.AFTER_MOVEMENT
        )
        return next((job for job in required if job and job.over and not job.done), None)

    def note_users(self) -> None:
        """Publish the devices whose users have changed."""
        for location in self._operations:
            users = self._traffic.holders(location)
            if users != self._users.get(location, frozenset()):
                self._users[location] = users
                self._state.peripheral_changed(location)

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
            used_by=tuple(sorted(self._traffic.holders(location))),
            jobs=self._shown_jobs(location),
        )

    def job_status(self, job: PeripheralJob) -> PeripheralJobStatus:
        """Return the state of a committed job, with what it waits for."""
        if job.over:
            return job.status
        return job.status.model_copy(update=explained(Reason(R.DEVICE_WAITS, self.why(job))))

    def _shown_jobs(self, location: str) -> tuple[PeripheralJobStatus, ...]:
        """Return the committed jobs of a device that its status has."""
        own = [job for job in self._jobs.all_visible() if job.status.location == location]
        ended = [job.status for job in own if job.over]
        ended.sort(key=lambda each: each.finished or each.created, reverse=True)
        unfinished = islice((job for job in reversed(own) if not job.over), UNFINISHED_SHOWN)
        return (*map(self.job_status, unfinished), *ended[:ENDED_SHOWN])

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
            self._fail(job, Reason(R.WITHDRAWN, reason), cancel=True)
            self.dispatch()

    # Devices

    def dispatch(self) -> None:
        """Send each free device its next job: the oldest that may begin, and first those after movements.

        A door is closed behind one vehicle before it is opened for the next one, never after that.
        """
        for job in sorted(self._jobs.unfinished(), key=lambda job: not job.after_movement):
            location = job.status.location
            waits = job.status.state is PeripheralJobState.TO_BE_PROCESSED
            if waits and self._devices.is_free(location) and not self._other_users(job):
                self._last[location] = job
                self._put(job.begun())
                self._devices.begin(location, job.name, self._clock.monotonic())
                self._ask(job)

    def restore(self, documents: Mapping[str, str]) -> None:
        """Restore jobs after a restart; those under way are sent again when the broker is connected."""
        self._jobs.load(documents)
        ended = [job for job in self._jobs.all_visible() if job.status.finished]
        for job in sorted(ended, key=lambda job: (job.status.finished, job.number)):
            self._last[job.status.location] = job
        for job in self._jobs.unfinished():
            if job.status.location not in self._operations:
                self._fail(job, Reason.of("the plant model no longer has its device"), cancel=True)
            elif job.status.state is PeripheralJobState.BEING_PROCESSED:
                self._last[job.status.location] = job
                self._devices.begin(job.status.location, job.name, self._clock.monotonic())

    def under_way(self) -> list[tuple[str, DeviceRequest]]:
        """Return the requests to send at a new connection to the broker: those of the jobs under way."""
        now = self._clock.now()
        self._devices.restart_times(self._clock.monotonic())
        running = PeripheralJobState.BEING_PROCESSED
        committed = [each for each in self._jobs.all_visible() if each.status.state is running]
        return [(each.status.location, each.request(now)) for each in committed]

    def awaits(self, location: str, answer: DeviceAnswer) -> bool:
        """Return whether a device's answer is new; others are counted, and change nothing."""
        if self._devices.awaits(location, answer.job_id, answer.state):
            return True
        job = self._jobs.named(answer.job_id)
        state = job.status.state if job else "unknown"
        log.info("answer ignored", peripheral=location, job=answer.job_id, answer=answer.state, state=state)
        self.answers[Verdict.IGNORED.name.lower()] += 1
        return False

    def answered(self, location: str, answer: DeviceAnswer) -> None:
        """Handle a device's answer that is new; see :meth:`awaits`."""
        job = self._jobs.named(answer.job_id)
        now = self._clock.monotonic()
        verdict = self._devices.answer(location, answer.job_id, answer.state, now)
        self.answers[verdict.name.lower()] += 1
        if job is None:
            return
        if verdict is Verdict.FINISHED:
            self._devices.end(location, job.name)
            self._put(job.finished(self._clock.now()))
            log.info("peripheral job finished", job=job.name, peripheral=location)
        elif verdict is Verdict.FAILED:
            words = answer.reason
            self._fail(job, Reason.of(words) if words else Reason(R.DEVICE_GIVES_NO_REASON))
        self._state.drive_due = True
        self._state.peripheral_changed(location)

    def is_news(self, location: str, state: PeripheralState) -> bool:
        """Return whether a device's own state is another one than before."""
        return location in self._operations and self._devices.reported(location) is not state

    def reported(self, location: str, state: PeripheralState) -> None:
        """Handle a device's own state that is new; see :meth:`is_news`."""
        log.info("peripheral reports its state", peripheral=location, state=state)
        back = self._devices.report(location, state, self._clock.monotonic())
        job = self._jobs.named(self._devices.job(location) or "")
        if back and job:
            self._ask(job)
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
        dispensable = [
            each
            for each in self._jobs.unfinished()
            if each.status.location == status.location
            and each.status.state is PeripheralJobState.TO_BE_PROCESSED
            and not each.status.completion_required
        ]
        for each in dispensable[:-MOST_WAITING]:
            self._end_early(each, Reason(R.JOBS_TOO_MANY, count=MOST_WAITING), cancel=False)
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
        self._state.dispatch_due |= job.over and job.after_movement  # its vehicle may be paused for it
        last = self._last.get(job.status.location)
        if last and last.name == job.name:
            self._last[job.status.location] = job
        self._state.peripheral_changed(job.status.location)

    def _ask(self, job: PeripheralJob) -> None:
        request = job.request(self._clock.now())
        for port in self.ports:
            self._state.after_commit(partial(port.request, job.status.location, request))

    def _fail(self, job: PeripheralJob, reason: Reason, *, cancel: bool = False) -> None:
        """Fail a job, and the vehicle that depends on it; ``cancel``: its device may not know."""
        self._end_early(job, reason, cancel=cancel)
        if job.status.completion_required and job.key:
            self._failed.append(job.failed(reason, self._clock.now()))
        self._state.drive_due = True

    def _withdraw(self, job: PeripheralJob, reason: Reason) -> None:
        """End a job of which its vehicle has let go; if it needs the operation again, that is another job."""
        self._end_early(job.model_copy(update={"order_id": ""}), reason, cancel=True)

    def _end_early(self, job: PeripheralJob, reason: Reason, *, cancel: bool) -> None:
        location = job.status.location
        log.warning("peripheral job failed", job=job.name, peripheral=location, reason=str(reason))
        if cancel and job.status.state is PeripheralJobState.BEING_PROCESSED:
            cancellation = DeviceCancellation(job_id=job.name, reason=str(reason))
            for port in self.ports:
                self._state.after_commit(partial(port.cancel, location, cancellation))
        self._devices.end(location, job.name)
        self._put(job.failed(reason, self._clock.now()))

    def _other_users(self, job: PeripheralJob) -> list[str]:
        """Return the vehicles with other tokens for which a job has to wait: one may be in the door."""
        status = job.status
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

    def _valid(self, job: PeripheralJob, *, last_step: int) -> PeripheralJob | None:
        """Return the job that shows what became of an operation: this one, or a later one that repeats it.

        None if its device has been moved otherwise since it was done, or is about to be moved.
        """
        location, operation = job.status.location, job.status.operation
        last = self._last.get(location)
        if not job.done:
            return job
        if any(
            each.after_movement
            and each.status.location == location
            and each.status.operation != operation
            and not self._other_users(each)
            for each in self._jobs.unfinished()
        ):
            return None
        if last is None or last.name == job.name:
            return job
        if last.status.operation == operation:
            return None if last.over and not last.done else last
        steps = {last_step if step == DESTINATION else step for step in (job.step, last.step)}
        together = last.order_id == job.order_id and len(steps) == 1 and not last.after_movement
        return job if together else None

    def hold_back(self, vehicle: FleetVehicle, resources: Iterable[str]) -> bool:
        """Return whether other vehicles hold a device among these resources: they pass first."""
        return any(
            self._traffic.holders(each) - {vehicle.name} for each in resources if each in self._operations
        )

    def behind(self, vehicle: FleetVehicle, drive: Drive | None = None) -> list[PeripheralJob]:
        """Return the jobs after earlier movements for which a vehicle has to wait before it drives again.

        ``drive`` is the one that it is on.
        """
        return [
            job
            for job in self._jobs.unfinished()
            if job.after_movement
            and job.status.completion_required
            and job.status.related_vehicle == vehicle.name
            and (drive is None or job.order_id != drive.order_id)
        ]

    def _needs(self, drive: Drive | None) -> RouteNeeds:
        if drive is None or not self._operations:
            return NOTHING
        destination: tuple[StepOperation, ...] = ()
        order = self._state.order_of(drive.robot)
        if order and drive.drive_order_index is not None and not drive.partial:
            drive_order = order.status.drive_orders[drive.drive_order_index]
            destination = drive_order.destination.peripheral_operations
        vda_order = drive.vda_order
        edges = [each.edge_id for each in vda_order.edges]
        return self._finder.of(vda_order.order_id, edges, destination, last=len(drive.way) - 1)

    def _is_needed(self, job: PeripheralJob, drives: Mapping[str, Drive]) -> bool:
        if drive := drives.get(job.order_id):
            return not drive.cancelled and job.key in self._needs(drive).keys
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
        drive: Drive,
        needs: RouteNeeds,
        earlier: Iterable[PeripheralJob],
    ) -> None:
        self._peripherals = peripherals
        self._vehicle = vehicle
        self._drive = drive
        self._needs = needs
        self._earlier = tuple(earlier)

    def may_allocate(self, index: int) -> bool:
        """Return whether the jobs before the allocation of a set are done; -1: of a route without sets.

        Also True if another vehicle holds a device of the set: traffic control then refuses it, and names
        that vehicle. Nothing is requested before it has left.
        """
        for job in self._earlier:
            self._wait(job)
        if self._earlier or not all(map(self._is_behind, self._needs.before(index))):
            return False
        way = self._drive.way
        if way and self._peripherals.hold_back(self._vehicle, way[index].uses):
            return True
        return self._all_done(self._needs.at(index, T.IMMEDIATE, T.BEFORE_ALLOCATION))

    def may_release(self, index: int) -> bool:
        """Return whether the jobs after the allocation of a set are done."""
        return self._all_done(self._needs.at(index, T.AFTER_ALLOCATION))

    def _all_done(self, operations: Iterable[NeededOperation]) -> bool:
        """Request the jobs of operations; return whether those are done that the vehicle waits for."""
        done = True
        for each in operations:
            job = self._peripherals.require(each, self._vehicle, self._drive)
            if each.required and not job.done:
                done = False
                self._wait(job)
        return done

    def _is_behind(self, operation: NeededOperation) -> bool:
        """Return whether the vehicle has moved so far that a job was requested and, if required, is done."""
        job = self._peripherals.requested(operation)
        if job and operation.required and not job.over:
            self._wait(job)
        return job is not None and (job.done or not operation.required)

    def _wait(self, job: PeripheralJob) -> None:
        self._peripherals.waiting[self._vehicle.name] = job.name
