"""The state of the order service: orders, sequences, vehicles, peripheral jobs, and pending changes.

Plain data with small queries. Only the engine's flows change it, in a unit of work; each change is recorded
in :class:`PendingChanges`, which the engine commits, then publishes and sends.
"""

from __future__ import annotations

import asyncio
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import chain

from pydantic import ValidationError

from nena_order_service.dispatching.candidates import WaitingOrders
from nena_order_service.fleet.outputs import FleetOutput, InstantActionEnded
from nena_order_service.orders.drive import Drive, DriveState
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.statistics import OrderStatistics
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.peripherals.jobs import JobKey, PeripheralJob
from nena_order_service.store.database import Changes, DriveRow
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.fleet_api.reasons import OptionalReason
from nena_shared.fleet_api.stops import SetBy
from nena_shared.fleet_api.vehicle import AcceptableOrderType, IntegrationLevel
from nena_shared.frozen_model import FrozenModel
from nena_shared.log import get_logger
from nena_shared.vda5050.malformed import problems_of
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

RECENT_LIMIT = 1000
"""Number of ended orders kept in memory; older ones are only in the store."""

Effect = Callable[[], FleetOutput | None]
"""An action to run after the commit, such as sending a message; may return a resulting event."""


@dataclass(slots=True)
class PendingChanges:
    """The changes of a unit of work, which are committed together, then published and sent."""

    stored: Changes = field(default_factory=Changes)
    orders: list[TransportOrder] = field(default_factory=list)
    """Versions to publish; of consecutive versions of an order in the same state, only the last."""
    sequences: list[OrderSequence] = field(default_factory=list)
    jobs: list[PeripheralJob] = field(default_factory=list)
    vehicles: set[str] = field(default_factory=set)
    peripherals: set[str] = field(default_factory=set)
    """Locations whose devices have changed."""
    effects: list[Effect] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.stored or self.effects or self.vehicles or self.peripherals)

    def take(self) -> PendingChanges:
        """Return the changes so far, and reset them."""
        # Reset in place, because orders, sequences and others hold this object.
        taken = PendingChanges(*map(self.__getattribute__, self.__slots__))
        PendingChanges.__init__(self)
        return taken


