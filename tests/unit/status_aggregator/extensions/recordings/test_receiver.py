"""The receiver stores the newest chunk of each robot, and answers it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from hashlib import sha256
from pathlib import Path

import pytest

from nena_shared.extensions.black_box.transfer import Answer, ChunkHeader, Verdict
from nena_shared.extensions.black_box.transfer import Chunk as Part
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.extension import Core
from nena_status_aggregator.extensions.recordings import receiver as module
from nena_status_aggregator.extensions.recordings.receiver import RecordingReceiver
from nena_status_aggregator.extensions.recordings.store import RecordingSettings, RecordingStore
from nena_status_aggregator.settings import Share
from support.clocks import ManualClock
from support.waiting import until

TOPICS = FleetTopics()
ROBOT, OTHER = RobotKey("ACME", "r1"), RobotKey("ACME", "r2")
LIMITS = RecordingSettings.model_construct(keep=100, keep_per_robot=10, keep_bytes=10**6, file_bytes=100)
NAME = "20260102T030405.678Z-error.mcap"


class FakeLink:
    """What the receiver has subscribed to and published."""

    def __init__(self) -> None:
        self.filters: list[str] = []
        self.sent: list[Outbound] = []

    def subscribe(self, topic_filter: str, _: object) -> None:
        self.filters.append(topic_filter)

    def publish(self, message: Outbound) -> None:
        self.sent.append(message)

    def answers(self, robot: RobotKey = ROBOT) -> list[Answer]:
        topic = TOPICS.recording_answers(robot)
        return [Answer.model_validate_json(each.payload) for each in self.sent if each.topic == topic]


def chunk(data: bytes, *, offset: int = 0, whole: bytes | None = None) -> bytes:
    content = data if whole is None else whole
    header = ChunkHeader(name=NAME, size=len(content), sha256=sha256(content).hexdigest(), offset=offset)
    return Part(header, data).encode()


class Receiving:
    """A receiver, and the messages that it gets."""

    def __init__(self, folder: Path, share: Share | None = None) -> None:
        self.store = RecordingStore(LIMITS.model_copy(update={"folder": folder}))
        self.link = FakeLink()
        core = Core(ManualClock(), TOPICS, share or Share(), None, self.link.subscribe, self.link.publish)
        self.receiver = RecordingReceiver(self.store, core)

    def get(self, payload: bytes, robot: RobotKey = ROBOT, *, retained: bool = False) -> None:
        self.receiver.queue_chunk(Inbound(TOPICS.recording_chunks(robot), payload, retained=retained))


@pytest.fixture
async def receiving(tmp_path: Path) -> AsyncIterator[Receiving]:
    made = Receiving(tmp_path / "received")
    task = asyncio.create_task(made.receiver.run())
    yield made
    task.cancel()


async def test_each_chunk_is_stored_and_answered(receiving: Receiving) -> None:
    whole = b"first second"
    receiving.get(chunk(b"first ", whole=whole))
    (more,) = await until(receiving.link.answers)
    receiving.get(chunk(b"second", offset=6, whole=whole))
    await until(lambda: len(receiving.link.answers()) == 2)

    assert receiving.link.filters == ["nena/v1/robots/+/+/recordings/chunk"]
    assert (more.verdict, more.received) == (Verdict.MORE, 6)
    assert receiving.link.answers()[1].verdict is Verdict.COMPLETE
    assert [each.path.read_bytes() for each in receiving.store.list_recordings()] == [whole]
    assert not any(each.retain or each.keep for each in receiving.link.sent)
    assert (receiving.receiver.received, receiving.receiver.received_bytes) == (
        {"stored": 1, "refused": 0},
        12,
    )


async def test_only_the_newest_chunk_of_a_robot_waits(receiving: Receiving) -> None:
    receiving.get(chunk(b"old"))
    receiving.get(chunk(b"newer"))
    receiving.get(chunk(b"another"), OTHER)
    await until(lambda: receiving.link.answers() and receiving.link.answers(OTHER))

    assert {each.path.read_bytes() for each in receiving.store.list_recordings()} == {b"newer", b"another"}


async def test_a_refused_file_is_answered_and_not_stored(receiving: Receiving) -> None:
    receiving.get(chunk(b"x" * 101))
    (answer,) = await until(receiving.link.answers)

    assert answer.verdict is Verdict.REFUSED
    assert "recordings.file_bytes" in answer.reason
    assert receiving.store.list_recordings() == []
    assert receiving.receiver.received == {"stored": 0, "refused": 1}


@pytest.mark.parametrize(
    "disturb",
    [
        lambda it: it.get(b"no chunk"),
        lambda it: it.get(b""),
        lambda it: it.get(chunk(b"a"), retained=True),
        lambda it: it.get(chunk(b"a"), RobotKey("A" * 150, "r" * 100)),
        lambda it: it.receiver.queue_chunk(Inbound("nena/v1/robots/a/b/map", chunk(b"a"), retained=False)),
    ],
)
async def test_what_is_no_chunk_gets_no_answer(
    receiving: Receiving, disturb: Callable[[Receiving], None]
) -> None:
    disturb(receiving)
    receiving.get(chunk(b"b"), OTHER)
    await until(lambda: receiving.link.answers(OTHER))

    assert len(receiving.link.sent) == 1


async def test_robots_of_other_shares_are_left_to_their_aggregator(tmp_path: Path) -> None:
    shares = [Share(number=number, of=2) for number in (1, 2)]
    made = [Receiving(tmp_path / str(each.number), each) for each in shares]
    for each in made:
        for number in range(8):
            each.get(chunk(b"a"), RobotKey("ACME", str(number)))

    waiting = [set(each.receiver._waiting) for each in made]
    assert all(waiting)
    assert (len(waiting[0] | waiting[1]), waiting[0] & waiting[1]) == (8, set())


async def test_beyond_the_limit_robots_repeat_their_chunks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "WAITING_LIMIT", 1)
    made = Receiving(tmp_path)
    made.get(chunk(b"old"))
    made.get(chunk(b"late"), OTHER)
    made.get(chunk(b"newer"))

    assert made.receiver._waiting == {ROBOT: chunk(b"newer")}


async def test_a_full_disk_is_not_answered_so_that_the_robot_repeats(
    receiving: Receiving, tmp_path: Path
) -> None:
    place = tmp_path / "received"
    place.write_text("no folder")
    receiving.get(chunk(b"data"))
    await until(lambda: receiving.receiver._failing)
    assert receiving.link.sent == []

    place.unlink()
    receiving.get(chunk(b"data"))
    (answer,) = await until(receiving.link.answers)
    assert answer.verdict is Verdict.COMPLETE
