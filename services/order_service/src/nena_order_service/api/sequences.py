"""Order sequences: operations of hosts."""

from __future__ import annotations

from collections.abc import Iterator

from nena_order_service import errors
from nena_order_service.api.operations import ETag, Handler
from nena_order_service.api.orders import check_same_request, check_version
from nena_order_service.engine.engine import Engine
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import sortable_id
from nena_shared.fleet_api.operations import sequences as table
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.requests import OrderSequencePage, OrderSequencesQuery
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, OrderSequenceStatus
from nena_shared.log import get_logger

log = get_logger(__name__)

SEQUENCE_PREFIX = "OSequence"


class SequenceOperations:
    """Executes requests about order sequences."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._sequences = engine.state.sequences

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        yield Handler(table.CREATE_SEQUENCE, self.create_sequence, {"name": "Tour-1", "failureFatal": True})
        yield Handler(table.LIST_SEQUENCES, self.list_sequences)
        yield Handler(table.SHOW_SEQUENCE, self.find_status)
        yield Handler(table.COMPLETE_SEQUENCE, self.complete_sequence)

    async def create_sequence(self, request: OrderSequenceRequest) -> tuple[OrderSequenceStatus, bool]:
        """Create a sequence; return it with False if the same request created it before."""
        vehicle = request.intended_vehicle
        if vehicle is not None and vehicle not in self._engine.registry.names():
            raise errors.UnknownError(Refusal.UNKNOWN_VEHICLE, vehicle)
        exact_name = None if request.incomplete_name else request.name
        sequence = await self._find_sequence(exact_name, request.idempotency_key)
        if sequence is None:
            name = exact_name or f"{request.name or SEQUENCE_PREFIX}-{sortable_id()}"
            async with self._engine.unit_of_work.saved():
                with self._engine.change():
                    sequence = self._engine.sequences.create(request, name)
                log.info("order sequence created", sequence=name)
            return self._visible_status(sequence), True
        check_same_request(sequence, request, SEQUENCE_PREFIX, same=sequence.was_created_by(request))
        # 0008: the request that created it may still be in the commit; an answer must outlast a kill.
        await self._engine.unit_of_work.wait_committed()
        return self._visible_status(sequence), False

    async def complete_sequence(self, name: str, seen: ETag | None = None) -> OrderSequenceStatus:
        """Mark a sequence complete: no more orders can join. A complete sequence stays unchanged."""
        sequence = await self._find_sequence(name, None)
        if sequence is None:
            raise errors.UnknownError(Refusal.UNKNOWN_SEQUENCE, name)
        sequence = self._sequences.named(name) or sequence  # it may have changed while the store was read
        check_version(name, sequence.status.version, seen)
        async with self._engine.unit_of_work.saved():
            if not sequence.status.complete:
                with self._engine.change():
                    sequence = self._engine.sequences.complete(sequence)
                log.info("order sequence complete", sequence=name)
        return self._visible_status(sequence)

    async def list_sequences(self, request: OrderSequencesQuery) -> OrderSequencePage:
        """Return a page of sequences, newest first."""
        more = request.model_copy(update={"limit": request.limit + 1})
        sequences = await self._engine.store.read_sequences(more)
        page = sequences[: request.limit]
        return OrderSequencePage(
            order_sequences=tuple(each.status for each in page),
            next=str(page[-1].number) if len(sequences) > request.limit else None,
        )

    async def find_status(self, name: str) -> OrderSequenceStatus:
        """Return a sequence."""
        sequence = self._sequences.visible(name) or await self._engine.store.read_sequence(name=name)
        if sequence is None:
            raise errors.UnknownError(Refusal.UNKNOWN_SEQUENCE, name)
        return sequence.status

    async def _find_sequence(self, name: str | None, key: str | None) -> OrderSequence | None:
        """Return the sequence with this key, otherwise with this name; from the store if not in memory."""
        if sequence := self._sequences.keyed(key) or self._sequences.named(name):
            return sequence
        if name is None and key is None:
            return None
        stored = await self._engine.store.read_sequence(name=name, idempotency_key=key)
        # Not in the store does not mean that it has not been created while the store was read.
        return stored or self._sequences.keyed(key) or self._sequences.named(name)

    def _visible_status(self, sequence: OrderSequence) -> OrderSequenceStatus:
        return (
            self._sequences.visible(sequence.name) or self._sequences.named(sequence.name) or sequence
        ).status