class Orders:
    """Transport orders in memory: the unfinished and the last ended ones, in current and committed versions.

    Only committed versions may be shown to hosts.
    """

    def __init__(self, pending: PendingChanges) -> None:
        self.last_number = 0
        """The highest order number in the store."""
        self.waiting = WaitingOrders()
        self.statistics = OrderStatistics()
        self._pending = pending
        self._orders: dict[int, TransportOrder] = {}
        self._by_name: dict[str, int] = {}
        self._by_key: dict[str, int] = {}
        # 0008: a kill undoes what is not committed, so hosts must not have seen it.
        self._committed: dict[int, TransportOrder] = {}
        self._recent: OrderedDict[int, None] = OrderedDict()
        self._ended: list[TransportOrder] = []

    def next_number(self) -> int:
        """Return the number for a new order."""
        self.last_number += 1
        return self.last_number

    def load(self, order: TransportOrder) -> None:
        """Add an order as stored."""
        self._index_order(order)
        self._committed[order.number] = order
        self.statistics.loaded(order)

    def put(self, order: TransportOrder) -> None:
        """Add a new order, or the new version of one; the same version again changes nothing."""
        previous = self._orders.get(order.number)
        if previous is order:
            return
        self._index_order(order)
        self._pending.stored.put_order(order, previous)
        if order.state.final:
            self._ended.append(order)
        # Hosts are promised every state of an order, not every change of its reason.
        publish = self._pending.orders
        if publish and (publish[-1].number, publish[-1].state) == (order.number, order.state):
            publish.pop()
        publish.append(order)

    @property
    def any_ended(self) -> bool:
        """Whether orders have ended that :meth:`take_ended` has not returned yet."""
        return bool(self._ended)

    def take_ended(self) -> list[TransportOrder]:
        """Return the orders that have ended since the last call."""
        ended, self._ended = self._ended, []
        return ended

    def committed(self, orders: Iterable[TransportOrder]) -> None:
        """Make these versions visible to hosts, because they are in the store."""
        for order in orders:
            self.statistics.changed(self._committed.get(order.number), order)
            self._committed[order.number] = order
            if order.state.final:
                self._recent[order.number] = None
        while len(self._recent) > RECENT_LIMIT:
            self._forget_order(self._recent.popitem(last=False)[0])

    def get(self, number: int) -> TransportOrder:
        """Return the current version of an order; KeyError if it is not in memory."""
        return self._orders[number]

    def find(self, number: int) -> TransportOrder | None:
        """Return the current version of an order; None if it is not in memory."""
        return self._orders.get(number)

    def is_over(self, number: int) -> bool:
        """Return whether an order has ended."""
        order = self._orders.get(number)
        return order is None or order.state.final

    def is_unfinished(self, name: str) -> bool:
        """Return whether the order of this name has not ended; one that is not in memory has."""
        order = self.named(name)
        return order is not None and not order.state.final

    def named(self, name: str) -> TransportOrder | None:
        """Return the current order of this name; None if it is not in memory."""
        number = self._by_name.get(name)
        return None if number is None else self._orders[number]

    def keyed(self, idempotency_key: str | None) -> TransportOrder | None:
        """Return the current order created under this key; None if it is not in memory."""
        number = self._by_key.get(idempotency_key) if idempotency_key is not None else None
        return None if number is None else self._orders[number]

    def visible(self, number: int | None) -> TransportOrder | None:
        """Return the committed version of an order; None if it is not in memory or was never committed."""
        return self._committed.get(number) if number is not None else None

    def visible_named(self, name: str) -> TransportOrder | None:
        """Return the committed order of this name; None if it is not in memory."""
        return self.visible(self._by_name.get(name))

    @property
    def any_waiting(self) -> bool:
        """Whether any order waits for a vehicle."""
        return bool(self.waiting)

    def dispatchable(self) -> tuple[TransportOrder, ...]:
        """Return the orders that wait for a vehicle, most urgent first."""
        return tuple(map(self.get, self.waiting))

    def present(self) -> Iterator[TransportOrder]:
        """Yield the current orders that have not ended."""
        return (order for order in self._orders.values() if not order.state.final)

    def unfinished(self) -> Iterator[TransportOrder]:
        """Yield the committed orders that have not ended."""
        return (order for order in self._committed.values() if not order.state.final)

    def _index_order(self, order: TransportOrder) -> None:
        self._orders[order.number] = order
        self._by_name[order.name] = order.number
        if order.idempotency_key is not None:
            self._by_key[order.idempotency_key] = order.number
        self.waiting.put(order)

    def _forget_order(self, number: int) -> None:
        order = self._orders.pop(number)
        self._committed.pop(number, None)
        self._by_name.pop(order.name, None)
        if order.idempotency_key is not None:
            self._by_key.pop(order.idempotency_key, None)


