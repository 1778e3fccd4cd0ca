"""The uploader sends each file until it is stored or refused."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path

import pytest

from nena_shared.extensions.black_box import uploader as module
from nena_shared.extensions.black_box.counts import RecordingCounts
from nena_shared.extensions.black_box.folder import OutgoingFolder
from nena_shared.extensions.black_box.transfer import CHUNK_SIZE, Answer, Chunk, Verdict, read_chunk
from nena_shared.extensions.black_box.uploader import Uploader, UploadTopics
from nena_shared.mqtt import Handler, Inbound, LinkState, Outbound
from support.waiting import until

TOPICS = UploadTopics("chunk", "answer")
CONTENT = bytes(range(256)) * 400
NAME = "001.mcap"


class FakeLink:
    """A link whose other end is a function of each chunk."""

    def __init__(self, reply: Callable[[Chunk], Answer | None]) -> None:
        self.state = LinkState(connected=True)
        self.chunks: list[Chunk] = []
        self.reply = reply
        self._handler: Handler = lambda _: None

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = True) -> None:
        assert (topic_filter, qos, needed) == ("answer", 1, False)
        self._handler = handler

    def publish(self, message: Outbound) -> None:
        assert (message.topic, message.qos, message.keep) == ("chunk", 1, False)
        chunk = read_chunk(message.payload)
        self.chunks.append(chunk)
        if answer := self.reply(chunk):
            self.answer(answer.encode())

    def answer(self, payload: bytes) -> None:
        self._handler(Inbound("answer", payload, retained=False))


class Storing:
    """A receiver that stores what it gets, but ignores the first ``lost`` chunks."""

    def __init__(self, lost: int = 0) -> None:
        self.content = b""
        self._lost = lost

    def __call__(self, chunk: Chunk) -> Answer | None:
        if self._lost:
            self._lost -= 1
            return None
        if chunk.header.offset == len(self.content):
            self.content += chunk.data
        verdict = Verdict.COMPLETE if len(self.content) == chunk.header.size else Verdict.MORE
        return Answer(name=chunk.header.name, verdict=verdict, received=len(self.content))


@pytest.fixture
def folder(tmp_path: Path) -> OutgoingFolder:
    made = OutgoingFolder(tmp_path, keep=9, keep_bytes=10**7)
    made.add(NAME, partial(Path.write_bytes, data=CONTENT))
    return made


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ANSWER_TIMEOUT", 0.02)
    monkeypatch.setattr(module, "LONGEST_TIMEOUT", 0.05)


@asynccontextmanager
async def running(folder: OutgoingFolder, link: FakeLink) -> AsyncIterator[Uploader]:
    uploader = Uploader(folder, TOPICS, rate=10**9)
    uploader.attach(link)
    task = asyncio.create_task(uploader.run())
    try:
        yield uploader
    finally:
        task.cancel()


async def sent(folder: OutgoingFolder, name: str = NAME) -> None:
    await until((folder._folder / "sent" / name).is_file)


@pytest.mark.parametrize("lost", [0, 3])
async def test_a_waiting_file_is_sent_whole_and_then_marked(folder: OutgoingFolder, lost: int) -> None:
    receiver = Storing(lost)
    link = FakeLink(receiver)
    async with running(folder, link):
        await sent(folder)

    assert receiver.content == CONTENT
    assert len(link.chunks) == -(-len(CONTENT) // CHUNK_SIZE) + lost


async def test_a_new_file_is_sent_when_it_is_added(folder: OutgoingFolder) -> None:
    link = FakeLink(Storing())
    async with running(folder, link) as uploader:
        await sent(folder)
        link.reply = Storing()
        folder.add("002.log", partial(Path.write_bytes, data=b"stopped"))
        uploader.wake()
        await sent(folder, "002.log")


async def test_a_refused_file_is_not_sent_again(folder: OutgoingFolder) -> None:
    link = FakeLink(lambda chunk: Answer(name=chunk.header.name, verdict=Verdict.REFUSED, reason="too large"))
    async with running(folder, link):
        await sent(folder)

    assert len(link.chunks) == 1


async def test_nothing_is_published_without_a_connection(folder: OutgoingFolder) -> None:
    link = FakeLink(Storing())
    link.state.connected = False
    link.reply = lambda _: pytest.fail("published")
    async with running(folder, link):
        await asyncio.to_thread(folder.waiting)
        link.reply = Storing()
        link.state.connected = True
        await sent(folder)


async def test_a_file_that_was_removed_is_skipped(folder: OutgoingFolder, tmp_path: Path) -> None:
    folder.add("002.mcap", partial(Path.write_bytes, data=b"second"))

    def remove(chunk: Chunk) -> Answer | None:
        (tmp_path / NAME).unlink(missing_ok=True)
        return Storing()(chunk) if chunk.header.name != NAME else None

    async with running(folder, FakeLink(remove)):
        await sent(folder, "002.mcap")


async def test_an_empty_file_does_not_stop_the_others(folder: OutgoingFolder) -> None:
    folder.add("000.log", Path.touch)
    async with running(folder, FakeLink(Storing())):
        await sent(folder)


async def test_unreadable_answers_are_ignored(folder: OutgoingFolder) -> None:
    receiver = Storing()
    link = FakeLink(lambda _: None)
    async with running(folder, link):
        await until(lambda: link.chunks)
        for payload in (b"", b"[]", b'{"name": 1}', b"\xff"):
            link.answer(payload)
        link.reply = receiver
        await sent(folder)


async def test_files_are_counted_by_what_happens_to_them(folder: OutgoingFolder) -> None:
    link, counts = FakeLink(lambda _: None), RecordingCounts()
    uploader = Uploader(folder, TOPICS, rate=10**9, counts=counts)
    uploader.attach(link)
    task = asyncio.create_task(uploader.run())
    await until(lambda: link.chunks)
    folder.add("002.mcap", partial(Path.write_bytes, data=b"second"))
    uploader.wake()
    assert counts.waiting == 2

    link.reply = Storing()
    await sent(folder)
    link.reply = lambda chunk: Answer(name=chunk.header.name, verdict=Verdict.REFUSED)
    await sent(folder, "002.mcap")
    await until(lambda: not counts.waiting)
    task.cancel()
    assert counts.outcomes == {"written": 0, "not_written": 0, "sent": 1, "refused": 1}
    assert counts.sent_bytes == len(CONTENT)
    total = RecordingCounts.total([counts, counts])
    assert (total.outcomes["sent"], total.sent_bytes) == (2, 2 * len(CONTENT))
