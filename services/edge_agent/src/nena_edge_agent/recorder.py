"""Creation of a robot's black box, and of the transfer of its files, from its settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from nena_edge_agent.actions.builtin import Send
from nena_edge_agent.black_box.box import BlackBox, Outgoing, RecordedLink, check_library
from nena_edge_agent.journal import Journal
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.black_box.folder import OutgoingFolder
from nena_shared.black_box.uploader import Uploader, UploadTopics
from nena_shared.clock import Clock
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import LinkHooks, MqttLink
from nena_shared.settings import ConfigurationError, MqttSettings
from nena_shared.tasks import Supervisor, forever
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import topics_for


@dataclass(frozen=True, slots=True)
class RobotRecorder:
    """What records one robot and sends its files; both may be off."""

    robot: RobotKey
    box: BlackBox | None
    uploader: Uploader | None
    send: Send | None
    """Sends a log report; None: it stays on the robot."""
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
    outgoing = settings.upload
    try:
        place = outgoing.folder.expanduser() / quote(str(robot), safe=" :").replace(".", "%2E")
    except RuntimeError as error:
        raise ConfigurationError([f"upload.folder: {error}"]) from error
    folder = OutgoingFolder(place, keep=outgoing.keep, keep_bytes=outgoing.keep_bytes)
    uploader = None
    if outgoing.enabled:
        fleet = FleetTopics(settings.topic_prefix)
        topics = UploadTopics(fleet.recording_chunks(robot), fleet.recording_answers(robot))
        uploader = Uploader(folder, topics, rate=outgoing.rate)
    files = Outgoing(folder, uploader)
    box = None
    if settings.black_box.enabled:
        check_library()
        box = BlackBox(robot, settings.black_box, files, clock)
    vda = topics_for(settings.version, settings.interface_name).of(robot, Topic.STATE)
    return RobotRecorder(robot, box, uploader, files.add if uploader else None, vda.removesuffix(Topic.STATE))
