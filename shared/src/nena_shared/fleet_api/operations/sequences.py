"""Operations on order sequences."""

from __future__ import annotations

from nena_shared.fleet_api import requests, transport_order
from nena_shared.fleet_api.operations.operation import MADE_BEFORE, SEQUENCES, Operation
from nena_shared.fleet_api.refusals import Refusal

CREATE_SEQUENCE = Operation(
    "createOrderSequence",
    "Create an order sequence. Orders join it by naming it as their wrappingSequence.",
    "POST",
    SEQUENCES,
    transport_order.OrderSequenceStatus,
    request=transport_order.OrderSequenceRequest,
    versioned=True,
    creates=SEQUENCES,
    also=MADE_BEFORE,
    result="order_sequence",
    refusals=(Refusal.UNKNOWN_VEHICLE, Refusal.NAME_TAKEN, Refusal.KEY_REUSED, Refusal.NOT_SAVED),
)

LIST_SEQUENCES = Operation(
    "orderSequences",
    "List order sequences, newest first.",
    "GET",
    SEQUENCES,
    requests.OrderSequencePage,
    request=requests.OrderSequencesQuery,
    result="order_sequences",
    refusals=(Refusal.NOT_SAVED,),
)

SHOW_SEQUENCE = Operation(
    "orderSequence",
    "Return an order sequence with its history. Its version is the ETag.",
    "GET",
    f"{SEQUENCES}/{{name}}",
    transport_order.OrderSequenceStatus,
    versioned=True,
    result="order_sequence",
    refusals=(Refusal.UNKNOWN_SEQUENCE, Refusal.NOT_SAVED),
)

COMPLETE_SEQUENCE = Operation(
    "completeOrderSequence",
    "Mark an order sequence complete. It accepts no more orders and ends with its last one.",
    "POST",
    f"{SEQUENCES}/{{name}}/completion",
    transport_order.OrderSequenceStatus,
    versioned=True,
    result="order_sequence",
    refusals=(Refusal.UNKNOWN_SEQUENCE, Refusal.VERSION_CHANGED, Refusal.NOT_SAVED),
)