class OrderSequences:
    """Unfinished order sequences, in their current and committed versions."""

    def __init__(self, pending: PendingChanges) -> None:
        self._pending = pending
        self._last_number = 0
        self._sequences: dict[str, OrderSequence] = {}
        self._by_key: dict[str, str] = {}
        self._visible: dict[str, OrderSequence] = {}
        self._bound: dict[str, str] = {}
        """Names of sequences by the vehicles bound to them."""

    def load(self, sequences: Iterable[OrderSequence], last_number: int) -> None:
        """Add the sequences of the store; ``last_number`` is the highest sequence number."""
        self._last_number = last_number
        for sequence in sequences:
            self._index_sequence(sequence)
            self._visible[sequence.name] = sequence

    def rebind_vehicles(self, present_name: Callable[[str], str]) -> None:
        """Keep sequences bound to their robots, whose vehicles may have been renamed at the restart."""
        renamed = [
            (sequence, present)
            for sequence in self._visible.values()
            if sequence.bound_vehicle
            and (present := present_name(sequence.bound_vehicle)) != sequence.bound_vehicle
        ]
        # All old names go first, because two vehicles may have swapped theirs.
        for sequence, _ in renamed:
            self._bound.pop(sequence.bound_vehicle or "", None)
        for sequence, present in renamed:
            self.put(sequence.rebound(present))

    def next_number(self) -> int:
        """Return the number for a new sequence."""
        self._last_number += 1
        return self._last_number

    def put(self, sequence: OrderSequence) -> None:
        """Add a new sequence, or the new version of one; the same version again changes nothing."""
        if self._sequences.get(sequence.name) is sequence:
            return
        self._index_sequence(sequence)
        self._pending.stored.sequences[sequence.number] = sequence
        self._pending.sequences.append(sequence)

    def committed(self, sequences: Iterable[OrderSequence]) -> None:
        """Make these versions visible to hosts, and drop finished ones, which remain in the store."""
        for sequence in sequences:
            if sequence.status.finished:
                self._forget_sequence(sequence)
            else:
                self._visible[sequence.name] = sequence

    def named(self, name: str | None) -> OrderSequence | None:
        """Return the current sequence of this name; None if it is not in memory."""
        return None if name is None else self._sequences.get(name)

    def keyed(self, idempotency_key: str | None) -> OrderSequence | None:
        """Return the current sequence created under this key; None if it is not in memory."""
        return self.named(self._by_key.get(idempotency_key)) if idempotency_key is not None else None

    def visible(self, name: str) -> OrderSequence | None:
        """Return the committed sequence of this name; None if it is not in memory."""
        return self._visible.get(name)

    def unfinished(self) -> Iterator[OrderSequence]:
        """Yield the committed unfinished sequences."""
        return iter(tuple(self._visible.values()))

    def of_vehicle(self, vehicle: str) -> OrderSequence | None:
        """Return the sequence to which a vehicle is bound; None if it is free."""
        return self.named(self._bound.get(vehicle))

    def _index_sequence(self, sequence: OrderSequence) -> None:
        self._sequences[sequence.name] = sequence
        if sequence.idempotency_key is not None:
            self._by_key[sequence.idempotency_key] = sequence.name
        vehicle = sequence.status.processing_vehicle
        if sequence.bound_vehicle:
            self._bound[sequence.bound_vehicle] = sequence.name
        # A finished one, whose vehicle may be bound to another sequence by now.
        elif vehicle and self._bound.get(vehicle) == sequence.name:
            del self._bound[vehicle]

    def _forget_sequence(self, sequence: OrderSequence) -> None:
        del self._sequences[sequence.name]
        self._visible.pop(sequence.name, None)
        if sequence.idempotency_key is not None:
            del self._by_key[sequence.idempotency_key]


class VehicleRecord(FrozenModel):
    """The stored state of one vehicle, available after a restart before its robot reports."""

    manufacturer: str
    serial_number: str
    name: str = ""
    """The vehicle's last name; empty: not stored."""
    integration_level: IntegrationLevel = IntegrationLevel.TO_BE_UTILIZED
    level_set: SetBy | None = None
    """Who has set another level than TO_BE_UTILIZED."""
    failed_at: tuple[str, ...] = ()
    """The destinations of the orders that have failed at it since its last finished drive, oldest first."""
    taken_out: str = ""
    """Why the order service has set its integration level to TO_BE_RESPECTED; empty if a host has set it."""
    coded_taken_out: OptionalReason = None
    """The same as a code."""
    acceptable_order_types: tuple[AcceptableOrderType, ...] | None = None
    """As set by hosts; None: those of the plant model."""
    held: tuple[ResourceSet, ...] = ()
    """The resources that it held when its current drive began, oldest first."""
    beside: tuple[ResourceSet, ...] | None = None
    """Resources that it may also occupy since it broke off its route or was moved; None: it did not."""

    @property
    def robot(self) -> RobotKey:
        """The key of its robot."""
        return RobotKey(self.manufacturer, self.serial_number)


