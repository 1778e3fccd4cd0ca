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
    name for kind in REJECTIONS.keys() - NO_ORDER_REFUSALS for name in (kind, WRITTEN[kind])
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


def identity_of(error: ErrorEntry) -> ErrorIdentity:
    """Return the fields that identify an error in later states, in which its texts may differ."""
    return error.error_type, frozenset(
        (reference.reference_key, reference.reference_value) for reference in error.error_references
    )


def describe_error(error: ErrorEntry) -> str:
    """Return the robot's description of an error."""
    text = f"{error.error_type}: {error.error_description}" if error.error_description else error.error_type
    return f"{text} ({error.error_hint})" if error.error_hint else text


def with_details(reason: Reason, details: Iterable[str]) -> Reason:
    """Append the robot's own error texts to a reason."""
    described = [*details]
    return Reason(R.DETAILS, reason, *described) if "".join(described) else reason


def first_fatal(errors: Iterable[ErrorEntry]) -> ErrorEntry | None:
    """Return the first error of level FATAL, which needs human intervention (section 6.6.5.1); or None."""
    return next((error for error in errors if error.error_level is ErrorLevel.FATAL), None)


def refusals(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors with which the robot refuses the VDA order (section 6.1.4).

    They were not reported ``before`` the VDA order was sent, unless they name it.
    """
    # 2.x does not require references: an error without any counts by its type, as long as nothing else
    # explains it.
    refusing: list[ErrorEntry] = []
    for error in errors:
        if named := values_named_by(error, "orderId"):
            refuses = vda_order.order_id in named
        else:
            is_explained = (
                identity_of(error) in before
                or is_of_another_action(error, vda_order)
                or _is_of_another_topic(error)
            )
            refuses = error.error_type in ORDER_REFUSALS and not is_explained
        if refuses:
            refusing.append(error)
    return tuple(refusing)


def is_named(error: ErrorEntry, vda_order: VdaOrder) -> bool:
    """Return whether an error names the VDA order or one of its actions (section 6.6.5.2)."""
    return vda_order.order_id in values_named_by(error, "orderId") or bool(
        values_named_by(error, "actionId") & vda_order.action_ids
    )


def _is_of_another_topic(error: ErrorEntry) -> bool:
    """Return whether an error names other topics, but not ``order``: it refuses a different message."""
    topics = values_named_by(error, "topic")
    return bool(topics) and Topic.ORDER not in topics


def is_of_another_action(error: ErrorEntry, vda_order: VdaOrder) -> bool:
    """Return whether an error names only actions outside the VDA order: it refuses an instant action."""
    actions = values_named_by(error, "actionId")
    return bool(actions) and actions.isdisjoint(vda_order.action_ids)


def refuses_update(error: ErrorEntry, order_id: str, update_id: int) -> bool:
    """Return whether an error refuses an update of the robot's current order (section 6.1.4).

    It names the orderUpdateId; in 2.x, an error without references may also be about the update.
    """
    orders, updates = values_named_by(error, "orderId"), values_named_by(error, "orderUpdateId")
    foreign = _is_of_another_topic(error) or (orders and order_id not in orders)
    if error.error_type not in ORDER_REFUSALS or foreign:
        return False
    return str(update_id) in updates if updates else True


def stopping_errors(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors because of which the robot cannot continue the VDA order (section 6.6.5.1)."""
    return tuple(error for error in _new_stops(errors, before) if _names_order(error, vda_order) is True)


def unexplained_stops(
    errors: Iterable[ErrorEntry], vda_order: VdaOrder, before: frozenset[ErrorIdentity]
) -> tuple[ErrorEntry, ...]:
    """Return the errors that stop a robot but do not reference any order (section 6.6.5.1)."""
    return tuple(error for error in _new_stops(errors, before) if _names_order(error, vda_order) is None)


def _new_stops(errors: Iterable[ErrorEntry], before: frozenset[ErrorIdentity]) -> Iterator[ErrorEntry]:
    for error in errors:
        stops = error.error_level in STOPPING or error.error_type in UNREACHABLE
        if stops and error.error_type not in ORDER_REFUSALS and identity_of(error) not in before:
            yield error


def _names_order(error: ErrorEntry, vda_order: VdaOrder) -> bool | None:
    """Return whether an error names the VDA order or a part of it; None if it names no order."""
    orders = values_named_by(error, "orderId")
    if orders:
        return vda_order.order_id in orders
    parts = (
        values_named_by(error, "nodeId") & {node.node_id for node in vda_order.nodes},
        values_named_by(error, "edgeId") & {edge.edge_id for edge in vda_order.edges},
        values_named_by(error, "actionId") & vda_order.action_ids,
    )
    return True if any(parts) else None


def values_named_by(error: ErrorEntry, key: str) -> set[str]:
    """Return the values of an error's references with this key (section 6.6.5.2)."""
    return {
        reference.reference_value for reference in error.error_references if reference.reference_key == key
    }


class RobotBusyError(Exception):
    """The robot already has a VDA order, which must end first."""

    def __init__(self, robot: RobotKey, order_id: str) -> None:
        super().__init__(f"robot {robot} has the VDA order {order_id!r}; a robot has one VDA order at a time")
        self.robot = robot
        self.order_id = order_id
