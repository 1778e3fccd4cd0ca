"""Receives recordings over MQTT: a chunk at a time of each robot, written in a thread, then answered."""

from __future__ import annotations

import asyncio
from typing import Final

from nena_shared.extensions.black_box.transfer import BadChunkError, Verdict, read_chunk
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.extension import Core
from nena_status_aggregator.extensions.recordings.store import RecordingStore

log = get_logger(__name__)

WAITING_LIMIT: Final = 200
"""Maximum number of robots whose chunk waits for the disk; others repeat theirs."""
KEY_LENGTH: Final = 200
"""Maximum length of manufacturer and serial number together, characters."""


class RecordingReceiver:
    """Only the newest chunk of a robot waits for the disk: an honest robot has one on its way."""

    def __init__(self, store: RecordingStore, core: Core) -> None:
        """Receive from all robots of the share."""
        self.store = store
        self._core = core
        self._waiting: dict[RobotKey, bytes] = {}
        self._filled = asyncio.Event()
        self._failing = False
        self.received = {"stored": 0, "refused": 0}
        """Number of files by outcome, since the start."""
        self.received_bytes = 0
        """Size of the stored ones."""
        core.subscribe(core.topics.all_recording_chunks, self.queue_chunk)

    def queue_chunk(self, message: Inbound) -> None:
        """Queue a chunk for the disk."""
        robot = self._core.topics.robot_of_chunk(message.topic)
        if robot is None or message.retained or not message.payload or not self._core.share.has(robot):
            return
        if len(str(robot)) > KEY_LENGTH or (
            robot not in self._waiting and len(self._waiting) >= WAITING_LIMIT
        ):
            return
        self._waiting[robot] = message.payload
        self._filled.set()

    async def run(self) -> None:
        """Store chunks until cancelled."""
        while True:
            await self._filled.wait()
            self._filled.clear()
            while self._waiting:
                robot = next(iter(self._waiting))
                await self._store_chunk(robot, self._waiting.pop(robot))

    async def _store_chunk(self, robot: RobotKey, payload: bytes) -> None:
        try:
            chunk = read_chunk(payload)
        except BadChunkError as error:
            log.warning("unreadable recording", robot=str(robot), reason=str(error))
            return
        try:
            answer = await asyncio.to_thread(self.store.add_chunk, robot, chunk)
        except OSError as error:
            if not self._failing:
                log.error("recordings cannot be stored; robots retry", reason=str(error))  # noqa: TRY400
            self._failing = True
            return
        self._failing = False
        if answer.verdict is Verdict.COMPLETE and chunk.header.offset + len(chunk.data) == chunk.header.size:
            self.received["stored"] += 1
            self.received_bytes += chunk.header.size
            log.info("recording received", robot=str(robot), name=answer.name, size=chunk.header.size)
        elif answer.verdict is Verdict.REFUSED:
            self.received["refused"] += 1
            log.warning("recording refused", robot=str(robot), name=answer.name, reason=answer.reason)
        topic = self._core.topics.recording_answers(robot)
        self._core.publish(Outbound(topic, answer.encode(), keep=False))
