from __future__ import annotations

import os
from pathlib import Path

import pytest

from nena_edge_agent.journal import Journal, sole_user
from nena_shared.program import StartError
from nena_shared.vda5050.topics import RobotKey
from support.robot_core import Bench, action, order

ROBOT = RobotKey("ACME", "0001")


def busy() -> Bench:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD")]}))
    return bench


def test_there_is_nothing_before_the_first_record(tmp_path: Path) -> None:
    assert Journal(tmp_path / "new" / "folder", ROBOT).read() is None


def test_the_newest_record_is_read_back_as_it_was(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    journal.read()
    journal.write(bench.core.memory())
    bench.arrive()
    journal.write(bench.core.memory())

    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()
    assert Journal(tmp_path, RobotKey("ACME", "0002")).read() is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (RobotKey("ACME.B", "C"), RobotKey("ACME", "B.C")),
        (RobotKey("ACME%2EB", "C"), RobotKey("ACME.B", "C")),
        (RobotKey("..", "C"), RobotKey(".", ".C")),
    ],
)
def test_no_two_robots_share_a_file(tmp_path: Path, one: RobotKey, other: RobotKey) -> None:
    memory = busy().core.memory()
    Journal(tmp_path, one).write(memory)

    assert Journal(tmp_path, other).read() is None
    assert Journal(tmp_path, one).read() == memory
    with sole_user(tmp_path, one), sole_user(tmp_path, other):
        pass


def test_a_torn_write_leaves_the_old_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    journal.write(bench.core.memory())
    old = bench.core.memory()
    bench.arrive()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        journal.write(bench.core.memory())

    assert Journal(tmp_path, ROBOT).read() == old


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": 1}', '{"format": 2}'])
def test_a_damaged_record_is_never_guessed_at(tmp_path: Path, content: str) -> None:
    (tmp_path / "ACME.0001.json").write_text(content)

    with pytest.raises(StartError, match="remove the file"):
        Journal(tmp_path, ROBOT).read()


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    with pytest.raises(StartError, match="cannot be used"):
        Journal(tmp_path / "file", ROBOT).read()


@pytest.mark.parametrize("folder", ["/proc/nena", "~nobody-of-this-name/nena"])
def test_a_folder_that_cannot_be_written_is_told_before_an_order_depends_on_it(folder: str) -> None:
    with pytest.raises(StartError, match=r"set journal\.folder"):
        Journal(Path(folder), ROBOT).read()
    with pytest.raises(StartError, match=r"set journal\.folder"), sole_user(Path(folder), ROBOT):
        pass


def test_a_second_program_for_the_same_robot_is_kept_out_as_long_as_the_first_one_works(
    tmp_path: Path,
) -> None:
    with sole_user(tmp_path, ROBOT):
        with pytest.raises(StartError, match="ACME/0001: end it first"), sole_user(tmp_path, ROBOT):
            pass
        with sole_user(tmp_path, RobotKey("ACME", "0002")):
            pass
    with sole_user(tmp_path, ROBOT):
        pass
