"""Types of transport orders, and which of them a vehicle accepts, in openTCS's words."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from nena_shared.fleet_api.base import Request

ANY_TYPE: Final = "*"
"""Accepted by it, an order may be of any type."""

OrderType = Annotated[str, Field(min_length=1, max_length=100)]
"""Free text; ``Transport``, ``Charge`` and ``Park`` are customary, ``-`` is an order that says none."""


class AcceptableOrderType(Request):
    """A type of orders that a vehicle accepts."""

    name: OrderType
    """``*``: any."""
    priority: Annotated[int, Field(ge=-1000, le=1000)] = 0
    """Less is preferred, where the dispatcher is told to look at it."""


ANY_ORDER_TYPE: Final = (AcceptableOrderType(name=ANY_TYPE),)
"""What a vehicle accepts of which nobody has said anything else."""
