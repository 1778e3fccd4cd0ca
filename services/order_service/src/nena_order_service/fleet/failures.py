"""Failures of an order at a robot: their kinds, and the errors that robots report, in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import StrEnum
from typing import Final

from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.v2_1.state import REJECTIONS, WRITTEN


class FailureKind(StrEnum):
    """How a VDA order failed, which determines how much is known of its progress at the robot."""

    REFUSED = "REFUSED"
    """The robot has refused it, or has one already."""
    UNFIT = "UNFIT"
    """The robot could never execute it, by its factsheet; nothing was sent."""
    NOT_TAKEN = "NOT_TAKEN"
    """It was resent repeatedly, and the robot never accepted it."""
    DRIVE = "DRIVE"
    """The robot had it and could not continue, or gave it up; its operation is not done."""
    ACTION = "ACTION"
    """The robot has reached the end of the route, and its operation has FAILED there."""
    LOST = "LOST"
    """The robot had it, and no longer does."""
    UNCLEAR = "UNCLEAR"
    """What the robot has done of it, or whether it still works on it, is unknown."""
    NO_WAY = "NO_WAY"
    """There is no route to the destination now; nothing was sent."""


NO_ORDER_REFUSALS: Final = frozenset({ErrorType.NO_ORDER_TO_CANCEL, ErrorType.INVALID_INSTANT_ACTION})

ORDER_REFUSALS: Final[frozenset[str]] = frozenset(
    name for kind in REJECTIONS - NO_ORDER_REFUSALS for name in (kind, WRITTEN[kind])
)
"""Types by which a robot refuses an order, under the names of all versions."""

UNREACHABLE: Final[frozenset[str]] = frozenset(
    {ErrorType.NODE_UNREACHABLE, WRITTEN[ErrorType.NODE_UNREACHABLE]}
)

NO_NAVIGATION: Final[frozenset[str]] = frozenset(
    {ErrorType.NAVIGATION_NOT_AVAILABLE, WRITTEN[ErrorType.NAVIGATION_NOT_AVAILABLE]}
)

STOPPING: Final = frozenset({ErrorLevel.CRITICAL, ErrorLevel.FATAL})
"""Levels at which a robot does not continue."""


ErrorIdentity = tuple[str, frozenset[tuple[str, str]]]


def identity(error: ErrorEntry) -> ErrorIdentity:
    """Return the fields by which an error is recognised in the next state; its texts may change."""
    return error.error_type, frozenset(
        (each.reference_key, each.reference_value) for each in error.error_references
    )


def in_words(error: ErrorEntry) -> str:
    """Return the robot's own text."""
    text = f"{error.error_type}: {error.error_description}" if error.error_description else error.error_type
    return f"{text} ({error.error_hint})" if error.error_hint else text


def with_details(reason: str, details: Iterable[str]) -> str:
    """Return a reason with the robot's own error texts."""
    joined = "; ".join(details)
    return f"{reason}: {joined}" if joined else reason


def fatal(errors: Iterable[ErrorEntry]) -> ErrorEntry | None:
    """Return the first error that needs a person, if there is one (section 6.6.5.1)."""
    return next((error for error in errors if error.error_level is ErrorLevel.FATAL), None)


def no_navigation(errors: Iterable[ErrorEntry]) -> ErrorEntry | None:
    """Return the error by which a robot reports that it waits for its own navigation, if any."""
    return next((error for error in errors if error.error_type in NO_NAVIGATION), None)


