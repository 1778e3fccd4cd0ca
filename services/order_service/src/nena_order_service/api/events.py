"""The stream of changes that hosts follow by server-sent events, and can resume after an interruption.

Each change of an order has a number in the store, which is the ID of its event. IDs therefore survive
restarts and takeovers by another order service. A client that resumes receives each order that has changed
since its last ID, once and in its current state (its history contains the steps between), and the status of
all vehicles. Vehicles have no IDs, because only their current status counts.

A client that falls further behind than the ring holds is treated as if it had resumed.
"""

from __future__ import annotations

from collections.abc import AsyncGenerator, Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import StoreNotReadyError, TooManyClientsError
from nena_order_service.settings import EventSettings
from nena_shared.fleet_api.transport_order import OrderSequenceStatus, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.web.server_sent_events import EventRing

PAGE = 200
"""Number of orders read from the store at a time."""

ID_LENGTH = 18
"""Maximum number of digits of an ID; more than the store can hold."""

_GAP_FRAME = b"event: gap\ndata: {}\n\n"


class EventKind(StrEnum):
    """Kind of an event."""

    TRANSPORT_ORDER = "transportOrder"
    ORDER_SEQUENCE = "orderSequence"
    VEHICLE = "vehicle"


@dataclass(frozen=True, slots=True)
class Interest:
    """Filter for the events that a client wants."""

    kinds: frozenset[EventKind] = frozenset(EventKind)
    transport_order: str | None = None
    """Only the order with this name."""
    vehicle: str | None = None
    """Only this vehicle and the orders it works on."""

    def wants_order(self, order: TransportOrderStatus) -> bool:
        """Return whether a client receives this order."""
        return (
            EventKind.TRANSPORT_ORDER in self.kinds
            and self.transport_order in (None, order.name)
            and self.vehicle in (None, order.processing_vehicle)
        )

    def wants_sequence(self, sequence: OrderSequenceStatus) -> bool:
        """Return whether a client receives this order sequence."""
        return (
            EventKind.ORDER_SEQUENCE in self.kinds
            and (self.transport_order is None or self.transport_order in sequence.orders)
            and self.vehicle in (None, sequence.processing_vehicle)
        )

    def wants_vehicle(self, vehicle: VehicleStatus) -> bool:
        """Return whether a client receives this vehicle."""
        return EventKind.VEHICLE in self.kinds and self.vehicle in (None, vehicle.name)


@dataclass(frozen=True, slots=True)
class _Event:
    body: TransportOrderStatus | OrderSequenceStatus | VehicleStatus
    frame: bytes
    number: int = 0
    """Number of an order's change; 0 for order sequences and vehicles."""
    is_last: bool = False
    """Whether this is the last version of its change: only that one has an ID."""

    def is_new(self, known: int) -> bool:
        return not self.number or self.number > known

    def is_for(self, interest: Interest) -> bool:
        if isinstance(self.body, VehicleStatus):
            return interest.wants_vehicle(self.body)
        if isinstance(self.body, OrderSequenceStatus):
            return interest.wants_sequence(self.body)
        return interest.wants_order(self.body)


