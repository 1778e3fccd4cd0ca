"""The black box of one robot: records its messages and journal, and writes files on failures or requests."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from nena_edge_agent.black_box.ros_schema import ros_schema
from nena_edge_agent.black_box.settings import BlackBoxSettings
from nena_edge_agent.black_box.triggers import Reason, Triggers
from nena_edge_agent.journal import Journal
from nena_edge_agent.protocol import events
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.black_box.folder import OutgoingFolder, name_of
from nena_shared.black_box.ring import Channel, Ring
from nena_shared.black_box.uploader import Uploader
from nena_shared.clock import Clock, iso
from nena_shared.log import get_logger, recent_lines
from nena_shared.mqtt import Handler, Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.settings import ConfigurationError, MqttSettings
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

DISTRIBUTION = "nena-edge-agent"
JOURNAL = Channel("/nena/journal")


def check_library() -> None:
    """Check that files can be written.

    Raises:
        ConfigurationError: the extra ``blackbox`` is not installed.
    """
    if find_spec("mcap") is None:
        message = f"black_box.enabled: mcap is missing; install the extra {DISTRIBUTION}[blackbox]"
        raise ConfigurationError([message])


class RecordedLink(MqttLink):
    """A link whose VDA 5050 messages, those below ``prefix``, are recorded."""

    def __init__(
        self, settings: MqttSettings, *, client_id: str, hooks: LinkHooks, box: BlackBox, prefix: str
    ) -> None:
        self._box = box
        self._prefix = prefix
        recorded = replace(hooks, on_connected=lambda: self._greetings(hooks))
        super().__init__(settings, client_id=client_id, hooks=recorded)

    def publish(self, message: Outbound) -> None:
        """Record and send a message."""
        self._note(message)
        super().publish(message)

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = True) -> None:
        """Subscribe; messages of VDA 5050 are recorded before they are handled."""
        if topic_filter.startswith(self._prefix):
            handler = partial(self._record_received, handler)
        super().subscribe(topic_filter, handler, qos=qos, needed=needed)

    def _greetings(self, hooks: LinkHooks) -> Iterator[Outbound]:
        for message in hooks.on_connected():
            self._note(message)
            yield message

    def _note(self, message: Outbound) -> None:
        if message.topic.startswith(self._prefix):
            self._box.record(message.topic, message.payload)

    def _record_received(self, handler: Handler, message: Inbound) -> None:
        self._box.record(message.topic, message.payload, own=False)
        handler(message)


@dataclass(frozen=True, slots=True)
class Outgoing:
    """Where a robot's files go."""

    folder: OutgoingFolder
    uploader: Uploader | None
    """Sends them to the status aggregator; None: they stay on the robot."""

    async def add(self, name: str, write: Callable[[Path], object]) -> None:
        """Write a file in a thread, and let it be sent.

        Raises:
            OSError: the disk fails.
        """
        await asyncio.to_thread(self.folder.add, name, write)
        if self.uploader:
            self.uploader.wake()


class BlackBox:
    """Records one robot, also over restarts of its agent within the program."""

    def __init__(self, robot: RobotKey, settings: BlackBoxSettings, outgoing: Outgoing, clock: Clock) -> None:
        self._robot = robot
        self._settings = settings
        self._outgoing = outgoing
        self._clock = clock
        self._channels: dict[tuple[str, bool], Channel] = {}
        self._triggers = Triggers(settings.interval)
        self._due: asyncio.Queue[Reason] = asyncio.Queue()
        self.ring = Ring(seconds=settings.seconds, limit=settings.memory)

    def record(self, topic: str, payload: bytes, *, own: bool = True) -> None:
        """Record a message of VDA 5050; ``own``: the agent has made it."""
        channel = self._channels.get((topic, own))
        if channel is None:
            channel = self._channels[topic, own] = Channel(topic, own=own)
        self.ring.add(channel, payload, self._clock.monotonic())

    def make_journal(self, folder: Path, robot: RobotKey) -> Journal:
        """Return the robot's journal; its records are recorded, too."""
        return Journal(folder, robot, on_record=self._record_journal)

    def _record_journal(self, record: bytes) -> None:
        self.ring.add(JOURNAL, record, self._clock.monotonic())

    def note(self, event: events.Event, _: Iterable[events.Effect], robot: RobotState) -> None:
        """Handle an event of the robot: a failure starts a recording."""
        reason = self._triggers.note(event, robot.errors.entries, self._clock.monotonic())
        if reason:
            self._due.put_nowait(reason)

    async def run(self) -> None:
        """Write a file after each failure, until cancelled."""
        while True:
            reason = await self._due.get()
            await asyncio.sleep(self._settings.delay)
            try:
                await self.write(reason)
            except OSError as error:
                log.warning("recording not written", robot=str(self._robot), reason=str(error))

    async def write(self, reason: Reason) -> str:
        """Write what is in memory, in a thread; return the file's name.

        Raises:
            OSError: the disk fails.
        """
        from nena_shared.black_box.mcap_file import Recording, write_mcap  # noqa: PLC0415 - an extra

        now, utc = self._clock.monotonic(), self._clock.now()
        since = iso(utc - timedelta(seconds=self._settings.seconds))
        recording = Recording(
            self.ring.entries(now),
            [each for each in recent_lines() if each > since],
            now,
            utc,
            {
                "source": str(self._robot),
                "reason": reason,
                "program": f"{DISTRIBUTION} {version(DISTRIBUTION)}",
                "entries left out because of their size": str(self.ring.too_large),
                "entries removed early because of the memory limit": str(self.ring.displaced),
            },
        )
        name = name_of(utc, reason)
        await self._outgoing.add(name, partial(write_mcap, recording=recording, ros_schema=ros_schema))
        log.info("recording written", robot=str(self._robot), name=name, entries=len(recording.entries))
        return name
