"""Recordings of a robot's last minutes and log reports, and their transfer to the status aggregator."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import TYPE_CHECKING, ClassVar

from nena_edge_agent.actions.plugin import ActionPlugin
from nena_edge_agent.extension import Core, Extension, Robot
from nena_edge_agent.extensions.black_box.box import FetchRecording, RobotBlackBox
from nena_edge_agent.extensions.black_box.log_report import LogReport
from nena_edge_agent.extensions.black_box.ros import RosTopicRecorder
from nena_edge_agent.extensions.black_box.settings import RecordingSettings
from nena_edge_agent.nav2.session_control import NodeExtension
from nena_edge_agent.protocol.events import Effect, Event
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.extensions.black_box.box import outgoing_of
from nena_shared.extensions.black_box.counts import RecordingCounts
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.settings import TopLevelSettings

if TYPE_CHECKING:
    from nena_shared.metrics import Section


class BlackBoxes(Extension):
    """Records each robot if ``black_box.enabled`` is set, and sends files if ``upload.enabled`` is set."""

    Settings: ClassVar[type[TopLevelSettings]] = RecordingSettings

    def __init__(self, settings: RecordingSettings, core: Core) -> None:
        super().__init__(settings, core)
        topics = FleetTopics(core.settings.topic_prefix)
        self._outgoing = {robot.key: outgoing_of(settings.upload, robot.key, topics) for robot in core.robots}
        for robot in core.robots:
            if uploader := self._outgoing[robot.key].uploader:
                uploader.attach(robot.link)
        self._boxes = {
            key: RobotBlackBox(key, settings.black_box, outgoing, core.clock)
            for key, outgoing in self._outgoing.items()
            if settings.black_box.enabled
        }

    @classmethod
    def metrics(cls) -> Section[BlackBoxes]:
        """Return the number and size of files, of all robots together."""
        from nena_shared.extensions.black_box.metrics import recording_metrics  # noqa: PLC0415 - an extra
        from nena_shared.metrics import Section  # noqa: PLC0415

        return Section("Recordings", recording_metrics(cls._count_recordings))

    def _count_recordings(self) -> RecordingCounts | None:
        """Return what happened to the files; None: no robot makes any, or they stay on the robot."""
        if not self._boxes and not self.settings.upload.enabled:
            return None
        return RecordingCounts.total([outgoing.counts for outgoing in self._outgoing.values()])

    def actions(self, robot: Robot) -> Iterable[ActionPlugin]:
        """Return logReport, and what requests a recording."""
        outgoing = self._outgoing[robot.key]
        yield LogReport(self.settings.log_report, outgoing.add if outgoing.uploader else None)
        if box := self._boxes.get(robot.key):
            yield FetchRecording(box)

    def nodes(self, robot: Robot) -> Iterable[NodeExtension]:
        """Return what records the configured ROS topics."""
        box = self._boxes.get(robot.key)
        return (RosTopicRecorder(self.settings.black_box.topics, box.ring, self.core.clock),) if box else ()

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return the tasks that write and send files."""
        uploaders = {key: outgoing.uploader for key, outgoing in self._outgoing.items()}
        return {
            **{f"black box {key}": box.run for key, box in self._boxes.items()},
            **{f"recordings {key}": uploader.run for key, uploader in uploaders.items() if uploader},
        }

    def on_event(self, robot: Robot, event: Event, effects: Iterable[Effect], state: RobotState) -> None:  # noqa: ARG002 - the interface
        """Start a recording after a failure."""
        if box := self._boxes.get(robot.key):
            box.handle_event(event, state.errors.entries)

    def on_message(self, robot: Robot, message: Inbound | Outbound) -> None:
        """Record a message."""
        if box := self._boxes.get(robot.key):
            box.record_message(message.topic, message.payload, own=isinstance(message, Outbound))

    def on_record(self, robot: Robot, record: bytes) -> None:
        """Record the journal."""
        if box := self._boxes.get(robot.key):
            box.record_journal(record)