class VehicleRecords:
    """Stored records of vehicles: integration levels, order types and held resources."""

    def __init__(self, pending: PendingChanges, registry: VehicleRegistry) -> None:
        self._pending = pending
        self._registry = registry
        self._records: dict[RobotKey, VehicleRecord] = {}
        self._names_before: dict[RobotKey, str] = {}
        """The names of vehicles before the restart, where stored."""

    def load(self, documents: Mapping[str, str]) -> None:
        """Read the documents of the store; unreadable ones are logged and left out."""
        for robot, document in documents.items():
            try:
                record = VehicleRecord.model_validate_json(document)
            except ValidationError as error:
                log.warning("stored vehicle is unreadable", robot=robot, problems=problems_of(error))
            else:
                self._records[record.robot] = record
                if record.name:
                    self._names_before[record.robot] = record.name

    def name_before(self, robot: RobotKey) -> str | None:
        """Return the name of a robot's vehicle before the restart; None if it was not stored."""
        return self._names_before.get(robot)

    def robot_before(self, name: str) -> RobotKey | None:
        """Return the robot that had this name before the restart; None if it was not stored."""
        return next((robot for robot, had in self._names_before.items() if had == name), None)

    def __contains__(self, robot: RobotKey) -> bool:
        """Return whether a robot has a record: it has been there, or a host has changed it."""
        return robot in self._records

    def __iter__(self) -> Iterator[VehicleRecord]:
        """Yield all records."""
        return iter(tuple(self._records.values()))

    def of(self, robot: RobotKey) -> VehicleRecord:
        """Return the record of a robot; a default one for a new robot."""
        record = self._records.get(robot)
        return record or VehicleRecord(manufacturer=robot.manufacturer, serial_number=robot.serial_number)

    def change(self, robot: RobotKey, **changes: object) -> None:
        """Change fields of a robot's record."""
        stored = self.of(robot)
        name = self._registry.discover(robot).name
        record = stored.model_copy(update={"name": name, **changes})
        if record != stored:
            self._records[robot] = record
            # Encoded at the commit, once per unit of work, however often it changes.
            self._pending.stored.vehicles[str(robot)] = partial(record.model_dump_json, by_alias=True)


class Drives:
    """The transport order that each robot executes, and the drives of each robot.

    A robot executes at most one transport order. At most one of its drives has a route: that of the transport
    order's current drive order, or a relocation. An order's drive may request a route during a relocation.
    """

    def __init__(self, pending: PendingChanges) -> None:
        self.requested: dict[RobotKey, Drive] = {}
        """The drives that request a route."""
        self.granted: dict[RobotKey, Drive] = {}
        """The drives with a route of which nothing is released yet."""
        self.sent: dict[RobotKey, Drive] = {}
        """The drives whose VDA orders the robots have, or are about to receive."""
        self._pending = pending
        self._order_of: dict[RobotKey, int] = {}
        """The numbers of the orders that robots execute."""

    def assign(self, order: TransportOrder, robot: RobotKey) -> None:
        """Assign an order to a robot until :meth:`release`."""
        self._order_of[robot] = order.number

    def release(self, order: TransportOrder) -> RobotKey | None:
        """Remove an order from its robot; return the robot, or None if the order had none."""
        if drive := self.of_order(order):
            self.end(drive)
        robot = next((robot for robot, number in self._order_of.items() if number == order.number), None)
        if robot is not None:
            del self._order_of[robot]
        return robot

    def load(self, drive: Drive) -> None:
        """Add a sent drive as stored; its transport order is already assigned."""
        self.sent[drive.robot] = drive

    def put(self, drive: Drive) -> None:
        """Add a new drive, or the new version of one; it is stored once it is sent."""
        self.drop(drive)
        if drive.is_sent:
            self.sent[drive.robot] = drive
            self._pending.stored.drives[str(drive.robot)] = DriveRow(drive.order_number, drive.document)
        elif drive.state is DriveState.GRANTED:
            self.granted[drive.robot] = drive
        else:
            self.requested[drive.robot] = drive

    def drop(self, drive: Drive) -> None:
        """Remove a drive of which nothing was sent."""
        for drives in (self.requested, self.granted):
            unsent = drives.get(drive.robot)
            if unsent and unsent.order_id == drive.order_id:  # a relocation may be there beside an order's
                del drives[drive.robot]

    def end(self, drive: Drive) -> None:
        """Remove a sent drive that has ended; the robot keeps its transport order, if any."""
        del self.sent[drive.robot]
        self._pending.stored.drives[str(drive.robot)] = None

    def with_id(self, robot: RobotKey, order_id: str) -> Drive | None:
        """Return the robot's sent drive with this orderId; None if it has another one or none."""
        drive = self.sent.get(robot)
        return drive if drive and drive.order_id == order_id else None

    def of_order(self, order: TransportOrder) -> Drive | None:
        """Return the sent drive of a transport order; None if nothing was sent for it."""
        return next((drive for drive in self.sent.values() if drive.order_number == order.number), None)

    def with_routes(self) -> Iterator[Drive]:
        """Yield the drives that have a route, sent or not."""
        return chain(self.sent.values(), self.granted.values())

    @property
    def unsent(self) -> set[RobotKey]:
        """The robots whose drives request a route, or wait until something of it is released."""
        return {*self.requested, *self.granted}

    def unsent_of_order(self, robot: RobotKey) -> Drive | None:
        """Return the drive of a robot's order if nothing of it was sent; None otherwise."""
        granted = self.granted.get(robot)
        return granted if granted and not granted.relocation else self.requested.get(robot)

    def order_number(self, robot: RobotKey) -> int | None:
        """Return the number of the transport order that a robot executes; None if it has none."""
        return self._order_of.get(robot)

    @property
    def assigned(self) -> Iterable[int]:
        """The numbers of the transport orders that robots execute."""
        return self._order_of.values()


