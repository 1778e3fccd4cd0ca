"""Failures of VDA orders: their kinds, and what the errors of a state mean for an order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.fleet_api.reasons import Reason, ReasonCode, StoredReason
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.v2_1.state import REJECTIONS, WRITTEN

R = ReasonCode


class FailureKind(StrEnum):
    """How a VDA order failed; this determines how much is known about its progress."""

    REFUSED = "REFUSED"
    """The robot has refused it, or already has an order."""
    UNFIT = "UNFIT"
    """By its factsheet, the robot cannot execute it; nothing was sent."""
    NOT_TAKEN = "NOT_TAKEN"
    """It was resent repeatedly, but the robot never accepted it."""
    DRIVE = "DRIVE"
    """The robot had it but could not continue, or abandoned it; its operation was not executed."""
    ACTION = "ACTION"
    """The robot has reached the end of the route, where its operation has FAILED."""
    LOST = "LOST"
    """The robot had it but no longer does."""
    UNCLEAR = "UNCLEAR"
    """It is unknown what the robot has executed, or whether it still executes it."""
    NO_WAY = "NO_WAY"
    """There is currently no route to the destination; nothing was sent."""


@dataclass(frozen=True, slots=True)
class OrderFailure:
    """A failure of an order at its vehicle: kind and description; ``ahead`` names the next path and point."""

    kind: FailureKind
    words: StoredReason
    ahead: tuple[str, ...] = ()
    by_device: bool = False
    """Whether a peripheral device has failed, not the robot."""


NO_ORDER_REFUSALS: Final = frozenset({ErrorType.NO_ORDER_TO_CANCEL, ErrorType.INVALID_INSTANT_ACTION})

ORDER_REFUSALS: Final[frozenset[str]] = frozenset(
    name for kind in REJECTIONS - NO_ORDER_REFUSALS for name in (kind, WRITTEN[kind])
)
"""Error types with which robots refuse orders, in the spelling of all versions (section 6.1.4)."""

UNREACHABLE: Final[frozenset[str]] = frozenset(
    {ErrorType.NODE_UNREACHABLE, WRITTEN[ErrorType.NODE_UNREACHABLE]}
)

NO_NAVIGATION: Final[frozenset[str]] = frozenset(
    {ErrorType.NAVIGATION_NOT_AVAILABLE, WRITTEN[ErrorType.NAVIGATION_NOT_AVAILABLE]}
)

STOPPING: Final = frozenset({ErrorLevel.CRITICAL, ErrorLevel.FATAL})
"""Error levels at which a robot does not continue."""


ErrorIdentity = tuple[str, frozenset[tuple[str, str]]]


def identity(error: ErrorEntry) -> ErrorIdentity:
    """Return the fields that identify an error in later states, in which its texts may differ."""
    return error.error_type, frozenset(
        (reference.reference_key, reference.reference_value) for reference in error.error_references
    )


def describe(error: ErrorEntry) -> str:
    """Return the robot's description of an error."""
    text = f"{error.error_type}: {error.error_description}" if error.error_description else error.error_type
    return f"{text} ({error.error_hint})" if error.error_hint else text


def with_details(reason: Reason, details: Iterable[str]) -> Reason:
    """Append the robot's own error texts to a reason."""
    described = [*details]
    return Reason(R.DETAILS, reason, *described) if "".join(described) else reason


def fatal(errors: Iterable[ErrorEntry]) -> ErrorEntry | None:
    """Return the first error of level FATAL, which needs human intervention (section 6.6.5.1); or None."""
    return next((error for error in errors if error.error_level is ErrorLevel.FATAL), None)


def no_navigation(errors: Iterable[ErrorEntry]) -> ErrorEntry | None:
    """Return the error with which a robot reports that its navigation is not available; or None."""
    return next((error for error in errors if error.error_type in NO_NAVIGATION), None)


