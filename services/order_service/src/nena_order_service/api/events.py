"""The stream of changes that hosts follow by server-sent events; it can be taken up again where it broke off.

Each change of an order has a number in the store, which is its event's id. So ids stand over restarts, and
over the takeover by another order service. A client that comes back is told from the store which orders have
changed since its last id, each once and as it is (its history holds what was between), and how all vehicles
stand; vehicles have no ids, for of them only the present counts.

Events are made once for all clients and kept in a ring; a client is a place in it. Whoever falls behind by
more than the ring holds has lost its place, and is brought up to date as if it had come back. So no client
costs more than its connection, and none slows the others.
"""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncGenerator, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice

from nena_order_service.engine import Engine
from nena_order_service.errors import StoreNotReadyError, TooManyClientsError
from nena_order_service.settings import EventSettings
from nena_shared.fleet_api.transport_order import OrderSequenceStatus, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.web.server_sent_events import HEARTBEAT, HEARTBEAT_FRAME, News, nothing_within

PAGE = 200
"""Orders that are read from the store at a time."""

ID_LENGTH = 18
"""Digits of the greatest id that the store can hold, with room."""

_GAP_FRAME = b"event: gap\ndata: {}\n\n"


class EventKind(StrEnum):
    """What an event tells of."""

    TRANSPORT_ORDER = "transportOrder"
    ORDER_SEQUENCE = "orderSequence"
    VEHICLE = "vehicle"


@dataclass(frozen=True, slots=True)
class Interest:
    """What a client wants to hear of."""

    kinds: frozenset[EventKind] = frozenset(EventKind)
    transport_order: str | None = None
    """Only the order of this name."""
    vehicle: str | None = None
    """Only this vehicle, and orders that it works on."""

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
    """Of the change of an order; 0 for order sequences and vehicles."""
    is_last: bool = False
    """Whether it is the last version of its change: only that has an id."""

    def is_news(self, known: int) -> bool:
        return not self.number or self.number > known

    def is_for(self, interest: Interest) -> bool:
        if isinstance(self.body, VehicleStatus):
            return interest.wants_vehicle(self.body)
        if isinstance(self.body, OrderSequenceStatus):
            return interest.wants_sequence(self.body)
        return interest.wants_order(self.body)


class EventStream:
    """Listens to the engine; every method is for the event loop's thread."""

    def __init__(self, engine: Engine, settings: EventSettings) -> None:
        self._engine = engine
        self._numbers = engine.store.numbers
        self._settings = settings
        self._ring: deque[_Event] = deque(maxlen=settings.backlog)
        self._made = 0
        self._news = News()
        self._closed = False
        self.clients = 0
        self.overflows = 0
        """How often a client had lost its place."""

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Send an order's new version."""
        number, is_last = self._numbers.of(status.name, status.version)
        if self.clients:
            frame = _order_frame(status, number if is_last else 0)
            self._add(_Event(status, frame, number, is_last))

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Send an order sequence's new version."""
        if self.clients:
            self._add(_Event(status, _sequence_frame(status)))

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Send a vehicle's status."""
        if self.clients:
            self._add(_Event(status, _vehicle_frame(status)))

    def close(self) -> None:
        """End the streams of all clients."""
        self._closed = True
        self._news.came()

    async def follow(self, last_id: str | None, interest: Interest) -> AsyncGenerator[bytes, None]:
        """Yield what a client is told that knows everything up to ``last_id``; None: that knows nothing.

        Behind an id that says nothing here, as after the store was restored from a backup, a gap is told.

        Raises:
            TooManyClientsError: there is no room for another client.
            StoreNotReadyError: what it missed cannot be read; raised before anything is yielded.

        """
        if self.clients >= self._settings.clients:
            raise TooManyClientsError(self._settings.clients)
        self.clients += 1
        try:
            known = self._number_of(last_id)
            lost = _GAP_FRAME if last_id and known is None else b""
            place = self._made
            frames, known = await self._catch_up(known, interest)
            yield b"retry: 1000\n\n" + lost + frames
            async for frames in self._live(place, known, interest):
                yield frames
        finally:
            self.clients -= 1

    async def _live(self, place: int, known: int, interest: Interest) -> AsyncGenerator[bytes, None]:
        """Yield the events behind ``place``, but for changes that are ``known``."""
        while not self._closed:
            news = self._news.next
            if self._made - place > len(self._ring):
                self.overflows += 1
                place = self._made
                try:
                    frames, known = await self._catch_up(known, interest)
                except StoreNotReadyError:
                    return  # it comes back with its last id
                yield frames
                continue
            events = tuple(islice(self._ring, len(self._ring) - (self._made - place), None))
            place += len(events)
            frames = b"".join(each.frame for each in events if each.is_news(known) and each.is_for(interest))
            known = max((each.number for each in events if each.is_last), default=known)
            if frames:
                yield frames
            elif not events and await nothing_within(news, HEARTBEAT):
                yield HEARTBEAT_FRAME

    async def _catch_up(self, known: int | None, interest: Interest) -> tuple[bytes, int]:
        """Return what brings a client up to date, and the number of the last change that it then knows."""
        if known is None:
            return self._present(interest)
        frames: list[bytes] = []
        count = 0
        while page := await self._engine.store.changes_after(known, PAGE):
            count += len(page)
            if count > self._settings.replay_limit:
                present, known = self._present(interest)
                return _GAP_FRAME + present, known
            known = page[-1][0]
            frames += [_order_frame(o.status, n) for n, o in page if interest.wants_order(o.status)]
        return b"".join([*frames, *self._present_only(interest), _synced(known)]), known

    def _present(self, interest: Interest) -> tuple[bytes, int]:
        """Return all unfinished objects, and the number of the last change."""
        told = self._numbers.told
        orders = (o.status for o in self._engine.state.orders.unfinished() if interest.wants_order(o.status))
        frames = (_order_frame(status, 0) for status in orders)
        return b"".join([*frames, *self._present_only(interest), _synced(told)]), told

    def _present_only(self, interest: Interest) -> Iterator[bytes]:
        """Return objects that only have a present: unfinished sequences, and vehicles."""
        sequences = (each.status for each in self._engine.state.sequences.unfinished())
        yield from (_sequence_frame(status) for status in sequences if interest.wants_sequence(status))
        statuses = (self._engine.status(vehicle) for vehicle in self._engine.registry)
        yield from (_vehicle_frame(status) for status in statuses if interest.wants_vehicle(status))

    def _number_of(self, last_id: str | None) -> int | None:
        """Return the number of an id; None for an unknown one, which may be of another store."""
        if last_id is None or not (last_id.isascii() and last_id.isdecimal()) or len(last_id) > ID_LENGTH:
            return None
        number = int(last_id)
        return number if number <= self._numbers.last else None

    def _add(self, event: _Event) -> None:
        self._ring.append(event)
        self._made += 1
        self._news.came()


def _order_frame(status: TransportOrderStatus, number: int) -> bytes:
    head = b"id: %d\n" % number if number else b""
    return b"%bevent: transportOrder\ndata: %b\n\n" % (head, status.model_dump_json(by_alias=True).encode())


def _sequence_frame(status: OrderSequenceStatus) -> bytes:
    return b"event: orderSequence\ndata: %b\n\n" % status.model_dump_json(by_alias=True).encode()


def _vehicle_frame(status: VehicleStatus) -> bytes:
    return b"event: vehicle\ndata: %b\n\n" % status.model_dump_json(by_alias=True).encode()


def _synced(number: int) -> bytes:
    """Return the event after which everything is new."""
    return b"id: %d\nevent: synced\ndata: {}\n\n" % number
