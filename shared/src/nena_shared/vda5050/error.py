"""Errors as robots report them (VDA 5050 3.0 section 6.6.5)."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.vda5050.base import WireObject


class ErrorLevel(StrEnum):
    """Severity of an error (section 6.6.5.1); 2.x has only WARNING and FATAL."""

    WARNING = "WARNING"
    """The robot continues its order and accepts new ones."""
    URGENT = "URGENT"
    """Like WARNING, but needs attention soon."""
    CRITICAL = "CRITICAL"
    """The robot cannot continue its order, but accepts new ones."""
    FATAL = "FATAL"
    """A person has to intervene."""


class ErrorType(StrEnum):
    """Error types of the standard (section 6.6.5), and NeNa's additions to this open list."""

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
    """Since 3.0.1; 3.0.0 describes the warning without naming it."""
    ZONE_ACTION_CONFLICT = "ZONE_ACTION_CONFLICT"
    NODE_UNREACHABLE = "NODE_UNREACHABLE"
    LOCALIZATION_ERROR = "LOCALIZATION_ERROR"
    INSTANT_ACTION_STATES_FULL = "INSTANT_ACTION_STATES_FULL"
    ZONE_ACTION_STATES_FULL = "ZONE_ACTION_STATES_FULL"
    ACTION_FAILED = "ACTION_FAILED"
    NAVIGATION_NOT_AVAILABLE = "NAVIGATION_NOT_AVAILABLE"
    """The robot is waiting for its navigation. A WARNING, as the order then continues automatically."""


class ErrorReference(WireObject):
    """The subject of an error, e.g. ``orderId`` and its value (section 6.6.5)."""

    reference_key: str
    reference_value: str


class Translation(WireObject):
    """A text in another language, with its ISO 639-1 code (section 6.6.5)."""

    translation_key: str
    translation_value: str


class ErrorEntry(WireObject):
    """An active error; ``error_type`` is an open list: treat unknown types by level (section 6.6.5)."""

    error_type: str
    error_level: ErrorLevel
    error_references: tuple[ErrorReference, ...] = ()
    error_description: str | None = None
    error_description_translations: tuple[Translation, ...] | None = None
    error_hint: str | None = None
    error_hint_translations: tuple[Translation, ...] | None = None

    def with_level(self, level: ErrorLevel) -> ErrorEntry:
        """Return the error with another level."""
        return self.model_copy(update={"error_level": level})


LEVELS: dict[str, ErrorLevel] = {
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
"""Error levels (section 6.6.5.4); all other types are WARNING."""


def error(
    kind: ErrorType | str,
    description: str,
    *,
    hint: str | None = None,
    **references: str | int | None,
) -> ErrorEntry:
    """Create an error with the level of its type (section 6.6.5).

    Reference keys are converted to camel case: ``order_id="o1"`` becomes ``orderId``. References that are
    None are omitted.
    """
    return ErrorEntry(
        error_type=str(kind),
        error_level=LEVELS.get(kind, ErrorLevel.WARNING),
        error_description=description,
        error_hint=hint,
        error_references=tuple(
            ErrorReference(reference_key=_camel_case(key), reference_value=str(value))
            for key, value in references.items()
            if value is not None
        ),
    )


def _camel_case(name: str) -> str:
    first, *rest = name.split("_")
    return first + "".join(part.capitalize() for part in rest)
