"""The session's states, with a graph controlled by the test."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from pathlib import Path

import pytest

from nena_edge_agent.driver.port import SessionError, SessionReport
from nena_edge_agent.nav2.session_control import (
    LONGEST_RETRY,
    SessionManager,
    SessionStore,
    prepare_environment,
)
from nena_edge_agent.nav2.settings import RosAddress, RosSettings
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.waiting import until


def test_variables_set_by_the_user_are_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, value in (
        ("FASTDDS_BUILTIN_TRANSPORTS", "DEFAULT"),
        ("ROS_PYTHON_CHECK_FIELDS", "0"),
        ("ROS_LOG_DIR", str(tmp_path)),
    ):
        monkeypatch.setenv(name, value)
    before = dict(os.environ)
    prepare_environment()
    assert dict(os.environ) == before


def test_the_environment_is_set_up_and_the_log_directory_removed_at_exit(tmp_path: Path) -> None:
    program = (
        "import os\n"
        "from nena_edge_agent.nav2.session_control import prepare_environment\n"
        "prepare_environment()\n"
        "print(os.environ['FASTDDS_BUILTIN_TRANSPORTS'], os.environ['ROS_PYTHON_CHECK_FIELDS'],\n"
        "      os.environ['ROS_LOG_DIR'], os.path.isdir(os.environ['ROS_LOG_DIR']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={"TMPDIR": str(tmp_path), "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"},
        capture_output=True,
        text=True,
        check=True,
        timeout=90,
    )
    transports, check, directory, existed = done.stdout.split()
    assert (transports, check, existed) == ("UDPv4", "1", "True")
    assert Path(directory).parent == tmp_path
    assert not Path(directory).exists()


def test_threads_share_memory_pools(tmp_path: Path) -> None:
    program = (
        "import ctypes, threading\n"
        "from nena_edge_agent.nav2.session_control import POOLS, prepare_environment\n"
        "prepare_environment()\n"
        "libc, together = ctypes.CDLL(None), threading.Barrier(8)\n"
        "def allocate():\n"
        "    together.wait()\n"
        "    libc.malloc(10_000)\n"
        "    together.wait()\n"
        "threads = [threading.Thread(target=allocate) for _ in range(8)]\n"
        "[each.start() for each in threads], [each.join() for each in threads]\n"
        "libc.fopen.restype = ctypes.c_void_p\n"
        f"file = ctypes.c_void_p(libc.fopen({str(tmp_path / 'pools').encode()!r}, b'w'))\n"
        "libc.malloc_info(0, file), libc.fclose(file)\n"
        f"assert open({str(tmp_path / 'pools')!r}).read().count('<heap nr=') <= POOLS\n"
    )
    environment = {name: value for name, value in os.environ.items() if name != "MALLOC_ARENA_MAX"}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=90)


HERE, THERE = RosAddress("/r1", 7), RosAddress("/r2", 9)


class Graph:
    """Admits nodes, unless it has a reason not to."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.told: list[SessionReport] = []
        self.problem: Exception | None = None
        self.begun: list[RosAddress] = []
        self.nodes = 0
        self.door = asyncio.Event()
        self.door.set()
        self.keeper = SessionManager(
            HERE, begin=self._begin, end=self._end, on_change=self.told.append, clock=self.clock, retry=2.0
        )

    async def _begin(self, address: RosAddress) -> None:
        self.begun.append(address)
        await self.door.wait()
        if self.problem:
            raise self.problem
        self.nodes += 1

    async def _end(self) -> None:
        self.nodes -= 1

    @property
    def states(self) -> list[str]:
        return [report.state.value for report in self.told]


async def test_each_state_of_start_and_stop_is_reported() -> None:
    graph = Graph()
    await graph.keeper.start()
    await graph.keeper.stop()
    assert graph.states == ["INITIATING", "ACTIVE", "TERMINATING", "NOT_ACTIVE"]
    assert {(report.namespace, report.domain_id) for report in graph.told} == {("/r1", 7)}
    assert graph.nodes == 0


async def test_an_impatient_person_starts_it_once() -> None:
    graph = Graph()
    graph.door.clear()
    starts = [asyncio.create_task(graph.keeper.start()) for _ in range(5)]
    await until(lambda: graph.begun, what="the first start")
    graph.door.set()
    await asyncio.gather(*starts)
    assert (graph.begun, graph.nodes) == ([HERE], 1)
    assert graph.states == ["INITIATING", "ACTIVE"]


async def test_a_session_that_was_never_started_is_not_stopped() -> None:
    graph = Graph()
    await graph.keeper.stop()
    assert graph.states == []
    graph.keeper.report_stopped()
    assert graph.states == ["NOT_ACTIVE"]


async def test_simultaneous_start_and_stop_run_one_after_the_other() -> None:
    graph = Graph()
    await asyncio.gather(graph.keeper.start(), graph.keeper.stop(), graph.keeper.start())
    assert graph.states == ["INITIATING", "ACTIVE", "TERMINATING", "NOT_ACTIVE", "INITIATING", "ACTIVE"]
    assert graph.nodes == 1


