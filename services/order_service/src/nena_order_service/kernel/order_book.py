"""All orders that are not at their end, and what has changed about them since the last commit."""

from __future__ import annotations

from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Iterable, Iterator

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder, Urgency
from nena_order_service.store.changes import Changes, Document
from nena_shared.fleet_api.transport_order import TransportOrderState

RECENT_LIMIT = 1000
"""Orders at their end that are kept at hand; older ones are in the store only."""


class OrderBook:
    """Holds each order twice: as it is, and as it is committed. Only the latter may be told to anybody."""

    def __init__(self) -> None:
        self.last_number = 0
        """The greatest number that an order of the store has."""
        self._orders: dict[int, TransportOrder] = {}
        self._by_name: dict[str, int] = {}
        self._by_key: dict[str, int] = {}
        self._queue: list[Urgency] = []
        self._committed: dict[int, TransportOrder] = {}
        self._recent: OrderedDict[int, None] = OrderedDict()
        self._changes = Changes()
        self._ended: list[TransportOrder] = []
        self._told: list[TransportOrder] = []

    def next_number(self) -> int:
        """Give the number of a new order."""
        self.last_number += 1
        return self.last_number

    def load(self, order: TransportOrder) -> None:
        """Take in an order that is in the store as it is."""
        self._index(order)
        self._committed[order.number] = order

    def put(self, order: TransportOrder) -> None:
        """Take in a new order, or the new version of one; the same version again changes nothing.

        Of versions in a row that are in the same state only the last will be told.
        """
        before = self._orders.get(order.number)
        if before is order:
            return
        self._index(order)
        self._changes.put_order(order, before)
        if order.state.final:
            self._ended.append(order)
        if self._told and (self._told[-1].number, self._told[-1].state) == (order.number, order.state):
            self._told.pop()
        self._told.append(order)

    @property
    def any_ended(self) -> bool:
        """Whether orders have come to their end of which :meth:`take_ended` has not told yet."""
        return bool(self._ended)

    def take_ended(self) -> list[TransportOrder]:
        """Give the orders that have come to their end since this was asked last."""
        ended, self._ended = self._ended, []
        return ended

    def put_sequence(self, sequence: OrderSequence) -> None:
        """Note an order sequence, or the new version of one."""
        self._changes.put_sequence(sequence)

    def put_mission(self, number: int, document: Document | None) -> None:
        """Note what is sent to a robot for an order, None: nothing any more."""
        self._changes.put_mission(number, document)

    def put_vehicle(self, robot: str, document: Document) -> None:
        """Note what is known of a vehicle, by its robot's key."""
        self._changes.put_vehicle(robot, document)

    def take_changes(self) -> tuple[Changes, list[TransportOrder]]:
        """Give what is to be committed, and the versions of orders that are to be told after that."""
        changes, told = self._changes, self._told
        self._changes, self._told = Changes(), []
        return changes, told

    def committed(self, orders: Iterable[TransportOrder]) -> None:
        """Take notice that these versions are in the store."""
        for order in orders:
            self._committed[order.number] = order
            if order.state.final:
                self._recent[order.number] = None
        while len(self._recent) > RECENT_LIMIT:
            self._forget(self._recent.popitem(last=False)[0])

    def get(self, number: int) -> TransportOrder:
        """Give an order as it is; KeyError if it is not here."""
        return self._orders[number]

    def at_hand(self, number: int) -> TransportOrder | None:
        """Give an order as it is; None if it is not here."""
        return self._orders.get(number)

    def is_over(self, number: int) -> bool:
        """Tell whether an order is at its end."""
        order = self._orders.get(number)
        return order is None or order.state.final

    def named(self, name: str) -> TransportOrder | None:
        """Give the order of this name as it is; None if it is not here."""
        number = self._by_name.get(name)
        return None if number is None else self._orders[number]

    def keyed(self, idempotency_key: str | None) -> TransportOrder | None:
        """Give the order that was made under this key, as it is; None if it is not here."""
        number = self._by_key.get(idempotency_key) if idempotency_key is not None else None
        return None if number is None else self._orders[number]

    def visible(self, number: int | None) -> TransportOrder | None:
        """Give an order as it is committed; None if it is not here or was never committed."""
        return self._committed.get(number) if number is not None else None

    def visible_named(self, name: str) -> TransportOrder | None:
        """Give the order of this name as it is committed; None if it is not here or was never committed."""
        return self.visible(self._by_name.get(name))

    @property
    def orders_wait(self) -> bool:
        """Whether any order waits for a vehicle."""
        return bool(self._queue)

    def dispatchable(self) -> tuple[TransportOrder, ...]:
        """Give the orders that wait for a vehicle, most urgent first."""
        return tuple(self._orders[urgency[-1]] for urgency in self._queue)

    def present(self) -> Iterator[TransportOrder]:
        """Yield the orders that are not at their end, as they are."""
        return (order for order in self._orders.values() if not order.state.final)

    def unfinished(self) -> Iterator[TransportOrder]:
        """Yield the committed orders that are not at their end."""
        return (order for order in self._committed.values() if not order.state.final)

    def _index(self, order: TransportOrder) -> None:
        self._orders[order.number] = order
        self._by_name[order.name] = order.number
        if order.idempotency_key is not None:
            self._by_key[order.idempotency_key] = order.number
        self._queue_or_not(order)

    def _queue_or_not(self, order: TransportOrder) -> None:
        """Let an order stand in the queue exactly while it is dispatchable; its urgency never changes."""
        place = bisect_left(self._queue, order.urgency)
        queued = place < len(self._queue) and self._queue[place] == order.urgency
        waits = order.state is TransportOrderState.DISPATCHABLE
        if waits and not queued:
            self._queue.insert(place, order.urgency)
        elif queued and not waits:
            del self._queue[place]

    def _forget(self, number: int) -> None:
        order = self._orders.pop(number)
        self._committed.pop(number, None)
        self._by_name.pop(order.name, None)
        if order.idempotency_key is not None:
            self._by_key.pop(order.idempotency_key, None)
