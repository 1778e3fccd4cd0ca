"""Codes of the entries in a transport order's history."""

from enum import StrEnum


class EventCode(StrEnum):
    """What happened to a transport order; the supplements of an entry say why, in words."""

    ORDER_CREATED = "nena:orderCreated"
    DISPATCHING_DEFERRED = "nena:dispatchingDeferred"
    """It may be dispatched, but not yet; deferrals in a row are one entry, which has the latest reason."""
    ASSIGNED_TO_VEHICLE = "nena:assignedToVehicle"
    OPERATION_STARTED = "nena:operationStarted"
    DRIVE_ORDER_FINISHED = "nena:driveOrderFinished"
    HELD = "nena:held"
    RESUMED = "nena:resumed"
    RETRIED = "nena:retried"
    REPLANNED = "nena:replanned"
    REASSIGNED = "nena:reassigned"
    SKIPPED = "nena:skipped"
    DEADLINE_PASSED = "nena:deadlinePassed"
    REROUTED = "nena:rerouted"
    WITHDRAWAL_REQUESTED = "nena:withdrawalRequested"
    ADOPTED_AFTER_RESTART = "nena:adoptedAfterRestart"
    FINAL_STATE_REACHED = "nena:finalStateReached"
