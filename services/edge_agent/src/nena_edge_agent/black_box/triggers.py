"""Events of a robot that start a recording."""

from __future__ import annotations

from enum import StrEnum

from nena_edge_agent.driver.port import DriveFailed
from nena_edge_agent.protocol import events
from nena_edge_agent.protocol.errors import error_key
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.state import EmergencyStop

SERIOUS = (ErrorLevel.CRITICAL, ErrorLevel.FATAL)


class Reason(StrEnum):
    """Why a file was written; part of its name."""

    DRIVE_FAILED = "drive-failed"
    EMERGENCY_STOP = "emergency-stop"
    ERROR = "error"


class Triggers:
    """Finds failures when they begin."""

    def __init__(self) -> None:
        self._stopped = False
        self._errors: tuple[ErrorEntry, ...] = ()

    def note(self, event: events.Event, errors: tuple[ErrorEntry, ...]) -> Reason | None:
        """Handle an event and the robot's active errors after it; return why to record, if at all."""
        found = self._new_error(errors)
        match event:
            case DriveFailed():
                return Reason.DRIVE_FAILED
            case events.SafetyReport(emergency_stop=stop):
                before, self._stopped = self._stopped, stop is not EmergencyStop.NONE
                return Reason.EMERGENCY_STOP if self._stopped and not before else found
            case _:
                return found

    def _new_error(self, errors: tuple[ErrorEntry, ...]) -> Reason | None:
        if errors is self._errors:
            return None
        before = {error_key(each) for each in self._errors}
        self._errors = errors
        serious = (each for each in errors if each.error_level in SERIOUS)
        return Reason.ERROR if any(error_key(each) not in before for each in serious) else None
