"""The instruments of the fault tests do what the tests expect."""

from __future__ import annotations

import asyncio
import errno
import os
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest

from faults.footprint import Footprint, grown
from support.network import Line, line
from support.shifted_clock import ShiftedClock
from support.small_disk import small_disk

PORT = 7007
DELAY = 0.2
TIMES = "import time, datetime; print(time.time(), datetime.datetime.now().timestamp(), time.monotonic())"
FOREVER = (
    "import sys, time\n"
    "for _ in sys.stdin: print(time.time(), time.clock_gettime(time.CLOCK_BOOTTIME), time.monotonic(), "
    "flush=True)"
)
FAST = 100.0
"""Seconds that a clock gains in each second: more than any machine delays a reading."""


async def answer_time(found: Line, seconds: float = 20) -> float:
    """Request a server on this side from a program behind the line, and return the time of its answer."""

    async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(await reader.readexactly(1))
        writer.close()

    asking = (
        f"import socket, time; s = socket.create_connection(({found.near!r}, {PORT}), timeout={seconds}); "
        "t = time.monotonic(); s.sendall(b'x'); assert s.recv(1) == b'x'; print(time.monotonic() - t)"
    )
    async with await asyncio.start_server(echo, found.near, PORT):
        program = await asyncio.create_subprocess_exec(
            *found.command, sys.executable, "-c", asking, stdout=asyncio.subprocess.PIPE
        )
        out, _ = await program.communicate()
    return float(out) if program.returncode == 0 else float("inf")


async def test_a_link_is_slow_or_cut_and_restored() -> None:
    with line() as found:
        assert await answer_time(found) < float("inf")

        found.change(delay=DELAY)
        assert await answer_time(found) >= 2 * DELAY

        found.change(delay=0.0, loss=1.0)
        assert await answer_time(found, seconds=2) == float("inf")

        found.change(loss=0.0)
        found.down()
        assert await answer_time(found, seconds=2) == float("inf")

        found.up()
        assert await answer_time(found) < float("inf")


def test_a_full_disk_rejects_writes_until_there_is_room(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", megabytes=1) as disk:
        file = disk.folder / "file"
        file.write_bytes(b"old")
        disk.fill()

        with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
            (disk.folder / "other").write_bytes(bytes(5000))

        disk.clear()
        (disk.folder / "other").write_bytes(bytes(5000))
        assert file.read_bytes() == b"old"


def test_a_clock_jump_affects_only_its_programs(tmp_path: Path) -> None:
    clock = ShiftedClock(tmp_path)
    clock.jump_to(timedelta(hours=-3))
    out = subprocess.run(
        [sys.executable, "-c", TIMES],
        env=os.environ | clock.environment,
        check=True,
        timeout=90,
        capture_output=True,
    ).stdout
    of_day, of_date, monotonic = map(float, out.split())

    assert of_day == pytest.approx(time.time() - 3 * 3600, abs=60)
    assert of_date == pytest.approx(of_day, abs=60)
    assert monotonic == pytest.approx(time.monotonic(), abs=60)


def test_a_clock_drifts_while_its_program_runs_and_is_set_right_again(tmp_path: Path) -> None:
    clock = ShiftedClock(tmp_path)
    command = [sys.executable, "-c", FOREVER]
    with subprocess.Popen(
        command, env=os.environ | clock.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdin is not None
        assert program.stdout is not None

        def ahead() -> tuple[float, float, float]:
            """Return what each clock of the program is ahead of this one's by, about."""
            assert program.stdin is not None
            assert program.stdout is not None
            program.stdin.write("\n")
            program.stdin.flush()
            told = map(float, program.stdout.readline().split())
            own = (time.time(), time.clock_gettime(time.CLOCK_BOOTTIME), time.monotonic())
            day, boot, monotonic = (theirs - ours for theirs, ours in zip(told, own, strict=True))
            return day, boot, monotonic

        ahead()  # it runs
        begun = time.monotonic()
        clock.drift(FAST)
        day, boot, monotonic = ahead()
        passed = time.monotonic() - begun
        assert 0 < boot <= (FAST + 1) * passed
        assert day == pytest.approx(boot, abs=passed * FAST + 1)
        assert abs(monotonic) < passed + 1

        clock.jump_to(timedelta())
        kept = ahead()
        again = ahead()
        program.stdin.close()
    assert abs(kept[0]) < 1, "the time of day is right"
    assert kept[1] >= boot - 1, "the time since boot does not go back"
    assert again[1] == pytest.approx(kept[1], abs=1), "it does not drift any more"


@pytest.mark.parametrize(
    "more",
    [
        lambda each: Footprint(each.megabytes + 100, each.descriptors, each.threads),
        lambda each: Footprint(each.megabytes, each.descriptors + 100, each.threads),
        lambda each: Footprint(each.megabytes, each.descriptors, each.threads + 100),
    ],
)
def test_growth_is_reported(more: Callable[[Footprint], Footprint]) -> None:
    now = Footprint.of(os.getpid())

    assert grown({"here": now}, {"here": now, "new": now}) == {}
    assert list(grown({"here": now}, {"here": more(now)})) == ["here"]
