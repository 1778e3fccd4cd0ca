"""The black box of a program: keeps its last minutes, and writes them to a file on failures and requests."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import timedelta
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Final
from urllib.parse import quote

from nena_shared.clock import Clock, iso
from nena_shared.extensions.black_box.counts import RecordingCounts
from nena_shared.extensions.black_box.folder import OutgoingFolder, name_of
from nena_shared.extensions.black_box.ring import Ring
from nena_shared.extensions.black_box.settings import OutgoingSettings, RingSettings
from nena_shared.extensions.black_box.uploader import Uploader, UploadTopics
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger, recent_lines
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

REQUEST: Final = "request"
"""Reason of a recording that somebody has requested; part of its name."""


def check_library(distribution: str) -> None:
    """Check that files can be written.

    Raises:
        ConfigurationError: the extra ``blackbox`` of the distribution is not installed.
    """
    # looked for, not imported: 0061 loads the library with the first file
    if find_spec("mcap") is None:
        message = f"black_box.enabled: mcap is missing; install the extra {distribution}[blackbox]"
        raise ConfigurationError([message])


@dataclass(frozen=True, slots=True)
class Outgoing:
    """Where the files of a program or robot go."""

    folder: OutgoingFolder
    uploader: Uploader | None
    """Sends them to the status aggregator; None: they stay on this machine."""
    counts: RecordingCounts = field(default_factory=RecordingCounts)

    async def add(self, name: str, write: Callable[[Path], object]) -> None:
        """Write a file in a thread, and let it be sent; raises OSError if the disk fails."""
        try:
            await asyncio.to_thread(self.folder.add, name, write)
        except OSError:
            self.counts.outcomes["not_written"] += 1
            raise
        self.counts.outcomes["written"] += 1
        if self.uploader:
            self.uploader.wake()


def outgoing_of(settings: OutgoingSettings, source: RobotKey, topics: FleetTopics) -> Outgoing:
    """Return where the files of ``source`` go; raises ConfigurationError if there is no home directory."""
    try:
        # a manufacturer or serial number such as ".." must not lead out of the folder
        place = settings.folder.expanduser() / quote(str(source), safe=" :").replace(".", "%2E")
    except RuntimeError as error:
        raise ConfigurationError([f"upload.folder: {error}"]) from error
    folder = OutgoingFolder(place, keep=settings.keep, keep_bytes=settings.keep_bytes)
    own = UploadTopics(topics.recording_chunks(source), topics.recording_answers(source))
    counts = RecordingCounts()
    uploader = Uploader(folder, own, rate=settings.rate, counts=counts) if settings.enabled else None
    return Outgoing(folder, uploader, counts)


@dataclass(frozen=True, slots=True)
class Source:
    """Whose last minutes a file contains."""

    key: RobotKey
    distribution: str
    """The program that records them."""
    ros_schema: Callable[[str], bytes] = field(default=lambda _: b"")
    """Returns the definition (``ros2msg``) of a ROS message type."""


class BlackBox:
    """Records one source into :attr:`ring`, and writes files; outlives what it records."""

    def __init__(self, source: Source, settings: RingSettings, outgoing: Outgoing, clock: Clock) -> None:
        """Create an empty black box; raises ConfigurationError if the extra ``blackbox`` is not installed."""
        check_library(source.distribution)
        self._source = source
        self._settings = settings
        self._clock = clock
        self._due: asyncio.Queue[str] = asyncio.Queue()
        self._last_failure: float | None = None
        self._requested: asyncio.Task[str] | None = None
        self._writing = asyncio.Lock()
        self.outgoing = outgoing
        self.ring = Ring(seconds=settings.seconds, limit=settings.memory)

    def fail(self, reason: str) -> None:
        """Start a recording after a failure, at most one in each interval.

        A robot that fails repeatedly must not fill its disk.
        """
        now = self._clock.monotonic()
        if self._last_failure is None or now - self._last_failure >= self._settings.interval:
            self._last_failure = now
            self._due.put_nowait(reason)

    async def run(self) -> None:
        """Write a file after each failure, until cancelled."""
        while True:
            reason = await self._due.get()
            try:
                await asyncio.sleep(self._settings.delay)
                await self._write_file(reason)
            except asyncio.CancelledError:
                self._due.put_nowait(reason)  # as after a change of the plant model, which runs it again
                raise
            except OSError as error:
                log.warning("recording not written", robot=str(self._source.key), reason=str(error))

    async def request(self) -> str:
        """Write what is in memory to a file; return its name. Requests that arrive meanwhile get this file.

        Raises:
            OSError: the disk fails.
        """
        if self._requested is None or self._requested.done():
            self._requested = asyncio.create_task(self._write_file(REQUEST), name="requested recording")
        # several requests may wait for it: one that is cancelled must not end it for the others
        return await asyncio.shield(self._requested)

    async def _write_file(self, reason: str) -> str:
        """Write one file at a time, in a thread: each can take seconds of it."""
        async with self._writing:
            return await self._write_now(reason)

    async def _write_now(self, reason: str) -> str:
        from nena_shared.extensions.black_box.mcap_file import Recording, write_mcap  # noqa: PLC0415 - an extra

        now, utc = self._clock.monotonic(), self._clock.now()
        since, source = iso(utc - timedelta(seconds=self._settings.seconds)), self._source
        recording = Recording(
            self.ring.entries(now),
            # lines begin with their time in ISO 8601, so texts compare as times do
            [line for line in recent_lines() if line > since],
            now,
            utc,
            {
                "source": str(source.key),
                "reason": reason,
                "program": f"{source.distribution} {version(source.distribution)}",
                "entries left out because of their size": str(self.ring.too_large),
                "entries removed early because of the memory limit": str(self.ring.displaced),
            },
        )
        name = name_of(utc, reason)
        write = partial(write_mcap, recording=recording, ros_schema=source.ros_schema)
        await self.outgoing.add(name, write)
        log.info("recording written", robot=str(source.key), name=name, entries=len(recording.entries))
        return name
