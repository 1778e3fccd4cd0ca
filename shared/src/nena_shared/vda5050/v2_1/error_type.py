"""Names of errors in 2.x (2.1 sections 6.6.4 and 6.10.5): fewer, and in camel case."""

from __future__ import annotations

from nena_shared.vda5050.error import ErrorType

WRITTEN: dict[str, str] = {
    ErrorType.VALIDATION_FAILURE: "validationError",
    ErrorType.MOBILE_ROBOT_NOT_AVAILABLE: "orderError",
    ErrorType.INSUFFICIENT_MEMORY: "orderError",
    ErrorType.UNSUPPORTED_PARAMETER: "orderError",
    ErrorType.INVALID_ORDER_ACTION: "orderError",
    ErrorType.UNKNOWN_MAP_ID: "orderError",
    ErrorType.OTHER_ORDER_ACTIVE: "orderUpdateError",
    ErrorType.OUTDATED_ORDER_UPDATE: "orderUpdateError",
    ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL: "orderUpdateError",
    ErrorType.SAME_ORDER_UPDATE_ID: "orderUpdateError",
    ErrorType.START_NODE_OUT_OF_RANGE: "noRouteError",
    ErrorType.NO_ROUTE_TO_TARGET: "noRouteError",
    ErrorType.NO_ORDER_TO_CANCEL: "noOrderToCancel",
    ErrorType.INVALID_INSTANT_ACTION: "instantActionError",
    ErrorType.NODE_UNREACHABLE: "nodeUnreachable",
    ErrorType.LOCALIZATION_ERROR: "localizationError",
    ErrorType.OUTSIDE_OF_CORRIDOR: "outsideOfCorridor",
    ErrorType.DUPLICATE_MAP: "duplicateMap",
    ErrorType.DUPLICATE_ZONE_SET: "duplicateZoneSet",
    ErrorType.BLOCKED_ZONE_VIOLATION: "blockedZoneViolation",
    ErrorType.RELEASE_LOST: "releaseLost",
    ErrorType.ZONE_ACTION_CONFLICT: "zoneActionConflict",
    ErrorType.INSTANT_ACTION_STATES_FULL: "instantActionStatesFull",
    ErrorType.ZONE_ACTION_STATES_FULL: "zoneActionStatesFull",
    ErrorType.ACTION_FAILED: "actionFailed",
    ErrorType.NAVIGATION_NOT_AVAILABLE: "navigationNotAvailable",
}
"""What a neutral error type is called in a 2.x state."""

REJECTIONS: frozenset[str] = frozenset(
    {
        ErrorType.VALIDATION_FAILURE,
        ErrorType.MOBILE_ROBOT_NOT_AVAILABLE,
        ErrorType.INSUFFICIENT_MEMORY,
        ErrorType.UNSUPPORTED_PARAMETER,
        ErrorType.INVALID_ORDER_ACTION,
        ErrorType.UNKNOWN_MAP_ID,
        ErrorType.OTHER_ORDER_ACTIVE,
        ErrorType.OUTDATED_ORDER_UPDATE,
        ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL,
        ErrorType.SAME_ORDER_UPDATE_ID,
        ErrorType.START_NODE_OUT_OF_RANGE,
        ErrorType.NO_ROUTE_TO_TARGET,
        ErrorType.NO_ORDER_TO_CANCEL,
        ErrorType.INVALID_INSTANT_ACTION,
    }
)
"""Errors that refuse a message and leave the robot as it was: in 2.x always of level WARNING."""