async def test_a_session_that_cannot_start_reports_why_and_is_retried_with_backoff() -> None:
    graph = Graph()
    graph.problem = SessionError("no network")
    with pytest.raises(SessionError, match="no network"):
        await graph.keeper.start()
    assert graph.told[-1] == SessionReport(graph.keeper.state, "/r1", 7, "no network")
    assert graph.states == ["INITIATING", "FAILED"]

    pauses = []
    for _ in range(7):
        begun, waited = len(graph.begun), 0.0
        while len(graph.begun) == begun:
            graph.clock.advance(1.0)
            waited += 1.0
            await graph.keeper.retry_failed()
        pauses.append(waited)
    assert pauses == [2.0, 4.0, 8.0, 16.0, 32.0, LONGEST_RETRY, LONGEST_RETRY]

    graph.problem = None
    graph.clock.advance(LONGEST_RETRY)
    await graph.keeper.retry_failed()
    assert graph.states[-2:] == ["INITIATING", "ACTIVE"]
    assert graph.told[-1].reason == ""


async def test_a_lost_session_is_restarted_at_the_next_check() -> None:
    graph = Graph()
    await graph.keeper.start()
    graph.nodes = 0
    graph.keeper.failed("its thread has ended")
    assert graph.told[-1].reason == "its thread has ended"
    await graph.keeper.retry_failed()
    assert graph.states[2:] == ["FAILED", "INITIATING", "ACTIVE"]
    assert graph.nodes == 1


async def test_stopping_the_session_ends_a_failure() -> None:
    graph = Graph()
    graph.problem = SessionError("no network")
    with pytest.raises(SessionError):
        await graph.keeper.start()
    await graph.keeper.stop()
    graph.clock.advance(1000.0)
    await graph.keeper.retry_failed()
    assert graph.states == ["INITIATING", "FAILED", "NOT_ACTIVE"]
    graph.keeper.failed("late")
    assert graph.states[-1] == "NOT_ACTIVE"


async def test_an_active_session_moves_by_leaving_and_joining() -> None:
    graph = Graph()
    await graph.keeper.start()
    await graph.keeper.move(THERE)
    assert graph.begun == [HERE, THERE]
    assert graph.states[2:] == ["TERMINATING", "NOT_ACTIVE", "INITIATING", "ACTIVE"]
    assert (graph.told[-1].namespace, graph.told[-1].domain_id) == ("/r2", 9)
    assert graph.nodes == 1


async def test_a_session_that_is_off_moves_without_being_started() -> None:
    graph = Graph()
    await graph.keeper.move(THERE)
    assert graph.begun == []
    assert [(report.state, report.namespace) for report in graph.told] == [("NOT_ACTIVE", "/r2")]
    await graph.keeper.start()
    assert graph.begun == [THERE]


async def test_a_session_that_fails_where_it_moved_to_stays_there() -> None:
    graph = Graph()
    await graph.keeper.start()
    graph.problem = SessionError("no network")
    with pytest.raises(SessionError):
        await graph.keeper.move(THERE)
    assert graph.keeper.address == THERE
    graph.problem = None
    graph.clock.advance(2.0)
    await graph.keeper.retry_failed()
    assert graph.states[-1] == "ACTIVE"
    assert graph.begun[-1] == THERE


async def test_a_cancelled_start_leaves_the_session_inactive() -> None:
    graph = Graph()
    graph.door.clear()
    start = asyncio.create_task(graph.keeper.start())
    await until(lambda: graph.begun, what="the start")
    start.cancel()
    with pytest.raises(asyncio.CancelledError):
        await start
    assert graph.states == ["INITIATING", "NOT_ACTIVE"]
    graph.door.set()
    await graph.keeper.start()
    assert graph.states[-1] == "ACTIVE"


ROBOT = RobotKey("ACME", "1/a")
SETTINGS = RosSettings(namespace="/r1", domain_id=7)
NEW = RosAddress("/r2", 9)


def test_a_written_record_is_read(tmp_path: Path) -> None:
    store = SessionStore(tmp_path / "journal", ROBOT)
    assert store.read(SETTINGS) == RosAddress("/r1", 7)
    store.write(NEW, SETTINGS)
    assert SessionStore(tmp_path / "journal", ROBOT).read(SETTINGS) == NEW
    assert SessionStore(tmp_path / "journal", RobotKey("ACME", "2")).read(SETTINGS) == RosAddress("/r1", 7)


def test_settings_that_were_changed_since_count(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, ROBOT)
    store.write(NEW, SETTINGS)
    assert store.read(RosSettings(namespace="/r1", domain_id=8)) == RosAddress("/r1", 8)


def test_a_file_that_cannot_be_read_is_as_none(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, ROBOT)
    store.write(NEW, SETTINGS)
    (file,) = tmp_path.iterdir()
    file.write_text('{"address": {"namespace": "/r-2", "domain_id": 9}}')
    assert store.read(SETTINGS) == RosAddress("/r1", 7)
