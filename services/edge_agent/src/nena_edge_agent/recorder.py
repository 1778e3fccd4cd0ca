"""Creation of a robot's black box, and of the transfer of its files, from its settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from nena_edge_agent.actions.builtin import Send
from nena_edge_agent.black_box.box import RecordedLink, RobotBlackBox
from nena_edge_agent.journal import Journal
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import Clock
from nena_shared.extensions.black_box.box import outgoing_of
from nena_shared.extensions.black_box.counts import RecordingCounts
from nena_shared.extensions.black_box.uploader import Uploader
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import LinkHooks, MqttLink
from nena_shared.settings import MqttSettings
from nena_shared.tasks import Supervisor, forever
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import topics_for


@dataclass(frozen=True, slots=True)
class RobotRecorder:
    """What records one robot and sends its files; both may be off."""

    robot: RobotKey
    box: RobotBlackBox | None
    uploader: Uploader | None
    send: Send | None
    """Sends a log report; None: it stays on the robot."""
    counts: RecordingCounts | None
    """What happened to its files; None: it makes none."""
    vda_topics: str
    """Prefix of the robot's VDA 5050 topics."""

    @property
    def make_journal(self) -> Callable[[Path, RobotKey], Journal]:
        """Return what creates the robot's journal."""
        return self.box.make_journal if self.box else Journal

    def make_link(self, settings: MqttSettings, *, client_id: str, hooks: LinkHooks) -> MqttLink:
        """Create the robot's link, recorded if there is a black box."""
        if self.box:
            link: MqttLink = RecordedLink(
                settings, client_id=client_id, hooks=hooks, box=self.box, prefix=self.vda_topics
            )
        else:
            link = MqttLink(settings, client_id=client_id, hooks=hooks)
        if self.uploader:
            self.uploader.attach(link)
        return link

    def start(self, supervisor: Supervisor) -> None:
        """Start the tasks that write and send files."""
        for name, part in (("black box", self.box), ("recordings", self.uploader)):
            if part:
                task = f"{name} {self.robot}"
                supervisor.start(task, forever(task, part.run), vital=False)


def make_recorder(settings: EdgeAgentSettings, robot: RobotKey, clock: Clock) -> RobotRecorder:
    """Return the recorder of one robot.

    Raises:
        ConfigurationError: the extra ``blackbox`` is not installed, or there is no home directory.
    """
    outgoing = outgoing_of(settings.upload, robot, FleetTopics(settings.topic_prefix))
    recorded = settings.black_box
    box = RobotBlackBox(robot, recorded, outgoing, clock) if recorded.enabled else None
    vda = topics_for(settings.version, settings.interface_name).of(robot, Topic.STATE)
    uploader = outgoing.uploader
    send = outgoing.add if uploader else None
    counts = outgoing.counts if box or uploader else None
    return RobotRecorder(robot, box, uploader, send, counts, vda.removesuffix(Topic.STATE))
