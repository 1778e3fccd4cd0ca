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
from nena_order_service.engine.state import PeripheralJobs
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
        self.operations = devices_of(context.plant) if settings.enabled else {}
        """The operations of each device, by location."""
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

    def gate_for(self, vehicle: FleetVehicle, drive: Drive | None) -> Gate:
        """Return how far a VDA order may be allocated and released; request its jobs that are due."""
        self.waiting.pop(vehicle.name, None)
        needs = self._route_needs(drive)
        earlier = self.jobs_behind(vehicle, drive)
        if drive is None or not (needs or earlier):
            return OPEN
        for operation in needs.at_once():
            if self._jobs.at(operation.key) is None:
                self.require_job(operation, vehicle, drive)
        return _RouteGate(self, self._jobs, vehicle, drive, needs, earlier=earlier)

    def request_after_movement(
        self, vehicle: FleetVehicle, drive: Drive, reached: int, *, finished: bool = False
    ) -> None:
        """Request the AFTER_MOVEMENT jobs of the first ``reached`` paths.

        ``finished``: also those of the destination.
        """
        for operation in self._route_needs(drive).operations:
            if operation.trigger is T.AFTER_MOVEMENT:
                is_due = finished if operation.key.step == DESTINATION else operation.step < reached
                if is_due and self._jobs.at(operation.key) is None:
                    self.require_job(operation, vehicle, drive)
                    self._state.drive_due = True

    def require_job(self, operation: NeededOperation, vehicle: FleetVehicle, drive: Drive) -> PeripheralJob:
        """Return the job that an operation of a route waits for; create it unless there is a valid one."""
        job = self._jobs.at(operation.key)
        if job and (valid_job := self._valid_job(job, last_step=len(drive.way) - 1)):
            return valid_job
        order = None if drive.relocation else self._state.order_of(drive.robot)
        status = PeripheralJobStatus(
            name=f"{JOB_PREFIX}-{sortable_id()}",
            state=PeripheralJobState.TO_BE_PROCESSED,
            location=operation.location,
            operation=operation.operation,
            execution_trigger=operation.trigger,
            completion_required=operation.required,
            reservation_token=_reservation_token(vehicle.name, order),
            related_vehicle=vehicle.name,
            related_transport_order=order.name if order else None,
            path=operation.key.path or None,
            created=self._clock.now(),
        )
        key = operation.key
        return self._add_job(
            PeripheralJob(
                number=self._jobs.next_number(),
                status=status,
                order_id=key.order_id,
                step=key.step,
                place=key.place,
            )
        )

    def why_unfinished(self, job: PeripheralJob) -> Reason:
        """Return what an unfinished job waits for, as the end of a sentence about its device."""
        status, location = job.status, job.status.location
        state, current = self._devices.state(location), self._devices.job(location)
        awaited, reported = R.TO_EXECUTE, R.TO_EXECUTE_REPORTS
        if status.state is PeripheralJobState.BEING_PROCESSED:
            acknowledged = self._devices.acknowledged(location)
            awaited = R.TO_FINISH if acknowledged else R.TO_ACKNOWLEDGE
            reported = R.TO_FINISH_REPORTS if acknowledged else R.TO_ACKNOWLEDGE_REPORTS
        if not state.takes_jobs:
            return Reason(reported, operation=status.operation, reported=state)
        if current == job.name:
            return Reason(awaited, operation=status.operation)
        if running := self._jobs.named(current) if current else None:
            return Reason(R.TO_EXECUTE_AFTER, operation=status.operation, other=running.status.operation)
        if users := sorted(self._other_users(job)):
            return Reason(R.TO_EXECUTE_USED, operation=status.operation, vehicles=", ".join(users))
        return Reason(R.TO_EXECUTE, operation=status.operation)

    def job_awaited_by(self, vehicle: str) -> PeripheralJob | None:
        """Return the job for which a vehicle waits; None if it waits for none."""
        return self._jobs.named(self.waiting.get(vehicle, ""))

    def wait_reason(self, job: PeripheralJob) -> Reason:
        """Return that a vehicle waits for a job."""
        location, operation = job.status.location, job.status.operation
        if job.over:
            return Reason(R.PERIPHERAL_FAILED, location=location, operation=operation)
        return Reason(R.WAITS_FOR_PERIPHERAL, self.why_unfinished(job), location=location)

    def withdraw_unneeded(self) -> None:
        """Withdraw the jobs that no route needs any more."""
        if not self._jobs.any_known:
            return
        drives = {drive.order_id: drive for drive in self._state.drives.with_routes()}
        for job in self._jobs.unfinished():
            if job.key and not job.after_movement and not self._is_needed(job, drives):
                # Without the order's ID: if the vehicle needs the operation again, that is another job.
                released = job.model_copy(update={"order_id": ""})
                self._end_early(released, NO_LONGER_NEEDED, cancel=True)
        self._jobs.forget_ended(lambda job: self._is_needed(job, drives))

    def failed_job_behind(self, drive: Drive) -> PeripheralJob | None:
        """Return a required job after a movement of a VDA order that has failed; None if there is none."""
        required = (
            self._jobs.at(operation.key)
            for operation in self._route_needs(drive).operations
            if operation.required and operation.trigger is T.AFTER_MOVEMENT
        )
        return next((job for job in required if job and job.over and not job.done), None)

    def publish_users(self) -> None:
        """Publish the devices whose users have changed."""
        for location in self.operations:
            users = self._traffic.scheduler.holders_of(location)
            if users != self._users.get(location, frozenset()):
                self._users[location] = users
                self._state.peripheral_changed(location)

    def pop_failed_jobs(self) -> list[PeripheralJob]:
        """Return the failed jobs on which vehicles depend, since the last call."""
        failed, self._failed = self._failed, []
        return failed

    # Hosts

    def device_status(self, location: str) -> PeripheralStatus:
        """Return the state of a device."""
        name = self._devices.job(location)
        job = self._jobs.visible(name) if name else None
        waiting = [
            unfinished.name
            for unfinished in self._jobs.unfinished()
            if unfinished.status.location == location and unfinished.name != name
        ]
        # Of the jobs, the status has the newest ones: a host that needs others lists them.
        shown = [job for job in self._jobs.all_visible() if job.status.location == location]
        shown_unfinished = islice((job for job in reversed(shown) if not job.over), UNFINISHED_SHOWN)
        shown_ended = [job.status for job in shown if job.over]
        shown_ended.sort(key=lambda status: status.finished or status.created, reverse=True)
        return PeripheralStatus(
            location=location,
            state=self._devices.state(location),
            operations=self.operations.get(location, ()),
            job=self.job_status(job) if job else None,
            waiting=tuple(waiting),
            used_by=tuple(sorted(self._traffic.scheduler.holders_of(location))),
            jobs=(*map(self.job_status, shown_unfinished), *shown_ended[:ENDED_SHOWN]),
        )

    def job_status(self, job: PeripheralJob) -> PeripheralJobStatus:
        """Return the state of a committed job, with what it waits for."""
        if job.over:
            return job.status
        return job.status.model_copy(update=explained(Reason(R.DEVICE_WAITS, self.why_unfinished(job))))

    def create_job(self, request: PeripheralJobRequest, name: str) -> PeripheralJob:
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
        job = self._add_job(PeripheralJob(number=self._jobs.next_number(), status=status))
        self.send_next_jobs()
        return job

    def withdraw_job(self, name: str, reason: str) -> None:
        """Withdraw a job; does nothing if it has ended. Its vehicle fails if it needs the job."""
        job = self._jobs.named(name)
        if job and not job.over:
            self._fail_job(job, Reason(R.WITHDRAWN, reason), cancel=True)
            self.send_next_jobs()

    # Devices

    def send_next_jobs(self) -> None:
        """Send each free device its next job: the oldest that may begin, and first those after movements."""
        # A door is closed behind one vehicle before it is opened for the next one, never after that.
        for job in sorted(self._jobs.unfinished(), key=lambda job: not job.after_movement):
            location = job.status.location
            is_waiting = job.status.state is PeripheralJobState.TO_BE_PROCESSED
            if is_waiting and self._devices.is_free(location) and not self._other_users(job):
                self._last[location] = job
                self._put_job(job.begun())
                self._devices.begin(location, job.name, self._clock.monotonic())
                self._request_device(job)

    def restore(self, documents: Mapping[str, str]) -> None:
        """Restore jobs after a restart; those under way are sent again when the broker is connected."""
        self._jobs.load(documents)
        ended = [job for job in self._jobs.all_visible() if job.status.finished]
        for job in sorted(ended, key=lambda job: (job.status.finished, job.number)):
            self._last[job.status.location] = job
        for job in self._jobs.unfinished():
            if job.status.location not in self.operations:
                self._fail_job(job, Reason.of("the plant model no longer has its device"), cancel=True)
            elif job.status.state is PeripheralJobState.BEING_PROCESSED:
                self._last[job.status.location] = job
                self._devices.begin(job.status.location, job.name, self._clock.monotonic())

    def requests_under_way(self) -> list[tuple[str, DeviceRequest]]:
        """Return the requests to send at a new connection to the broker: those of the jobs under way."""
        now = self._clock.now()
        self._devices.restart_times(self._clock.monotonic())
        running = PeripheralJobState.BEING_PROCESSED
        committed = [job for job in self._jobs.all_visible() if job.status.state is running]
        return [(job.status.location, job.request(now)) for job in committed]

    def is_new_answer(self, location: str, answer: DeviceAnswer) -> bool:
        """Return whether a device's answer is new; others are counted, and change nothing."""
        if self._devices.awaits(location, answer.job_id, answer.state):
            return True
        job = self._jobs.named(answer.job_id)
        state = job.status.state if job else "unknown"
        log.info("answer ignored", peripheral=location, job=answer.job_id, answer=answer.state, state=state)
        self.answers[Verdict.IGNORED.name.lower()] += 1
        return False

    def on_answer(self, location: str, answer: DeviceAnswer) -> None:
        """Handle a device's answer that is new; see :meth:`is_new_answer`."""
        job = self._jobs.named(answer.job_id)
        verdict = self._devices.answer(location, answer.job_id, answer.state, self._clock.monotonic())
        self.answers[verdict.name.lower()] += 1
        if job is None:
            return
        if verdict is Verdict.FINISHED:
            self._devices.end(location, job.name)
            self._put_job(job.finished(self._clock.now()))
            log.info("peripheral job finished", job=job.name, peripheral=location)
        elif verdict is Verdict.FAILED:
            reason = Reason.of(answer.reason) if answer.reason else Reason(R.DEVICE_GIVES_NO_REASON)
            self._fail_job(job, reason)
        self._state.drive_due = True
        self._state.peripheral_changed(location)

    def is_new_state(self, location: str, state: PeripheralState) -> bool:
        """Return whether a device's own state is another one than before."""
        return location in self.operations and self._devices.reported(location) is not state

    def on_state(self, location: str, state: PeripheralState) -> None:
        """Handle a device's own state that is new; see :meth:`is_new_state`."""
        log.info("peripheral reports its state", peripheral=location, state=state)
        is_back = self._devices.report(location, state, self._clock.monotonic())
        job = self._jobs.named(self._devices.job(location) or "")
        if is_back and job:  # it may have restarted, and never have got the job
            self._request_device(job)
        self._state.drive_due = True
        self._state.peripheral_changed(location)

    def check_times(self) -> None:
        """Send jobs again that are not acknowledged, and fail those that are overdue."""
        now = self._clock.monotonic()
        if not self._context.fleet.connected_for():  # no device can answer without the broker
            self._devices.restart_times(now)
            return
        for overdue in self._devices.overdue(now):
            job = self._jobs.named(overdue.job)
            if job is None:
                continue
            if overdue.reason:
                self._fail_job(job, overdue.reason, cancel=True)
            else:
                log.info("peripheral job sent again", job=job.name, peripheral=overdue.location)
                self._request_device(job)

    def _add_job(self, job: PeripheralJob) -> PeripheralJob:
        self._put_job(job)
        status = job.status
        dispensable = [
            waiting
            for waiting in self._jobs.unfinished()
            if waiting.status.location == status.location
            and waiting.status.state is PeripheralJobState.TO_BE_PROCESSED
            and not waiting.status.completion_required
        ]
        for oldest in dispensable[:-MOST_WAITING]:
            self._end_early(oldest, Reason(R.JOBS_TOO_MANY, count=MOST_WAITING), cancel=False)
        log.info(
            "peripheral job created",
            job=job.name,
            peripheral=status.location,
            operation=status.operation,
            trigger=status.execution_trigger,
            vehicle=status.related_vehicle,
        )
        return job

    def _put_job(self, job: PeripheralJob) -> None:
        self._jobs.put(job)
        self._state.dispatch_due |= job.over and job.after_movement  # its vehicle may be paused for it
        last = self._last.get(job.status.location)
        if last and last.name == job.name:
            self._last[job.status.location] = job
        self._state.peripheral_changed(job.status.location)

    def _request_device(self, job: PeripheralJob) -> None:
        request = job.request(self._clock.now())
        for port in self.ports:
            self._state.after_commit(partial(port.request, job.status.location, request))

    def _fail_job(self, job: PeripheralJob, reason: Reason, *, cancel: bool = False) -> None:
        """Fail a job, and the vehicle that depends on it; ``cancel``: its device may not know."""
        self._end_early(job, reason, cancel=cancel)
        if job.status.completion_required and job.key:
            self._failed.append(job.failed(reason, self._clock.now()))
        self._state.drive_due = True

    def _end_early(self, job: PeripheralJob, reason: Reason, *, cancel: bool) -> None:
        location = job.status.location
        log.warning("peripheral job failed", job=job.name, peripheral=location, reason=str(reason))
        if cancel and job.status.state is PeripheralJobState.BEING_PROCESSED:
            cancellation = DeviceCancellation(job_id=job.name, reason=str(reason))
            for port in self.ports:
                self._state.after_commit(partial(port.cancel, location, cancellation))
        self._devices.end(location, job.name)
        self._put_job(job.failed(reason, self._clock.now()))

    def _other_users(self, job: PeripheralJob) -> list[str]:
        """Return the vehicles with other tokens for which a job has to wait: one may be in the door."""
        status = job.status
        others: list[str] = []
        for name in self._traffic.scheduler.holders_of(status.location) - {status.related_vehicle}:
            vehicle = self._context.registry.named(name)
            order = self._state.order_of(vehicle.key) if vehicle else None
            if _reservation_token(name, order) != status.reservation_token:
                others.append(name)
        return others

    def _valid_job(self, job: PeripheralJob, *, last_step: int) -> PeripheralJob | None:
        """Return the job that shows what became of an operation: this one, or a later one that repeats it.

        None if its device has been moved otherwise since it was done, or is about to be moved.
        """
        location, operation = job.status.location, job.status.operation
        last = self._last.get(location)
        if not job.done:
            return job
        if any(
            unfinished.after_movement
            and unfinished.status.location == location
            and unfinished.status.operation != operation
            and not self._other_users(unfinished)
            for unfinished in self._jobs.unfinished()
        ):
            return None  # for example, the door is about to be closed behind another vehicle
        if last is None or last.name == job.name:
            return job
        if last.status.operation == operation:
            return None if last.over and not last.done else last
        # Two operations of one step of a route may ask one device for different things: the first one stays
        # valid after the second one, otherwise each would repeat the other forever.
        steps = {last_step if step == DESTINATION else step for step in (job.step, last.step)}
        is_same_step = last.order_id == job.order_id and len(steps) == 1 and not last.after_movement
        return job if is_same_step else None

    def others_hold_device(self, vehicle: FleetVehicle, resources: Iterable[str]) -> bool:
        """Return whether other vehicles hold a device among these resources: they pass first."""
        return any(
            self._traffic.scheduler.holders_of(name) - {vehicle.name}
            for name in resources
            if name in self.operations
        )

    def jobs_behind(self, vehicle: FleetVehicle, drive: Drive | None = None) -> list[PeripheralJob]:
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

    def _route_needs(self, drive: Drive | None) -> RouteNeeds:
        if drive is None or not self.operations:
            return NOTHING
        destination: tuple[StepOperation, ...] = ()
        order = self._state.order_of(drive.robot)
        if order and drive.drive_order_index is not None and not drive.partial:
            drive_order = order.status.drive_orders[drive.drive_order_index]
            destination = drive_order.destination.peripheral_operations
        vda_order = drive.vda_order
        edges = [edge.edge_id for edge in vda_order.edges]
        return self._finder.of(vda_order.order_id, edges, destination, last=len(drive.way) - 1)

    def _is_needed(self, job: PeripheralJob, drives: Mapping[str, Drive]) -> bool:
        if drive := drives.get(job.order_id):
            return not drive.cancelled and job.key in self._route_needs(drive).keys
        order = self._state.orders.named(job.status.related_transport_order or "")
        if order is None or order.state is not TransportOrderState.BEING_PROCESSED or order.held:
            return False
        return order_id(order.name, order.index, order.current.attempts) == job.order_id