def refusals(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors by which the robot refuses the VDA order (section 6.1.4).

    They name its orderId; or they have the type of a refusal, name neither an order nor another action, and
    were not there ``before`` the VDA order was sent (2.x has no duty to name anything).
    """
    return tuple(error for error in errors if _refuses(error, vda_order, before))


def _refuses(error: ErrorEntry, vda_order: VdaOrder, before: frozenset[ErrorIdentity]) -> bool:
    named = _referenced(error, "orderId")
    if named:
        return vda_order.order_id in named
    known = identity(error) in before or of_another_action(error, vda_order) or _of_another_topic(error)
    return error.error_type in ORDER_REFUSALS and not known


def is_named(error: ErrorEntry, vda_order: VdaOrder) -> bool:
    """Return whether an error names the VDA order or one of its actions (section 6.6.5.2)."""
    return vda_order.order_id in _referenced(error, "orderId") or bool(
        _referenced(error, "actionId") & vda_order.action_ids
    )


def _of_another_topic(error: ErrorEntry) -> bool:
    """Return whether an error names topics, and not that of orders: a message of another kind was refused."""
    topics = _referenced(error, "topic")
    return bool(topics) and Topic.ORDER not in topics


def of_another_action(error: ErrorEntry, vda_order: VdaOrder) -> bool:
    """Return whether an error names actions, and none of the VDA order: an instant action was refused."""
    actions = _referenced(error, "actionId")
    return bool(actions) and actions.isdisjoint(vda_order.action_ids)


def name_actions(errors: Iterable[ErrorEntry]) -> bool:
    """Return whether errors name actions (section 6.6.5.2)."""
    return any(_referenced(error, "actionId") for error in errors)


def refuses_update(error: ErrorEntry, order_id: str, update_id: int) -> bool:
    """Return whether an error means that the robot refuses an update of its present order (section 6.1.4).

    An update is identified by its number; in 2.x an error that names no order may be about it.
    """
    orders, updates = _referenced(error, "orderId"), _referenced(error, "orderUpdateId")
    foreign = _of_another_topic(error) or (orders and order_id not in orders)
    if error.error_type not in ORDER_REFUSALS or foreign:
        return False
    return str(update_id) in updates if updates else True


def names_update(error: ErrorEntry) -> bool:
    """Return whether an error names an update, of whichever order (section 6.6.5.2)."""
    return bool(_referenced(error, "orderUpdateId"))


def about(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors that mean that the robot, which has the VDA order, cannot continue it.

    VDA 5050 3.0 section 6.6.5.1.
    """
    return tuple(error for error in _new_stops(errors, before) if _is_about(error, vda_order) is True)


def unexplained(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors that stop a robot and leave open whether they are about the VDA order.

    VDA 5050 3.0 section 6.6.5.1.
    """
    return tuple(error for error in _new_stops(errors, before) if _is_about(error, vda_order) is None)


def of_action(errors: Iterable[ErrorEntry], action_id: str) -> Iterator[str]:
    """Return the robot's texts about an action."""
    return (in_words(error) for error in errors if action_id in _referenced(error, "actionId"))


def _new_stops(errors: Iterable[ErrorEntry], before: frozenset[ErrorIdentity]) -> Iterator[ErrorEntry]:
    for error in errors:
        stops = error.error_level in STOPPING or error.error_type in UNREACHABLE
        if stops and error.error_type not in ORDER_REFUSALS and identity(error) not in before:
            yield error


def _is_about(error: ErrorEntry, vda_order: VdaOrder) -> bool | None:
    """Return whether the error names the VDA order or a part of it; None if it names none at all."""
    orders = _referenced(error, "orderId")
    if orders:
        return vda_order.order_id in orders
    parts = (
        _referenced(error, "nodeId") & {node.node_id for node in vda_order.nodes},
        _referenced(error, "edgeId") & {edge.edge_id for edge in vda_order.edges},
        _referenced(error, "actionId") & vda_order.action_ids,
    )
    return True if any(parts) else None


def _referenced(error: ErrorEntry, key: str) -> set[str]:
    return {each.reference_value for each in error.error_references if each.reference_key == key}


class RobotBusyError(Exception):
    """The robot has a VDA order already; end that one first."""

    def __init__(self, robot: RobotKey, order_id: str) -> None:
        super().__init__(f"robot {robot} has the VDA order {order_id!r}; a robot has one VDA order at a time")
        self.robot = robot
        self.order_id = order_id
