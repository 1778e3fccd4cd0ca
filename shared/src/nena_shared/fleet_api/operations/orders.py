"""Operations on transport orders."""

from __future__ import annotations

from typing import Final

from nena_shared.fleet_api import requests, transport_order
from nena_shared.fleet_api.operations.operation import MADE_BEFORE, ORDER_BATCH, ORDERS, Operation
from nena_shared.fleet_api.refusals import Refusal

BATCH_BYTES: Final = 1_000_000
"""Maximum size of a batch of orders: 1,000 orders with two destinations have about 0.3 MB."""

NEW_ORDER_REFUSALS: Final = (
    Refusal.KEY_REUSED,
    Refusal.NOT_IN_PLANT,
    Refusal.UNKNOWN_IN_PLANT,
    Refusal.NOT_SAVED,
)
_STORED: Final = (Refusal.UNKNOWN_ORDER, Refusal.NOT_SAVED)
_CHANGE: Final = (*_STORED, Refusal.ORDER_ENDED, Refusal.VERSION_CHANGED)

CREATE_ORDER = Operation(
    "createTransportOrder",
    "Create a transport order. It is stored before the response is sent.",
    "POST",
    ORDERS,
    transport_order.TransportOrderStatus,
    request=transport_order.TransportOrderRequest,
    versioned=True,
    creates=ORDERS,
    also=MADE_BEFORE,
    refusals=(
        *NEW_ORDER_REFUSALS,
        Refusal.NAME_TAKEN,
        Refusal.UNKNOWN_DEPENDENCY,
        Refusal.UNKNOWN_SEQUENCE,
        Refusal.SEQUENCE_REFUSES,
    ),
)

CREATE_ORDERS = Operation(
    "createTransportOrders",
    "Create up to 1000 transport orders, each on its own: some may be refused.",
    "POST",
    ORDER_BATCH,
    transport_order.TransportOrderBatchAnswer,
    request=transport_order.TransportOrderBatch,
    refusals=(Refusal.NOT_SAVED,),
    max_body=BATCH_BYTES,
)

LIST_ORDERS = Operation(
    "transportOrders",
    "List transport orders, newest first.",
    "GET",
    ORDERS,
    requests.TransportOrderPage,
    request=requests.TransportOrdersQuery,
    refusals=(Refusal.NOT_SAVED,),
)

SHOW_ORDER = Operation(
    "transportOrder",
    "Return a transport order with its history. Its version is the ETag.",
    "GET",
    f"{ORDERS}/{{name}}",
    transport_order.TransportOrderStatus,
    versioned=True,
    refusals=_STORED,
)

DELIVERY = Operation(
    "delivery",
    "Return the delivery of a transport order to its robot.",
    "GET",
    f"{ORDERS}/{{name}}/delivery",
    transport_order.DeliveryStatus,
    result="delivery",
    refusals=_STORED,
)

ASSIGNMENT = Operation(
    "assignment",
    "Return for each vehicle whether it could execute a transport order, or why not.",
    "GET",
    f"{ORDERS}/{{name}}/assignment",
    transport_order.AssignmentStatus,
    request=requests.AssignmentQuery,
    result="assignment",
    refusals=_STORED,
)

CHANGE_ORDER = Operation(
    "changeOrder",
    "Change the priority, vehicle, deadline or timeout of a transport order that no vehicle has yet.",
    "PATCH",
    f"{ORDERS}/{{name}}",
    transport_order.TransportOrderStatus,
    request=requests.OrderChange,
    versioned=True,
    result="transport_order",
    refusals=(*_CHANGE, Refusal.UNKNOWN_VEHICLE, Refusal.ORDER_ASSIGNED),
)

WITHDRAW = Operation(
    "withdraw",
    "Withdraw a transport order. It fails at once, or when its vehicle has released it.",
    "POST",
    f"{ORDERS}/{{name}}/withdrawal",
    transport_order.TransportOrderStatus,
    request=requests.WithdrawalRequest,
    may_be_empty=True,
    versioned=True,
    result="transport_order",
    refusals=_CHANGE,
)

HOLD = Operation(
    "hold",
    "Hold a transport order until it is resumed. It keeps its vehicle, which stops.",
    "POST",
    f"{ORDERS}/{{name}}/hold",
    transport_order.TransportOrderStatus,
    request=requests.HoldRequest,
    may_be_empty=True,
    versioned=True,
    result="transport_order",
    refusals=(*_CHANGE, Refusal.ORDER_WITHDRAWN),
)

RESUME = Operation(
    "resume",
    "Resume a held transport order from where its vehicle is.",
    "POST",
    f"{ORDERS}/{{name}}/resume",
    transport_order.TransportOrderStatus,
    request=requests.ResumeRequest,
    may_be_empty=True,
    versioned=True,
    result="transport_order",
    refusals=_CHANGE,
)
