"""What hosts may ask for about order sequences, the same through both doors."""

from __future__ import annotations

from nena_order_service.errors import (
    KeyReusedError,
    SequenceNameTakenError,
    UnknownSequenceError,
    UnknownVehicleError,
    VersionChangedError,
)
from nena_order_service.kernel.etag import ETag
from nena_order_service.kernel.kernel import Kernel
from nena_order_service.kernel.promises import committed, require_store
from nena_order_service.kernel.settings import KernelSettings
from nena_order_service.orders.names import sortable_id
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.store.sequences import SequenceFilter
from nena_shared.fleet_api.order_sequence import OrderSequenceRequest, OrderSequenceStatus
from nena_shared.log import get_logger

log = get_logger(__name__)

NAME_PREFIX = "OSequence"


class SequenceRequests:
    """Answers hosts; what it has answered is committed.

    Every method may raise what :mod:`nena_order_service.errors` holds.
    """

    def __init__(self, kernel: Kernel, settings: KernelSettings) -> None:
        self._kernel = kernel
        self._book = kernel.sequence_book
        self._settings = settings

    async def create(self, request: OrderSequenceRequest) -> tuple[OrderSequenceStatus, bool]:
        """Make a sequence; False: it is the one that the same request has made before."""
        vehicle = request.intended_vehicle
        if vehicle is not None and vehicle not in self._kernel.registry.names():
            raise UnknownVehicleError(vehicle)
        prefix = request.name or NAME_PREFIX
        complete = request.name is None or request.incomplete_name
        name = f"{prefix}-{sortable_id()}" if complete else prefix
        known = await self._find(None if complete else name, request.idempotency_key)
        if known is None:
            return await self._make(request, name), True
        _check_same(known, request, f"{prefix}-" if complete else name, complete=complete)
        await self._committed()
        return self._visible(known), False

    async def complete(self, name: str, *, seen: ETag | None = None) -> OrderSequenceStatus:
        """Let no more orders be added to a sequence; that it is complete already changes nothing.

        Only if it still is as the caller has ``seen`` it; None: whatever it is now.
        """
        sequence = await self._named(name)
        if seen is not None and not seen.fits(sequence.status.version):
            raise VersionChangedError(name, str(seen), sequence.status.version)
        if not sequence.status.complete:
            require_store(self._kernel.store)
            with self._kernel.step():
                sequence = self._kernel.sequences.complete(sequence)
            log.info("order sequence complete", sequence=name)
        await self._committed()
        return self._visible(sequence)

    async def sequence(self, name: str) -> OrderSequenceStatus:
        """Give a sequence."""
        found = self._book.visible(name) or await self._kernel.store.sequence(name=name)
        if found is None:
            raise UnknownSequenceError(name)
        return found.status

    async def sequences(self, wanted: SequenceFilter) -> tuple[OrderSequence, ...]:
        """Give a page of sequences, newest first."""
        return await self._kernel.store.sequences(wanted)

    async def _make(self, request: OrderSequenceRequest, name: str) -> OrderSequenceStatus:
        require_store(self._kernel.store)
        with self._kernel.step():
            made = self._kernel.sequences.create(request, name)
        log.info("order sequence created", sequence=name)
        await self._committed()
        return self._visible(made)

    async def _find(self, name: str | None, key: str | None) -> OrderSequence | None:
        """Give the sequence of this key, else of this name; from the store where it is not at hand."""
        if found := self._at_hand(name, key):
            return found
        if name is None and key is None:
            return None
        stored = await self._kernel.store.sequence(name=name, idempotency_key=key)
        return stored or self._at_hand(name, key)

    def _at_hand(self, name: str | None, key: str | None) -> OrderSequence | None:
        return self._book.keyed(key) or self._book.named(name)

    async def _named(self, name: str) -> OrderSequence:
        found = await self._find(name, None)
        if found is None:
            raise UnknownSequenceError(name)
        return self._book.named(name) or found

    def _visible(self, sequence: OrderSequence) -> OrderSequenceStatus:
        return (self._book.visible(sequence.name) or self._book.named(sequence.name) or sequence).status

    async def _committed(self) -> None:
        await committed(self._kernel.steps, self._kernel.store, self._settings.commit_timeout)


def _check_same(known: OrderSequence, request: OrderSequenceRequest, name: str, *, complete: bool) -> None:
    """Refuse a request that comes again and says something else; ``name`` is the start of a complete one."""
    key = request.idempotency_key
    if known.idempotency_key != key:
        raise SequenceNameTakenError(name)
    named = known.name.startswith(name) if complete else known.name == name
    if not (named and known.asked_for_by(request)):
        raise SequenceNameTakenError(name) if key is None else KeyReusedError(key, known.name)
