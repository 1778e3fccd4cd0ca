"""Steps: what changes together, is committed together, and is told and done only after that."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.ports import Listener
from nena_order_service.kernel.vehicle_status import Essentials
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store.store import Store
from nena_shared.fleet_api.transport_order import OrderSequenceStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger

log = get_logger(__name__)

Effect = Callable[[], None]

UNTOLD_AT_MOST = 20
"""Steps after which a vehicle is told though another step that changes it waits."""


class Steps:
    """Gathers the changes of one step at a time; steps are never nested.

    Of vehicles only the present is told: where several steps that wait for their commit change one, the last
    of them tells how it stands, or one of them where there is no end of them.
    """

    def __init__(
        self, book: OrderBook, store: Store, vehicle_status: Callable[[str], VehicleStatus | None]
    ) -> None:
        self._book = book
        self._store = store
        self._vehicle_status = vehicle_status
        self._effects: list[Effect] = []
        self._vehicles: set[str] = set()
        self._untold: Counter[str] = Counter()
        """How many steps that wait for their commit change each vehicle."""
        self._passed_over: Counter[str] = Counter()
        """How many committed steps have told nothing of each vehicle, for there were later ones."""
        self._told: dict[str, Essentials] = {}
        self.listeners: list[Listener] = []
        self.closed = ""
        """Why no step is made any more; empty while there are some."""

    def after_commit(self, effect: Effect) -> None:
        """Have something done when the changes of this step are committed."""
        self._effects.append(effect)

    def vehicle_changed(self, name: str | None) -> None:
        """Have it told that a vehicle stands otherwise than before."""
        if name is not None:
            self._vehicles.add(name)

    def vehicle_as_told(self, name: str, now: Essentials) -> bool:
        """Whether this is what was told of a vehicle last, or what is about to be told."""
        return name in self._untold or self._told.get(name) == now

    def tell_sequence(self, status: OrderSequenceStatus) -> None:
        """Tell of an order sequence, whose change is committed."""
        for listener in self.listeners:
            listener.sequence_changed(status)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Make changes; at the end they go to the store, and are done and told when they are committed.

        Raises:
            StoreNotReadyError: no more changes are made here.

        """
        if self.closed:
            raise StoreNotReadyError(self.closed)
        try:
            yield
        finally:
            changes, told = self._book.take_changes()
            effects, self._effects = self._effects, []
            vehicles, self._vehicles = self._vehicles, set()
            if changes or effects or vehicles:
                self._untold.update(vehicles)
                self._store.commit(changes, lambda: self._release(told, effects, vehicles))

    def committed(self) -> asyncio.Future[None]:
        """Give a future that is done when all that has been changed so far is committed."""
        future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        with self.step():
            self.after_commit(lambda: None if future.done() else future.set_result(None))
        return future

    def _release(self, told: list[TransportOrder], effects: list[Effect], vehicles: set[str]) -> None:
        self._book.committed(told)
        for effect in effects:
            try:
                effect()
            except Exception:
                log.exception("an effect of a committed change failed")
        due = self._no_longer_untold(vehicles)
        statuses = [status for name in sorted(due) if (status := self._vehicle_status(name))]
        self._told.update({status.name: Essentials.of(status) for status in statuses})
        for listener in self.listeners:
            for order in told:
                listener.order_changed(order.status)
            for status in statuses:
                listener.vehicle_changed(status)

    def _no_longer_untold(self, vehicles: Iterable[str]) -> list[str]:
        """Give those of a step's vehicles that are told now, and not by a later step."""
        self._untold.subtract(vehicles)
        self._passed_over.update(vehicles)
        due = [
            name for name in vehicles if not self._untold[name] or self._passed_over[name] >= UNTOLD_AT_MOST
        ]
        for name in due:
            del self._passed_over[name]
            if not self._untold[name]:
                del self._untold[name]
        return due
