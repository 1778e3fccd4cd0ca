from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import termios
from pathlib import Path

from nena_demo.keys import pressed_keys
from support.waiting import PATIENCE, until


async def next_key(keys: asyncio.Queue[str]) -> str:
    async with asyncio.timeout(PATIENCE):
        return await keys.get()


async def test_keys_arrive_from_a_pipe_without_white_space_until_it_ends() -> None:
    read, write = os.pipe()
    with pressed_keys(read) as keys:
        os.write(write, b"b k\no\n")
        assert [await next_key(keys) for _ in range(3)] == ["b", "k", "o"]
        os.close(write)
        remove = asyncio.get_running_loop().remove_reader
        await until(lambda: not remove(read), what="the end of the pipe is noticed")

        assert keys.empty()
    os.close(read)


async def test_no_keys_come_from_what_has_none(tmp_path: Path) -> None:
    file = tmp_path / "keys"
    file.write_text("b")
    for name in (os.devnull, str(file)):
        source = os.open(name, os.O_RDONLY)
        with pressed_keys(source) as keys:
            assert keys.empty()
        os.close(source)


async def test_pseudo_terminal_of_another_session_is_left_as_it_is() -> None:
    manager, terminal = os.openpty()
    before = termios.tcgetattr(terminal)
    with pressed_keys(terminal) as keys:
        assert termios.tcgetattr(terminal) == before
        assert keys.empty()
    os.close(terminal)
    os.close(manager)


FIRST_KEY = """
import asyncio, fcntl, termios
from nena_demo.keys import pressed_keys
fcntl.ioctl(0, termios.TIOCSCTTY, 0)

async def main():
    with pressed_keys(0) as keys:
        print("ready", flush=True)
        print(await keys.get(), flush=True)

asyncio.run(main())
"""


def test_a_key_of_the_terminal_needs_no_enter_and_the_terminal_is_restored() -> None:
    manager, terminal = os.openpty()
    before = termios.tcgetattr(terminal)
    with subprocess.Popen(
        [sys.executable, "-c", FIRST_KEY],
        stdin=terminal,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout
        assert process.stdout.readline() == "ready\n"
        os.write(manager, b"e")

        assert process.stdout.readline() == "e\n"
        assert process.wait(PATIENCE) == 0
    assert termios.tcgetattr(terminal) == before
    os.close(terminal)
    os.close(manager)
