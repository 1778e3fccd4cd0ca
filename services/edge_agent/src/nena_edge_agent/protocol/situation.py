"""The robot as an order meets it."""

from __future__ import annotations

from dataclasses import dataclass, field

from nena_edge_agent.driver.port import Circle, Pose
from nena_edge_agent.protocol.order_content import HeldContent
from nena_edge_agent.protocol.order_history import OrderHistory
from nena_edge_agent.protocol.zone_sets import EnabledZone
from nena_shared.vda5050.state import OperatingMode


@dataclass(frozen=True, slots=True)
class Situation:
    """What the decision about an order depends on.

    ``off`` says why the robot's ROS session keeps it from taking orders, empty if it does not.
    ``fatal``: somebody has shown an error with which the robot takes no orders. ``cancelled``: the held order
    was cancelled, or is being ended; ``cleared``: it was ended before its end, perhaps far from its base.
    ``pose`` is None unless it can be trusted, ``no_route`` are the areas that navigation knows no way into.
    ``maps`` are the areas that the robot has a map of, ``closed`` the zones that it must not drive in.
    ``stands_on`` is the node that the robot has reached and not left, or empty. ``loaded``: whether it will
    carry something when all that was released to it is done. ``history`` knows the orders that have ended.
    """

    operating_mode: OperatingMode
    off: str
    fatal: bool
    idle: bool
    cancelled: bool
    cleared: bool
    order_id: str
    order_update_id: int
    decision_point: tuple[str, int] | None
    content: HeldContent | None
    pose: Pose | None
    no_route: tuple[Circle, ...]
    maps: frozenset[str]
    closed: tuple[EnabledZone, ...]
    stands_on: str
    instant_action_ids: frozenset[str]
    base_action_ids: frozenset[str]
    loaded: bool = False
    history: OrderHistory = field(default_factory=OrderHistory)
