"""Sends the files of a folder over MQTT, one after the other."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import Final, Protocol

from pydantic import ValidationError

from nena_shared.extensions.black_box.counts import RecordingCounts
from nena_shared.extensions.black_box.folder import OutgoingFolder
from nena_shared.extensions.black_box.transfer import CHUNK_SIZE, Answer, Transfer, Verdict
from nena_shared.log import get_logger
from nena_shared.mqtt import Handler, Inbound, LinkState, Outbound
from nena_shared.tasks import set_within

log = get_logger(__name__)

ANSWER_TIMEOUT: Final = 2.0
"""Time after which an unanswered chunk is sent again, seconds; doubled each time."""
LONGEST_TIMEOUT: Final = 60.0
"""Maximum time between two tries, seconds: without a receiver, a chunk is sent each minute."""
READ_AGAIN_AFTER: Final = 60.0
"""Time after which a file that could not be read is tried again, seconds."""


class UploadLink(Protocol):
    """The program's link to the broker."""

    @property
    def state(self) -> LinkState:
        """Return whether it is connected."""
        ...

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = True) -> None:
        """Subscribe to a topic."""
        ...

    def publish(self, message: Outbound) -> None:
        """Send a message."""
        ...


@dataclass(frozen=True, slots=True)
class UploadTopics:
    """The MQTT topics of a sender's chunks, and of the answers to them."""

    chunks: str
    answers: str


class Uploader:
    """Sends waiting files until each is stored or refused.

    A file that cannot be read is tried again after the others. Chunks that the link cannot send are dropped,
    and sent again after a timeout.
    """

    def __init__(
        self,
        folder: OutgoingFolder,
        topics: UploadTopics,
        *,
        rate: int,
        counts: RecordingCounts | None = None,
    ) -> None:
        """Create the uploader; ``rate`` is the maximum rate, bytes per second."""
        self._counts = counts or RecordingCounts()
        self._folder = folder
        self._topics = topics
        self._rate = rate
        self._transfer: Transfer | None = None
        self._answered = asyncio.Event()
        self._added = asyncio.Event()
        self._link: UploadLink | None = None

    def attach(self, link: UploadLink) -> None:
        """Send on ``link`` from now on."""
        self._link = link
        link.subscribe(self._topics.answers, self._handle_answer, needed=False)

    def wake(self) -> None:
        """Send a new file; call this in the event loop."""
        self._counts.waiting += 1
        self._added.set()

    async def run(self) -> None:
        """Send files until cancelled."""
        while True:
            self._added.clear()
            files = await asyncio.to_thread(self._folder.waiting)
            self._counts.waiting = len(files)
            sent = [await self._send_file(file.path) for file in files]
            if all(sent):
                await self._added.wait()
            else:
                await set_within(self._added, READ_AGAIN_AFTER)

    async def _send_file(self, path: Path) -> bool:
        """Send a file; return False if it could not be read and still waits."""
        try:
            transfer = await asyncio.to_thread(_begin_transfer, path)
            await self._send_chunks(path, transfer)
            await asyncio.to_thread(self._folder.mark_sent, path.name)
        except FileNotFoundError:
            log.info("recording removed before it was sent", name=path.name)
            self._counts.waiting -= 1
            return True
        except (OSError, ValidationError) as error:
            log.warning("recording not sent; trying again later", name=path.name, reason=str(error))
            return False
        finally:
            self._transfer = None
        self._counts.waiting -= 1
        end = transfer.end
        if end and end.verdict is Verdict.REFUSED:
            self._counts.outcomes["refused"] += 1
            log.warning("recording refused by the status aggregator", name=path.name, reason=end.reason)
        else:
            self._counts.outcomes["sent"] += 1
            self._counts.sent_bytes += transfer.size
            log.info("recording sent", name=path.name, size=transfer.size)
        return True

    async def _send_chunks(self, path: Path, transfer: Transfer) -> None:
        self._transfer = transfer
        timeout = ANSWER_TIMEOUT
        while transfer.end is None:
            data = await asyncio.to_thread(_read_chunk, path, transfer.offset)
            self._answered.clear()
            if self._link and self._link.state.connected:
                # not kept: it is sent again after a timeout, and in the queue it would displace others
                self._link.publish(Outbound(self._topics.chunks, transfer.chunk(data).encode(), keep=False))
            await asyncio.sleep(len(data) / self._rate)
            answered = await set_within(self._answered, timeout)
            timeout = ANSWER_TIMEOUT if answered else min(2 * timeout, LONGEST_TIMEOUT)

    def _handle_answer(self, message: Inbound) -> None:
        try:
            answer = Answer.model_validate_json(message.payload)
        except ValidationError:
            log.warning("unreadable answer to a recording", topic=message.topic)
            return
        if self._transfer and not message.retained and self._transfer.take(answer):
            self._answered.set()


def _begin_transfer(path: Path) -> Transfer:
    with path.open("rb") as file:
        digest = file_digest(file, "sha256").hexdigest()
        # the number of bytes that were hashed, not what the folder says at another time
        return Transfer(path.name, file.tell(), digest)


def _read_chunk(path: Path, offset: int) -> bytes:
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(CHUNK_SIZE)