def refusals(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors with which the robot refuses the VDA order (section 6.1.4).

    They name its orderId; or, because 2.x does not require references, they have the type of a refusal, name
    neither an order nor another action, and were not reported ``before`` the VDA order was sent.
    """
    return tuple(error for error in errors if _refuses_order(error, vda_order, before))


def _refuses_order(error: ErrorEntry, vda_order: VdaOrder, before: frozenset[ErrorIdentity]) -> bool:
    named = _referenced_values(error, "orderId")
    if named:
        return vda_order.order_id in named
    explained = identity(error) in before or of_another_action(error, vda_order) or _of_another_topic(error)
    return error.error_type in ORDER_REFUSALS and not explained


def is_named(error: ErrorEntry, vda_order: VdaOrder) -> bool:
    """Return whether an error names the VDA order or one of its actions (section 6.6.5.2)."""
    return vda_order.order_id in _referenced_values(error, "orderId") or bool(
        _referenced_values(error, "actionId") & vda_order.action_ids
    )


def _of_another_topic(error: ErrorEntry) -> bool:
    """Return whether an error names other topics, but not ``order``: it refuses a different message."""
    topics = _referenced_values(error, "topic")
    return bool(topics) and Topic.ORDER not in topics


def of_another_action(error: ErrorEntry, vda_order: VdaOrder) -> bool:
    """Return whether an error names only actions outside the VDA order: it refuses an instant action."""
    actions = _referenced_values(error, "actionId")
    return bool(actions) and actions.isdisjoint(vda_order.action_ids)


def name_actions(errors: Iterable[ErrorEntry]) -> bool:
    """Return whether any of the errors names an action (section 6.6.5.2)."""
    return any(_referenced_values(error, "actionId") for error in errors)


def refuses_update(error: ErrorEntry, order_id: str, update_id: int) -> bool:
    """Return whether an error refuses an update of the robot's current order (section 6.1.4).

    It names the orderUpdateId; in 2.x, an error without references may also be about the update.
    """
    orders, updates = _referenced_values(error, "orderId"), _referenced_values(error, "orderUpdateId")
    foreign = _of_another_topic(error) or (orders and order_id not in orders)
    if error.error_type not in ORDER_REFUSALS or foreign:
        return False
    return str(update_id) in updates if updates else True


def names_update(error: ErrorEntry) -> bool:
    """Return whether an error names an orderUpdateId (section 6.6.5.2)."""
    return bool(_referenced_values(error, "orderUpdateId"))


def about(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors because of which the robot cannot continue the VDA order (section 6.6.5.1)."""
    return tuple(error for error in _new_stops(errors, before) if _is_about(error, vda_order) is True)


def unexplained(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors that stop a robot but do not reference any order (section 6.6.5.1)."""
    return tuple(error for error in _new_stops(errors, before) if _is_about(error, vda_order) is None)


def of_action(errors: Iterable[ErrorEntry], action_id: str) -> Iterator[str]:
    """Return the descriptions of all errors that name an action."""
    return (describe(error) for error in errors if action_id in _referenced_values(error, "actionId"))


def _new_stops(errors: Iterable[ErrorEntry], before: frozenset[ErrorIdentity]) -> Iterator[ErrorEntry]:
    for error in errors:
        stops = error.error_level in STOPPING or error.error_type in UNREACHABLE
        if stops and error.error_type not in ORDER_REFUSALS and identity(error) not in before:
            yield error


def _is_about(error: ErrorEntry, vda_order: VdaOrder) -> bool | None:
    """Return whether an error names the VDA order or a part of it; None if it names no order."""
    orders = _referenced_values(error, "orderId")
    if orders:
        return vda_order.order_id in orders
    parts = (
        _referenced_values(error, "nodeId") & {node.node_id for node in vda_order.nodes},
        _referenced_values(error, "edgeId") & {edge.edge_id for edge in vda_order.edges},
        _referenced_values(error, "actionId") & vda_order.action_ids,
    )
    return True if any(parts) else None


def _referenced_values(error: ErrorEntry, key: str) -> set[str]:
    return {
        reference.reference_value for reference in error.error_references if reference.reference_key == key
    }


class RobotBusyError(Exception):
    """The robot already has a VDA order, which must end first."""

    def __init__(self, robot: RobotKey, order_id: str) -> None:
        super().__init__(f"robot {robot} has the VDA order {order_id!r}; a robot has one VDA order at a time")
        self.robot = robot
        self.order_id = order_id
