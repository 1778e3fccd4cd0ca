"""All order sequences that are not finished, and what has changed about them since the last commit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial

from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.steps import Steps
from nena_order_service.orders.order_sequence import OrderSequence


class SequenceBook:
    """Holds each sequence twice: as it is, and as it is committed. Only the latter is told to anybody.

    A finished one is in the store only, once that is committed.
    """

    def __init__(self, orders: OrderBook, steps: Steps) -> None:
        self._orders = orders
        self._steps = steps
        self._last_number = 0
        self._sequences: dict[str, OrderSequence] = {}
        self._by_key: dict[str, str] = {}
        self._visible: dict[str, OrderSequence] = {}
        self._bound: dict[str, str] = {}
        """Names of sequences by the vehicles that do nothing else."""

    def load(self, sequences: Iterable[OrderSequence], last_number: int) -> None:
        """Take in what is in the store as it is; ``last_number`` is the greatest that a sequence has."""
        self._last_number = last_number
        for sequence in sequences:
            self._index(sequence)
            self._visible[sequence.name] = sequence

    def rebind(self, present_name: Callable[[str], str]) -> None:
        """Let sequences stay with their robots, whose vehicles may be called otherwise since the restart."""
        bound = [(each, each.bound_vehicle) for each in self._visible.values() if each.bound_vehicle]
        moved = [(each, name, now) for each, name in bound if (now := present_name(name)) != name]
        for _, name, _ in moved:
            del self._bound[name]
        for sequence, _, now in moved:
            self.put(sequence.rebound(now))

    def next_number(self) -> int:
        """Give the number of a new sequence."""
        self._last_number += 1
        return self._last_number

    def put(self, sequence: OrderSequence) -> None:
        """Take in a new sequence, or the new version of one; the same version again changes nothing."""
        if self._sequences.get(sequence.name) is sequence:
            return
        self._index(sequence)
        self._orders.put_sequence(sequence)
        self._steps.after_commit(partial(self._committed, sequence))

    def named(self, name: str | None) -> OrderSequence | None:
        """Give the sequence of this name as it is; None if it is not here."""
        return None if name is None else self._sequences.get(name)

    def keyed(self, idempotency_key: str | None) -> OrderSequence | None:
        """Give the sequence that was made under this key, as it is; None if it is not here."""
        return self.named(self._by_key.get(idempotency_key)) if idempotency_key is not None else None

    def visible(self, name: str) -> OrderSequence | None:
        """Give the sequence of this name as it is committed; None if it is not here."""
        return self._visible.get(name)

    def unfinished(self) -> Iterator[OrderSequence]:
        """Yield the committed sequences."""
        return iter(tuple(self._visible.values()))

    def of_vehicle(self, vehicle: str) -> OrderSequence | None:
        """Give the sequence to which a vehicle is bound; None: it is free."""
        return self.named(self._bound.get(vehicle))

    def _index(self, sequence: OrderSequence) -> None:
        self._sequences[sequence.name] = sequence
        if sequence.idempotency_key is not None:
            self._by_key[sequence.idempotency_key] = sequence.name
        vehicle = sequence.status.processing_vehicle
        if sequence.bound_vehicle:
            self._bound[sequence.bound_vehicle] = sequence.name
        elif vehicle and self._bound.get(vehicle) == sequence.name:
            del self._bound[vehicle]

    def _committed(self, sequence: OrderSequence) -> None:
        if sequence.status.finished:
            self._forget(sequence)
        else:
            self._visible[sequence.name] = sequence
        self._steps.tell_sequence(sequence.status)

    def _forget(self, sequence: OrderSequence) -> None:
        del self._sequences[sequence.name]
        self._visible.pop(sequence.name, None)
        if sequence.idempotency_key is not None:
            del self._by_key[sequence.idempotency_key]
