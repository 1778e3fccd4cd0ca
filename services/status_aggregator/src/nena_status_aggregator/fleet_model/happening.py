"""What happens to robots and orders, one entry for each thing worth remembering."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum


class Code(StrEnum):
    """The kinds of happenings: a bounded list, for filters, translations and counters."""

    CONNECTION = "connection"
    """A robot's connection state is another one; `state`, `before`."""
    CONDITION = "condition"
    """A robot came into a condition, or has another reason to stand; `condition`, `before`, `reason`."""
    OPERATING_MODE = "operatingMode"
    """`mode`, `before`."""
    ORDER_TAKEN = "orderTaken"
    """A robot shows a new order; `orderId`, `orderUpdateId`."""
    ORDER_UPDATED = "orderUpdated"
    """A robot shows an update of its order; `orderId`, `orderUpdateId`."""
    ORDER_ENDED = "orderEnded"
    """A robot has nothing of its order left to do; `orderId`, `outcome`: see :class:`Outcome`."""
    NODE_REACHED = "nodeReached"
    """`nodeId`, `sequenceId`."""
    ACTION_ENDED = "actionEnded"
    """`actionId`, `actionType`, `status`: FINISHED or FAILED, `result`."""
    ERROR_RAISED = "errorRaised"
    """`errorType`, `errorLevel`, `description`."""
    ERROR_CLEARED = "errorCleared"
    """`errorType`, `errorLevel`."""
    CHARGING = "charging"
    """A robot has begun or ended to charge; `charging`, `charge` in percent."""
    LOADS = "loads"
    """A robot carries another number of loads; `loads`, `before`."""
    MAP = "map"
    """A robot is on another map; `mapId`, `before`."""
    POSITION = "position"
    """A robot has moved on by a set way; `x`, `y` in m, `theta` in rad, `mapId`."""
    ROBOT_FORGOTTEN = "robotForgotten"
    """A silent robot made room for a new one."""
    TRANSPORT_ORDER = "transportOrder"
    """A transport order is in another state, or waits for something else; `state`, `before`."""
    LINK = "link"
    """The aggregator's link to the broker stands or is lost; `connected`."""
    HISTORY_GAP = "historyGap"
    """Happenings that were not written; `dropped`."""


class Outcome(StrEnum):
    """How an order of a robot ended, as far as its states show."""

    COMPLETED = "completed"
    """The robot reached the last node, and no action failed."""
    ABANDONED = "abandoned"
    """It was cancelled or failed before."""
    UNSEEN = "unseen"
    """Another order followed before a state showed the end."""


Values = dict[str, str | float | None]


@dataclass(frozen=True, slots=True)
class Happening:
    """One thing that happened; the times are those of the aggregator."""

    time: datetime
    code: Code
    text: str
    """In words."""
    robot: str | None = None
    """Manufacturer and serial number."""
    order: str | None = None
    """Name of the transport order, else the VDA 5050 order that the robot holds."""
    values: Values = field(default_factory=dict)
