"""Order sequences: transport orders that one vehicle does one after the other, in openTCS's words."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.fleet_api.base import IdempotencyKey, Moment, ObjectName, OrderName, Request, Resource
from nena_shared.fleet_api.order_types import ANY_TYPE, OrderType
from nena_shared.fleet_api.transport_order import HistoryEntry, Property


class OrderSequenceRequest(Request):
    """Asks for an order sequence, empty at first; orders name it as their ``wrappingSequence``."""

    name: OrderName | None = None
    """None: the order service makes one."""
    incomplete_name: bool = False
    """Whether the order service completes ``name`` to a unique one."""
    idempotency_key: IdempotencyKey | None = None
    """The same key again gives the sequence that the first request made, and no second one."""
    order_types: Annotated[tuple[OrderType, ...], Field(min_length=1, max_length=100)] = (ANY_TYPE,)
    """Types of the orders that may be added; ``*``: any."""
    intended_vehicle: ObjectName | None = None
    failure_fatal: bool = False
    """Whether all orders behind one that fails, and is not dispensable, fail with it."""
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] = ()


class OrderSequenceStatus(Resource):
    """An order sequence as it stands."""

    name: str
    version: int
    """Counts the changes; 1 at first."""
    reason: str
    """What it waits for, or how it has ended, in words."""
    order_types: tuple[str, ...]
    orders: tuple[str, ...] = ()
    """Names of its transport orders, in the order in which they are done."""
    finished_index: int = -1
    """Index of the last order up to which all are at their end; -1 before the first."""
    complete: bool = False
    """Whether no more orders are added."""
    finished: bool = False
    """Whether it is complete and all of its orders are at their end: its vehicle is free."""
    failure_fatal: bool = False
    intended_vehicle: str | None = None
    processing_vehicle: str | None = None
    """The vehicle that took the first order; it is bound until the sequence is finished."""
    properties: tuple[Property, ...] = ()
    created: Moment
    finished_time: Moment | None = None
    history: tuple[HistoryEntry, ...] = ()
