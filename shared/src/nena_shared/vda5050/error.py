"""Errors as robots report them (VDA 5050 3.0 section 6.6.5)."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.vda5050.base import WireObject


class ErrorLevel(StrEnum):
    """How bad an error is (section 6.6.5.1); 2.x has only WARNING and FATAL."""

    WARNING = "WARNING"
    """The robot continues its order and accepts new ones."""
    URGENT = "URGENT"
    """As WARNING, but needs attention soon."""
    CRITICAL = "CRITICAL"
    """The robot cannot continue its order, but accepts new ones."""
    FATAL = "FATAL"
    """A person is needed."""


class ErrorType(StrEnum):
    """The error types of the standard (section 6.6.5), and those that this robot adds to its open list."""

    UNSUPPORTED_PARAMETER = "UNSUPPORTED_PARAMETER"
    NO_ORDER_TO_CANCEL = "NO_ORDER_TO_CANCEL"
    VALIDATION_FAILURE = "VALIDATION_FAILURE"
    INVALID_ORDER_ACTION = "INVALID_ORDER_ACTION"
    INVALID_INSTANT_ACTION = "INVALID_INSTANT_ACTION"
    OUTDATED_ORDER_UPDATE = "OUTDATED_ORDER_UPDATE"
    SAME_ORDER_UPDATE_ID = "SAME_ORDER_UPDATE_ID"
    ORDER_UPDATE_FOLLOWING_CANCEL = "ORDER_UPDATE_FOLLOWING_CANCEL"
    OTHER_ORDER_ACTIVE = "OTHER_ORDER_ACTIVE"
    START_NODE_OUT_OF_RANGE = "START_NODE_OUT_OF_RANGE"
    NO_ROUTE_TO_TARGET = "NO_ROUTE_TO_TARGET"
    MOBILE_ROBOT_NOT_AVAILABLE = "MOBILE_ROBOT_NOT_AVAILABLE"
    UNKNOWN_MAP_ID = "UNKNOWN_MAP_ID"
    INSUFFICIENT_MEMORY = "INSUFFICIENT_MEMORY"
    OUTSIDE_OF_CORRIDOR = "OUTSIDE_OF_CORRIDOR"
    DUPLICATE_MAP = "DUPLICATE_MAP"
    DUPLICATE_ZONE_SET = "DUPLICATE_ZONE_SET"
    BLOCKED_ZONE_VIOLATION = "BLOCKED_ZONE_VIOLATION"
    RELEASE_LOST = "RELEASE_LOST"
    RELEASE_LOSS_HANDLING = "RELEASE_LOSS_HANDLING"
    """Named by 3.0.1; 3.0.0 has the warning, but no name for it."""
    ZONE_ACTION_CONFLICT = "ZONE_ACTION_CONFLICT"
    NODE_UNREACHABLE = "NODE_UNREACHABLE"
    LOCALIZATION_ERROR = "LOCALIZATION_ERROR"
    INSTANT_ACTION_STATES_FULL = "INSTANT_ACTION_STATES_FULL"
    ZONE_ACTION_STATES_FULL = "ZONE_ACTION_STATES_FULL"
    ACTION_FAILED = "ACTION_FAILED"
    NAVIGATION_NOT_AVAILABLE = "NAVIGATION_NOT_AVAILABLE"
    """The robot waits for its own navigation. Its order continues without help, hence a WARNING."""


class ErrorReference(WireObject):
    """What an error is about, e.g. ``orderId`` and its value (section 6.6.5)."""

    reference_key: str
    reference_value: str


class Translation(WireObject):
    """The same text in another language, with its ISO 639-1 code (section 6.6.5)."""

    translation_key: str
    translation_value: str


class ErrorEntry(WireObject):
    """One active error; ``error_type`` is an open list, judge an unknown one by its level (section 6.6.5)."""

    error_type: str
    error_level: ErrorLevel
    error_references: tuple[ErrorReference, ...] = ()
    error_description: str | None = None
    error_description_translations: tuple[Translation, ...] | None = None
    error_hint: str | None = None
    error_hint_translations: tuple[Translation, ...] | None = None


LEVELS: dict[ErrorType, ErrorLevel] = {
    ErrorType.UNSUPPORTED_PARAMETER: ErrorLevel.CRITICAL,
    ErrorType.INSUFFICIENT_MEMORY: ErrorLevel.URGENT,
    ErrorType.OUTSIDE_OF_CORRIDOR: ErrorLevel.CRITICAL,
    ErrorType.BLOCKED_ZONE_VIOLATION: ErrorLevel.CRITICAL,
    ErrorType.RELEASE_LOST: ErrorLevel.CRITICAL,
    ErrorType.ZONE_ACTION_CONFLICT: ErrorLevel.CRITICAL,
    ErrorType.NODE_UNREACHABLE: ErrorLevel.CRITICAL,
    ErrorType.LOCALIZATION_ERROR: ErrorLevel.FATAL,
    ErrorType.INSTANT_ACTION_STATES_FULL: ErrorLevel.URGENT,
    ErrorType.ZONE_ACTION_STATES_FULL: ErrorLevel.URGENT,
    ErrorType.ACTION_FAILED: ErrorLevel.CRITICAL,
}
"""Levels by the table of section 6.6.5.4; every type that is not here is a WARNING."""


def error(
    kind: ErrorType, description: str, *, hint: str | None = None, **references: str | int | None
) -> ErrorEntry:
    """Make an error with the level of its type; references that are None are left out (section 6.6.5).

    The keys are given in snake case and sent in camel case: ``order_id="o1"`` becomes ``orderId``.
    """
    return ErrorEntry(
        error_type=kind.value,
        error_level=LEVELS.get(kind, ErrorLevel.WARNING),
        error_description=description,
        error_hint=hint,
        error_references=tuple(
            ErrorReference(reference_key=_camel(key), reference_value=str(value))
            for key, value in references.items()
            if value is not None
        ),
    )


def _camel(name: str) -> str:
    first, *rest = name.split("_")
    return first + "".join(part.capitalize() for part in rest)