class EventStream(EventRing[_Event]):
    """Listens to the engine and feeds the clients; call every method in the event loop's thread."""

    def __init__(self, engine: Engine, settings: EventSettings) -> None:
        super().__init__(settings.backlog)
        self._engine = engine
        self._numbers = engine.store.numbers
        self._settings = settings
        self.overflows = 0
        """Number of times that a client was further behind than the ring holds."""

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Send an order's new version."""
        number, is_last = self._numbers.number_of(status.name, status.version)
        if self.clients:
            frame = _order_frame(status, number if is_last else 0)
            self.add(_Event(status, frame, number, is_last))

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Send an order sequence's new version."""
        if self.clients:
            self.add(_Event(status, _sequence_frame(status)))

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Send a vehicle's status."""
        if self.clients:
            self.add(_Event(status, _vehicle_frame(status)))

    async def follow(self, last_id: str | None, interest: Interest) -> AsyncGenerator[bytes, None]:
        """Yield the events for a client that has received everything up to ``last_id``; None: nothing yet.

        For an unknown ID, for example after the store was restored from a backup, the first event is a gap.

        Raises:
            TooManyClientsError: the limit of clients is reached.
            StoreNotReadyError: the missed events cannot be read; raised before anything is yielded.
        """
        if self.clients >= self._settings.clients:
            raise TooManyClientsError(self._settings.clients)
        with self.client():
            resumed = self._number_of(last_id)
            lost = _GAP_FRAME if last_id and resumed is None else b""
            # Before the store is read: what is committed meanwhile comes again rather than never.
            position = self.count
            frames, known = await self._catch_up(resumed, interest)
            yield b"retry: 1000\n\n" + lost + frames

            async def following() -> bytes:
                nonlocal position, known
                events, position = self.last(self.count - position), self.count
                if events is None:
                    self.overflows += 1
                    frames, known = await self._catch_up(known, interest)
                    return frames
                new = b"".join(
                    event.frame for event in events if event.is_new(known) and event.is_for(interest)
                )
                known = max((event.number for event in events if event.is_last), default=known)
                return new

            with suppress(StoreNotReadyError):  # the client resumes with its last ID
                async for frames in self.frames(following):
                    yield frames

    async def _catch_up(self, known: int | None, interest: Interest) -> tuple[bytes, int]:
        """Return the events that bring a client up to date, and the number of the last change included."""
        if known is None:
            return self._present_objects(interest)
        frames: list[bytes] = []
        count = 0
        while page := await self._engine.store.read_changes_after(known, PAGE):
            count += len(page)
            if count > self._settings.replay_limit:
                present, known = self._present_objects(interest)
                return _GAP_FRAME + present, known
            known = page[-1][0]
            frames += [_order_frame(o.status, n) for n, o in page if interest.wants_order(o.status)]
        return b"".join([*frames, *self._present_only(interest), _synced_event(known)]), known

    def _present_objects(self, interest: Interest) -> tuple[bytes, int]:
        """Return all unfinished objects, and the number of the last change."""
        published = self._numbers.published
        orders = (o.status for o in self._engine.state.orders.unfinished() if interest.wants_order(o.status))
        frames = (_order_frame(status, 0) for status in orders)
        return b"".join([*frames, *self._present_only(interest), _synced_event(published)]), published

    def _present_only(self, interest: Interest) -> Iterator[bytes]:
        """Yield objects without change numbers: unfinished sequences and vehicles."""
        sequences = (each.status for each in self._engine.state.sequences.unfinished())
        yield from (_sequence_frame(status) for status in sequences if interest.wants_sequence(status))
        statuses = (self._engine.reporter.vehicle_status(vehicle) for vehicle in self._engine.registry)
        yield from (_vehicle_frame(status) for status in statuses if interest.wants_vehicle(status))

    def _number_of(self, last_id: str | None) -> int | None:
        """Return the change number in an ID; None for an unknown ID, perhaps of another store."""
        if last_id is None or not (last_id.isascii() and last_id.isdecimal()) or len(last_id) > ID_LENGTH:
            return None
        number = int(last_id)
        return number if number <= self._numbers.last else None


def _order_frame(status: TransportOrderStatus, number: int) -> bytes:
    head = b"id: %d\n" % number if number else b""
    return b"%bevent: transportOrder\ndata: %b\n\n" % (head, status.model_dump_json(by_alias=True).encode())


def _sequence_frame(status: OrderSequenceStatus) -> bytes:
    return b"event: orderSequence\ndata: %b\n\n" % status.model_dump_json(by_alias=True).encode()


def _vehicle_frame(status: VehicleStatus) -> bytes:
    return b"event: vehicle\ndata: %b\n\n" % status.model_dump_json(by_alias=True).encode()


def _synced_event(number: int) -> bytes:
    """Return the event that tells a client that it is up to date."""
    return b"id: %d\nevent: synced\ndata: {}\n\n" % number