PERIPHERAL_JOB = "peripheralJob"
"""The kind of a peripheral job's document in the store."""


class PeripheralJobs:
    """Peripheral jobs in memory: the unfinished and the last ended ones, current and committed."""

    def __init__(self, pending: PendingChanges) -> None:
        self.ended: Counter[str] = Counter()
        """Number of ended jobs by state."""
        self._pending = pending
        self._last_number = 0
        self._jobs: dict[str, PeripheralJob] = {}
        self._by_key: dict[JobKey, str] = {}
        self._open: dict[str, None] = {}
        """Names of the jobs that have not ended, the oldest first."""
        self._visible: dict[str, PeripheralJob] = {}

    def load(self, documents: Mapping[str, str]) -> None:
        """Read the documents of the store; unreadable ones are logged and left out."""
        jobs = []
        for name, document in documents.items():
            try:
                jobs.append(PeripheralJob.model_validate_json(document))
            except ValidationError as error:
                log.warning("stored peripheral job is unreadable", job=name, problems=problems_of(error))
        for job in sorted(jobs, key=lambda job: job.number):
            self._index_job(job)
            self._visible[job.name] = job

    def next_number(self) -> int:
        """Return the number for a new job."""
        self._last_number += 1
        return self._last_number

    def put(self, job: PeripheralJob) -> None:
        """Add a new job, or the new version of one."""
        self._index_job(job)
        self._pending.stored.documents[PERIPHERAL_JOB, job.name] = job.model_dump_json(exclude_none=True)
        self._pending.jobs.append(job)
        if job.over:
            self.ended[job.status.state.value] += 1

    def committed(self, jobs: Iterable[PeripheralJob]) -> None:
        """Make these versions visible to hosts, because they are in the store."""
        # One that was deleted in the same unit of work must not come back.
        self._visible.update([(job.name, job) for job in jobs if job.name in self._jobs])

    def named(self, name: str) -> PeripheralJob | None:
        """Return the current job of this name; None if it is not in memory."""
        return self._jobs.get(name)

    def at(self, key: JobKey) -> PeripheralJob | None:
        """Return the current job for an operation of a route; None if there is none yet."""
        name = self._by_key.get(key)
        return None if name is None else self._jobs[name]

    @property
    def any_known(self) -> bool:
        """Whether any job is in memory."""
        return bool(self._jobs)

    def unfinished(self) -> tuple[PeripheralJob, ...]:
        """Return the current jobs that have not ended, the oldest first."""
        return tuple(map(self._jobs.__getitem__, self._open))

    def visible(self, name: str) -> PeripheralJob | None:
        """Return the committed job of this name; None if it is not in memory."""
        return self._visible.get(name)

    def all_visible(self) -> tuple[PeripheralJob, ...]:
        """Return the committed jobs, the newest first."""
        return tuple(reversed(self._visible.values()))

    def forget_ended(self, is_needed: Callable[[PeripheralJob], bool]) -> None:
        """Delete the oldest ended jobs beyond :data:`RECENT_LIMIT`, except those that are still needed."""
        surplus = len(self._jobs) - len(self._open) - RECENT_LIMIT
        if surplus <= 0:
            return
        for job in [job for job in self._jobs.values() if job.over and not is_needed(job)][:surplus]:
            del self._jobs[job.name]
            self._visible.pop(job.name, None)
            if job.key and self._by_key.get(job.key) == job.name:
                del self._by_key[job.key]
            self._pending.stored.documents[PERIPHERAL_JOB, job.name] = None

    def _index_job(self, job: PeripheralJob) -> None:
        self._last_number = max(self._last_number, job.number)
        previous, self._jobs[job.name] = self._jobs.get(job.name), job
        if previous and previous.key and not job.key:  # it no longer belongs to the route
            del self._by_key[previous.key]
        if job.key:
            self._by_key[job.key] = job.name
        if job.over:
            self._open.pop(job.name, None)
        else:
            self._open.setdefault(job.name)