def _reservation_token(vehicle: str, order: TransportOrder | None) -> str:
    """Return what lets several vehicles use a device at once (openTCS: peripheral reservation token)."""
    own = order.status.peripheral_reservation_token if order else None
    return own or vehicle


class _RouteGate:
    """How far one vehicle may drive on its route, by the peripheral operations along it."""

    def __init__(
        self,
        peripherals: Peripherals,
        jobs: PeripheralJobs,
        vehicle: FleetVehicle,
        drive: Drive,
        needs: RouteNeeds,
        *,
        earlier: Iterable[PeripheralJob],
    ) -> None:
        self._peripherals = peripherals
        self._jobs = jobs
        self._vehicle = vehicle
        self._drive = drive
        self._needs = needs
        self._earlier = tuple(earlier)

    def may_allocate(self, index: int) -> bool:
        """Return whether the jobs before the allocation of a set are done; -1: of a route without sets."""
        for job in self._earlier:
            self._wait_for(job)
        if self._earlier or not all(map(self._is_behind, self._needs.before(index))):
            return False
        way = self._drive.way
        if way and self._peripherals.others_hold_device(self._vehicle, way[index].uses):
            # Traffic control refuses the set, naming that vehicle. Nothing is requested before it has left.
            return True
        return self._request_all(self._needs.at(index, T.IMMEDIATE, T.BEFORE_ALLOCATION))

    def may_release(self, index: int) -> bool:
        """Return whether the jobs after the allocation of a set are done."""
        return self._request_all(self._needs.at(index, T.AFTER_ALLOCATION))

    def _request_all(self, operations: Iterable[NeededOperation]) -> bool:
        """Request the jobs of operations; return whether those are done that the vehicle waits for."""
        all_done = True
        for operation in operations:  # also those behind one that is not done: devices work at the same time
            job = self._peripherals.require_job(operation, self._vehicle, self._drive)
            if operation.required and not job.done:
                all_done = False
                self._wait_for(job)
        return all_done

    def _is_behind(self, operation: NeededOperation) -> bool:
        """Return whether the vehicle has moved so far that a job was requested and, if required, is done."""
        job = self._jobs.at(operation.key)
        if job and operation.required and not job.over:
            self._wait_for(job)
        return job is not None and (job.done or not operation.required)

    def _wait_for(self, job: PeripheralJob) -> None:
        self._peripherals.waiting[self._vehicle.name] = job.name
