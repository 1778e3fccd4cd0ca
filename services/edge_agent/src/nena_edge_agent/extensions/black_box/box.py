"""The black box of a robot: records its messages and journal, and writes files on failures or requests."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from typing import Final

from nena_edge_agent.actions.plugin import BackgroundAction, Report, RunningAction, WorkFailedError
from nena_edge_agent.driver.port import DriveFailed
from nena_edge_agent.extensions.black_box.ros import ros_schema
from nena_edge_agent.extensions.black_box.settings import BlackBoxSettings
from nena_edge_agent.protocol import events
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.errors import error_key
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.clock import Clock
from nena_shared.extensions.black_box.box import BlackBox, Outgoing, Source
from nena_shared.extensions.black_box.ring import Channel
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.own_actions import FETCH_RECORDING
from nena_shared.vda5050.state import EmergencyStop, Load
from nena_shared.vda5050.topics import RobotKey

DISTRIBUTION: Final = "nena-edge-agent"
JOURNAL: Final = Channel("/nena/journal")
SERIOUS: Final = (ErrorLevel.CRITICAL, ErrorLevel.FATAL)


class Trigger(StrEnum):
    """Why a file was written; part of its name."""

    DRIVE_FAILED = "drive-failed"
    EMERGENCY_STOP = "emergency-stop"
    ERROR = "error"


class Triggers:
    """Finds failures when they begin."""

    def __init__(self) -> None:
        self._stopped = False
        self._errors: tuple[ErrorEntry, ...] = ()

    def check_event(self, event: events.Event, errors: tuple[ErrorEntry, ...]) -> Trigger | None:
        """Handle an event and the robot's active errors after it; return why to record, if at all."""
        error_trigger = self._new_error(errors)
        match event:
            case DriveFailed():
                return Trigger.DRIVE_FAILED
            case events.SafetyReport(emergency_stop=stop):
                was_stopped, self._stopped = self._stopped, stop is not EmergencyStop.NONE
                return Trigger.EMERGENCY_STOP if self._stopped and not was_stopped else error_trigger
            case _:
                return error_trigger

    def _new_error(self, errors: tuple[ErrorEntry, ...]) -> Trigger | None:
        # The core keeps the same tuple while the errors do not change: most events end here.
        if errors is self._errors:
            return None
        known_keys = {error_key(error) for error in self._errors}
        self._errors = errors
        serious = (error for error in errors if error.error_level in SERIOUS)
        return Trigger.ERROR if any(error_key(error) not in known_keys for error in serious) else None


class RobotBlackBox(BlackBox):
    """Records one robot, also over restarts of its agent within the program."""

    def __init__(self, robot: RobotKey, settings: BlackBoxSettings, outgoing: Outgoing, clock: Clock) -> None:
        super().__init__(Source(robot, DISTRIBUTION, ros_schema), settings, outgoing, clock)
        self._sent: dict[str, Channel] = {}
        self._received: dict[str, Channel] = {}
        self._triggers = Triggers()

    def record_message(self, topic: str, payload: bytes, *, own: bool = True) -> None:
        """Record a message of VDA 5050; ``own``: the agent has made it."""
        channels = self._sent if own else self._received
        channel = channels.get(topic)
        if channel is None:
            # 0061: others' payloads are checked to be JSON, because a bad one would spoil its whole topic.
            channel = channels[topic] = Channel(topic, own=own)
        self.ring.add(channel, payload, self._clock.monotonic())

    def record_journal(self, record: bytes) -> None:
        """Record a record of the robot's journal; called in the thread that writes it."""
        self.ring.add(JOURNAL, record, self._clock.monotonic())

    def handle_event(self, event: events.Event, errors: tuple[ErrorEntry, ...]) -> None:
        """Handle an event of the robot, and its active errors after it: a failure starts a recording."""
        if reason := self._triggers.check_event(event, errors):
            self.fail(reason)


class FetchRecording:
    """Writes a recording; the file's name is the action's result."""

    declaration = ActionDeclaration(
        FETCH_RECORDING,
        scopes=(ActionScope.INSTANT,),
        restartable=True,
        description="Writes the robot's last minutes to a file, and sends it to the status aggregator.",
    )

    def __init__(self, box: RobotBlackBox) -> None:
        self._box = box

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Write the file in the background; it is sent after the action has ended."""
        return BackgroundAction(action.action_id, partial(self._write_recording, action), report)

    async def _write_recording(self, action: Action) -> ActionReport:
        try:
            name = await self._box.request()
        except OSError as error:
            raise WorkFailedError(
                f"the recording was not written: {error}; check the disk and upload.folder"
            ) from error
        return ActionReport(action.action_id, ActionStatus.FINISHED, name)
