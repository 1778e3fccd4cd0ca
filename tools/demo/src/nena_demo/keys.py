"""Keys of the person who watches the demo: from a terminal without Enter, or from a pipe."""

from __future__ import annotations

import asyncio
import os
import signal
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress

READ_AT_ONCE = 256


@contextmanager
def pressed_keys(source: int) -> Iterator[asyncio.Queue[str]]:
    """Return a queue of the characters that arrive at the file descriptor ``source``, without white space.

    It stays empty if ``source`` can deliver none, such as /dev/null, or a terminal while the demo runs in the
    background.
    """
    keys: asyncio.Queue[str] = asyncio.Queue()
    loop = asyncio.get_running_loop()

    def readable() -> None:
        read = _read_keys(source)
        if not read:
            loop.remove_reader(source)
        for key in read.decode(errors="ignore"):
            if not key.isspace():
                keys.put_nowait(key)

    with _without_enter(source) as usable:
        if usable:
            with suppress(OSError):  # epoll refuses files and /dev/null
                loop.add_reader(source, readable)
        try:
            yield keys
        finally:
            loop.remove_reader(source)


def _read_keys(source: int) -> bytes:
    try:
        return os.read(source, READ_AT_ONCE)
    except OSError:
        return b""


@contextmanager
def _without_enter(source: int) -> Iterator[bool]:
    """Deliver each key of a terminal at once and without echo; return whether ``source`` may be read."""
    if not os.isatty(source):
        yield True
        return
    if not _in_foreground(source):  # reading would stop the process
        yield False
        return
    before = termios.tcgetattr(source)
    tty.setcbreak(source)
    # In the background, after Ctrl-Z and bg, they would stop the demo and leave its programs running.
    handlers = {each: signal.signal(each, signal.SIG_IGN) for each in (signal.SIGTTIN, signal.SIGTTOU)}
    try:
        yield True
    finally:
        termios.tcsetattr(source, termios.TCSADRAIN, before)
        for each, handler in handlers.items():
            signal.signal(each, handler)


def _in_foreground(terminal: int) -> bool:
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:  # the terminal of another session
        return False