class PendingInstantActions:
    """Instant actions for whose end a host waits."""

    def __init__(self) -> None:
        self._waiting: dict[str, asyncio.Future[InstantActionEnded]] = {}

    def ended(self, end: InstantActionEnded) -> None:
        """Pass on the end of an action, if a host waits for it."""
        answer = self._waiting.pop(end.action.action_id, None)
        if answer and not answer.done():  # done: the host no longer waits
            answer.set_result(end)

    def expect(self, action_id: str) -> asyncio.Future[InstantActionEnded]:
        """Return a future for the end of an action that is about to be sent."""
        return self._waiting.setdefault(action_id, asyncio.get_running_loop().create_future())

    async def wait(
        self, action_id: str, end: asyncio.Future[InstantActionEnded], seconds: float
    ) -> InstantActionEnded | None:
        """Wait at most ``seconds`` for the end of an action; return None on timeout."""
        try:
            async with asyncio.timeout(seconds):
                return await end
        except TimeoutError:
            return None
        finally:
            self._waiting.pop(action_id, None)


class FleetState:
    """Everything that the engine's flows change, except the resources allocated by traffic control."""

    def __init__(self, registry: VehicleRegistry) -> None:
        self.registry = registry
        self.pending = PendingChanges()
        self.orders = Orders(self.pending)
        self.sequences = OrderSequences(self.pending)
        self.vehicles = VehicleRecords(self.pending, registry)
        self.drives = Drives(self.pending)
        self.peripheral_jobs = PeripheralJobs(self.pending)
        self.instant_actions = PendingInstantActions()
        self.pauses: dict[str, int] = {}
        """Numbers of paused orders, by the names of their vehicles."""
        self.dispatch_due = False
        """Whether a vehicle or an order may have become free."""
        self.drive_due = False
        """Whether a vehicle may be able to start or continue driving."""

    def after_commit(self, effect: Effect) -> None:
        """Run ``effect`` once the changes of this unit of work are committed."""
        self.pending.effects.append(effect)

    def vehicle_changed(self, name: str | None) -> None:
        """Publish a vehicle's status once the changes of this unit of work are committed."""
        if name is not None:
            self.pending.vehicles.add(name)

    def peripheral_changed(self, location: str) -> None:
        """Publish a device's status once the changes of this unit of work are committed."""
        self.pending.peripherals.add(location)

    def order_of(self, robot: RobotKey) -> TransportOrder | None:
        """Return the current transport order of a robot."""
        number = self.drives.order_number(robot)
        return None if number is None else self.orders.get(number)
