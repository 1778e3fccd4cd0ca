"""A separate network behind one line, which a test cuts, slows and makes lossy. Needs root on Linux.

The line is a pair of TAP devices whose frames this process forwards: one here, one in a network namespace.
TCP behaves as in the field, with retransmissions and timeouts. (tc's netem does the same in the kernel; not
every kernel has it.)
"""

from __future__ import annotations

import fcntl
import heapq
import itertools
import os
import select
import shutil
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random

import pytest

TUNSETIFF = 0x400454CA
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
LONGEST_FRAME = 65_536
MOST_WAITING = 1.0
"""Queue of a slow line, in seconds of its capacity; beyond it, frames are lost, as at a router."""
IDLE = 0.2
"""Interval between checks whether it has ended, seconds."""

_numbers = itertools.count()


@dataclass(frozen=True, slots=True)
class Condition:
    """Treatment of frames in both directions."""

    delay: float = 0.0
    """Delay in one direction, seconds."""
    loss: float = 0.0
    """Share of lost frames, 0 to 1."""
    rate: float = float("inf")
    """Bandwidth in each direction, bits per second."""


FINE = Condition()
SILENT = Condition(loss=1.0)
"""Whether the line is cut, without a FIN: each side assumes that the other one is still connected."""


@dataclass(slots=True)
class _Way:
    """One direction of the line."""

    into: int
    free_at: float = 0.0
    """Time at which the frames before have been sent."""


@dataclass
class Line:
    """The line between this side (``near``) and the namespace (``far``)."""

    near: str
    far: str
    namespace: str
    device: str
    """Address of the namespace."""
    condition: Condition = FINE
    _ends: tuple[int, int] = (-1, -1)
    _waiting: list[tuple[float, int, int, bytes]] = field(default_factory=list)
    _order: Iterator[int] = field(default_factory=itertools.count)
    _over: threading.Event = field(default_factory=threading.Event)

    @property
    def command(self) -> tuple[str, ...]:
        """Return the prefix of a command that runs in the namespace."""
        return ("ip", "netns", "exec", self.namespace)

    def down(self) -> None:
        """Set the namespace's own device down: programs there notice it, the others do not."""
        _run(*self.command, "ip", "link", "set", self.device, "down")

    def up(self) -> None:
        """End :meth:`down`."""
        _run(*self.command, "ip", "link", "set", self.device, "up")

    def change(self, **conditions: float) -> None:
        """Change some conditions."""
        self.condition = replace(self.condition, **conditions)

    def carry(self) -> None:
        """Forward frames until the line is closed."""
        chance = Random(1)
        ways = {self._ends[0]: _Way(self._ends[1]), self._ends[1]: _Way(self._ends[0])}
        while not self._over.is_set():
            now = time.monotonic()
            self._send_due(now)
            patience = min(IDLE, max(0.0, self._waiting[0][0] - now)) if self._waiting else IDLE
            for end in select.select(self._ends, (), (), patience)[0]:
                self._take(ways[end], os.read(end, LONGEST_FRAME), chance)

    def end(self) -> None:
        """Let :meth:`carry` return."""
        self._over.set()

    def _take(self, way: _Way, frame: bytes, chance: Random) -> None:
        condition, now = self.condition, time.monotonic()
        if chance.random() < condition.loss:
            return
        start = max(now, way.free_at)
        if start - now > MOST_WAITING:
            return
        way.free_at = start + len(frame) * 8 / condition.rate
        heapq.heappush(self._waiting, (way.free_at + condition.delay, next(self._order), way.into, frame))

    def _send_due(self, now: float) -> None:
        while self._waiting and self._waiting[0][0] <= now:
            _, _, into, frame = heapq.heappop(self._waiting)
            with suppress(OSError):  # the device is down: the frame is lost
                os.write(into, frame)


@contextmanager
def line() -> Iterator[Line]:
    """Yield a line to a new namespace; skip the test if none can be created."""
    number = os.getpid() % 30_000 * 8 + next(_numbers) % 8
    third, fourth = number // 64 % 256, number % 64 * 4
    names = f"nena{number}a", f"nena{number}b"
    made = Line(
        near=f"198.18.{third}.{fourth + 1}",
        far=f"198.18.{third}.{fourth + 2}",
        namespace=f"nena-{number}",
        device=names[1],
    )
    _require()
    try:
        _run("ip", "netns", "add", made.namespace)
    except subprocess.CalledProcessError as error:
        pytest.skip(f"no network namespace can be made here: {error.stderr.strip()}")
    ends: list[int] = []
    carrying = threading.Thread(target=made.carry, name=f"line {number}", daemon=True)
    try:
        ends += [_tap(each) for each in names]
        _connect(made, names)
        made._ends = (ends[0], ends[1])
        carrying.start()
        yield made
    finally:
        made.end()
        if carrying.ident:
            carrying.join()
        for each in ends:
            os.close(each)
        _run("ip", "netns", "del", made.namespace)


def _require() -> None:
    if os.geteuid() != 0:
        pytest.skip("a network of its own needs root")
    if shutil.which("ip") is None:
        pytest.skip("a network of its own needs iproute2: apt-get install iproute2")
    if not Path("/dev/net/tun").exists():
        pytest.skip("a network of its own needs /dev/net/tun, which this kernel does not give")


def _tap(name: str) -> int:
    try:
        end = os.open("/dev/net/tun", os.O_RDWR)
        fcntl.ioctl(end, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TAP | IFF_NO_PI))
    except OSError as error:
        pytest.skip(f"no TAP device can be made here: {error.strerror}")
    return end


def _connect(made: Line, names: tuple[str, str]) -> None:
    _run("ip", "link", "set", names[1], "netns", made.namespace)
    for command, name, address in (((), names[0], made.near), (made.command, names[1], made.far)):
        _run(*command, "ip", "address", "add", f"{address}/30", "dev", name)
        _run(*command, "ip", "link", "set", name, "up")
    _run(*made.command, "ip", "link", "set", "lo", "up", "multicast", "on")
    _run(*made.command, "ip", "route", "add", "224.0.0.0/4", "dev", "lo")


def _run(*command: str) -> None:
    subprocess.run(command, check=True, timeout=30, capture_output=True, text=True)
