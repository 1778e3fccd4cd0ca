"""The store keeps complete files only, within its limits, whatever arrives."""

from __future__ import annotations

import os
import random
import shutil
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nena_shared.extensions.black_box.transfer import Answer, Transfer, Verdict
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.extensions.recordings.store import RecordingSettings, RecordingStore

ROBOT = RobotKey("ACME", "r1")
LIMITS = RecordingSettings.model_construct(
    keep=5, keep_per_robot=3, keep_bytes=100_000, file_bytes=50_000
)  # smaller than the settings may be


def store_in(folder: Path) -> RecordingStore:
    return RecordingStore(LIMITS.model_copy(update={"folder": folder}))


NAME = "20260102T030405.678Z-request.mcap"
CONTENT = bytes(range(256)) * 10
PART = 1000


def sender(content: bytes = CONTENT, name: str = NAME) -> Transfer:
    return Transfer(name, len(content), sha256(content).hexdigest())


def send(
    store: RecordingStore, content: bytes = CONTENT, name: str = NAME, robot: RobotKey = ROBOT
) -> Answer:
    """Send a whole file; return the last answer."""
    transfer = sender(content, name)
    while transfer.end is None:
        data = content[transfer.offset : transfer.offset + PART]
        assert transfer.take(store.add_chunk(robot, transfer.chunk(data)))
    return transfer.end


def test_a_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    store, transfer = store_in(tmp_path), sender()
    transfer.take(store.add_chunk(ROBOT, transfer.chunk(CONTENT[:PART])))
    assert store.list_recordings() == []
    assert store.find_file(ROBOT, NAME) is None

    assert send(store).verdict is Verdict.COMPLETE
    (found,) = store.list_recordings()
    assert (found.robot, found.name, found.size) == (ROBOT, NAME, len(CONTENT))
    assert found.path.read_bytes() == CONTENT
    assert store.find_file(ROBOT, NAME) == found.path


def test_a_file_that_is_sent_again_is_complete_at_once(tmp_path: Path) -> None:
    store = store_in(tmp_path)
    send(store)
    assert store.add_chunk(ROBOT, sender().chunk(CONTENT[:PART])).verdict is Verdict.COMPLETE


@given(st.integers(0, 2**32))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_loss_repetition_and_restarts_of_both_sides_do_no_harm(tmp_path: Path, seed: int) -> None:
    chance, folder = random.Random(seed), tmp_path / str(seed)
    shutil.rmtree(folder, ignore_errors=True)
    store, transfer = store_in(folder), sender()
    late: list[Answer] = []
    for _ in range(2000):
        chunk = transfer.chunk(CONTENT[transfer.offset : transfer.offset + PART])
        for _ in range(chance.choice((0, 1, 1, 2))):
            answer = store.add_chunk(ROBOT, chunk)
            late += [answer] * chance.choice((0, 1, 1, 2))
        while late and chance.random() < 0.7:
            transfer.take(late.pop(chance.randrange(len(late))))
        if transfer.end:
            break
        if chance.random() < 0.1:
            transfer = sender()
        if chance.random() < 0.1:
            store = store_in(folder)
    assert transfer.end is not None
    assert transfer.end.verdict is Verdict.COMPLETE
    assert [each.path.read_bytes() for each in store.list_recordings()] == [CONTENT]


def test_a_wrong_checksum_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    store, transfer = store_in(tmp_path), Transfer(NAME, 4, "0" * 64)
    answer = store.add_chunk(ROBOT, transfer.chunk(b"data"))

    assert (answer.verdict, answer.reason) == (Verdict.REFUSED, "the checksum is wrong")
    assert [each for each in tmp_path.rglob("*") if each.is_file()] == []


def test_too_large_files_and_other_files_of_the_same_name_are_refused(tmp_path: Path) -> None:
    store = store_in(tmp_path)
    assert (
        "recordings.file_bytes" in store.add_chunk(ROBOT, Transfer(NAME, 50_001, "0" * 64).chunk(b"x")).reason
    )
    send(store)
    assert (
        store.add_chunk(ROBOT, sender(b"other").chunk(b"other")).reason == "another file of this name exists"
    )


def test_the_beginning_of_another_file_discards_what_was_not_completed(tmp_path: Path) -> None:
    store, transfer = store_in(tmp_path), sender(name="1.mcap")
    store.add_chunk(ROBOT, transfer.chunk(CONTENT[:PART]))
    store.add_chunk(ROBOT, sender(name="2.mcap").chunk(CONTENT[:PART]))

    assert len(list(tmp_path.rglob("*.part"))) == 1
    assert store.add_chunk(ROBOT, transfer.chunk(CONTENT[:PART])).received == PART


def named(store: RecordingStore, robot: RobotKey, number: int, content: bytes = b"x") -> None:
    send(store, content, f"{number:03d}.mcap", robot)
    path = store.find_file(robot, f"{number:03d}.mcap")
    assert path is not None
    os.utime(path, (number, number))


def test_the_oldest_files_of_a_robot_go_first_then_those_of_all(tmp_path: Path) -> None:
    store, other = store_in(tmp_path), RobotKey("ACME", "r2")
    for number in range(1, 5):
        named(store, ROBOT, number)
    assert [each.name for each in store.list_recordings()] == ["004.mcap", "003.mcap", "002.mcap"]

    for number in (11, 12, 13):
        named(store, other, number)
    assert [each.name for each in store.list_recordings()] == [
        "013.mcap",
        "012.mcap",
        "011.mcap",
        "004.mcap",
        "003.mcap",
    ]


def test_the_size_of_all_files_is_limited(tmp_path: Path) -> None:
    store = store_in(tmp_path)
    for number in (1, 2, 3):
        named(store, RobotKey("ACME", str(number)), number, bytes(40_000))

    assert [each.name for each in store.list_recordings()] == ["003.mcap", "002.mcap"]


@pytest.mark.parametrize("robot", [("..", ".."), ("a.b", "c.d"), ("ä ö", "*?"), ("~", "%2E"), ("", "x")])
def test_any_name_of_a_robot_stays_within_the_folder(tmp_path: Path, robot: tuple[str, str]) -> None:
    folder = tmp_path / "recordings"
    store, key = store_in(folder), RobotKey(*robot)
    send(store, robot=key)

    assert [(each.robot, each.path.parent.parent) for each in store.list_recordings()] == [(key, folder)]
    assert store.find_file(key, "../../etc/passwd") is None


def test_a_name_too_long_for_a_folder_is_refused(tmp_path: Path) -> None:
    answer = store_in(tmp_path).add_chunk(RobotKey("ä" * 60, "x"), sender().chunk(b"x"))
    assert answer.verdict is Verdict.REFUSED
