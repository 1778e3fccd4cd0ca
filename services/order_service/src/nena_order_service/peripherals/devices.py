"""Devices: the state and the current job of each, and when that is sent again or fails."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from math import isfinite
from typing import Final

from nena_order_service.peripherals.settings import PeripheralSettings
from nena_shared.fleet_api.peripherals import DeviceJobState, PeripheralState
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import Location

R = ReasonCode

EXECUTION_TIMEOUT = "nena:executionTimeout"
"""Location property: time from the acknowledgement to the end of a job, seconds."""


class Verdict(Enum):
    """What a device's answer means."""

    ACCEPTED = auto()
    """It has acknowledged the job that it was sent."""
    FINISHED = auto()
    FAILED = auto()
    IGNORED = auto()
    """It repeats itself, or answers about a job that it does not have."""


_VERDICTS: Final = {
    DeviceJobState.ACKNOWLEDGED: Verdict.ACCEPTED,
    DeviceJobState.FINISHED: Verdict.FINISHED,
    DeviceJobState.FAILED: Verdict.FAILED,
}


@dataclass(slots=True)
class _Execution:
    """A job that a device has been sent; times are monotonic, seconds."""

    job: str
    since: float
    """When it was last sent or, if acknowledged, when that was."""
    sends: int = 1
    acknowledged: bool = False

    def restart(self, now: float) -> None:
        """Count from now on, as if it had not been sent before."""
        self.since, self.sends = now, 1


@dataclass(frozen=True, slots=True)
class Overdue:
    """A job whose device has not answered in time; ``reason`` None: send it again."""

    job: str
    location: str
    reason: Reason | None = None


class Devices:
    """Tracks which job each device executes; a device executes one at a time. Pure: times are passed in."""

    def __init__(self, settings: PeripheralSettings) -> None:
        self._settings = settings
        self._states: dict[str, PeripheralState] = {}
        self._executions: dict[str, _Execution] = {}
        self._timeouts: dict[str, float] = {}

    def expect(self, location: Location) -> None:
        """Read the timeout of a device from its location; an unreadable one is ignored."""
        try:
            seconds = float(location.properties.get(EXECUTION_TIMEOUT, ""))
        except ValueError:
            return
        if isfinite(seconds) and seconds > 0:
            self._timeouts[location.name] = seconds

    def state(self, location: str) -> PeripheralState:
        """Return a device's own state; EXECUTING while it has a job, unless it reports a problem."""
        reported = self.reported(location)
        return PeripheralState.EXECUTING if reported.takes_jobs and location in self._executions else reported

    def reported(self, location: str) -> PeripheralState:
        """Return the state that a device has reported last."""
        return self._states.get(location, PeripheralState.UNKNOWN)

    def report(self, location: str, state: PeripheralState, now: float) -> bool:
        """Note a device's own state; return whether it is to be sent its job again, because it is back.

        The job of a device that becomes unavailable has the whole execution timeout from then on.
        """
        previous, self._states[location] = self.reported(location), state
        execution = self._executions.get(location)
        if execution is None or previous.takes_jobs == state.takes_jobs:
            return False
        execution.restart(now)
        return state.takes_jobs

    def job(self, location: str) -> str | None:
        """Return the name of the job that a device executes."""
        execution = self._executions.get(location)
        return execution.job if execution else None

    def acknowledged(self, location: str) -> bool:
        """Return whether a device has acknowledged its job."""
        execution = self._executions.get(location)
        return execution is not None and execution.acknowledged

    def is_free(self, location: str) -> bool:
        """Return whether a device can be sent a job."""
        return self.reported(location).takes_jobs and location not in self._executions

    def begin(self, location: str, job: str, now: float) -> None:
        """Note that a device is sent a job."""
        self._executions[location] = _Execution(job, now)

    def end(self, location: str, job: str) -> None:
        """Note that a job has ended, by an answer or otherwise."""
        if self.job(location) == job:
            del self._executions[location]

    def awaits(self, location: str, job: str, state: DeviceJobState) -> bool:
        """Return whether an answer says anything new about the job that a device executes."""
        execution = self._executions.get(location)
        if execution is None or execution.job != job:
            return False
        # MQTT's QoS 1 may deliver an answer twice, and a device answers each sending of a job.
        return state is not DeviceJobState.ACKNOWLEDGED or not execution.acknowledged

    def answer(self, location: str, job: str, state: DeviceJobState, now: float) -> Verdict:
        """Note a device's answer. After the end of a job, the caller calls :meth:`end`."""
        if not self.awaits(location, job, state):
            return Verdict.IGNORED
        if state is DeviceJobState.ACKNOWLEDGED:
            execution = self._executions[location]
            execution.acknowledged, execution.since = True, now
        return _VERDICTS[state]

    def overdue(self, now: float) -> list[Overdue]:
        """Return the jobs whose devices have not answered in time; those to be sent again count as sent."""
        overdue = []
        for location, execution in self._executions.items():
            waited, state = now - execution.since, self.reported(location)
            # A device that is away cannot acknowledge, so sending again is of no use.
            if execution.acknowledged or not state.takes_jobs:
                timeout = self._timeouts.get(location, self._settings.execution_timeout)
                if waited >= timeout:
                    slow = Reason(R.DEVICE_SLOW, location=location, limit=timeout)
                    if not state.takes_jobs:
                        slow = Reason(R.DEVICE_SLOW_REPORTS, location=location, limit=timeout, reported=state)
                    overdue.append(Overdue(execution.job, location, slow))
            elif waited >= self._settings.acknowledge_timeout:
                if execution.sends < self._settings.sends:
                    execution.sends, execution.since = execution.sends + 1, now
                    overdue.append(Overdue(execution.job, location))
                else:
                    silent = Reason(R.DEVICE_SILENT, location=location, count=execution.sends)
                    overdue.append(Overdue(execution.job, location, silent))
        return overdue

    def restart_times(self, now: float) -> None:
        """Let all times begin now, because devices could not be reached before."""
        for execution in self._executions.values():
            execution.restart(now)
