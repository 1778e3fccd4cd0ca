"""The clock of a separate process, which a test sets and lets drift while the process runs."""

from __future__ import annotations

import shutil
import struct
import subprocess
import time
from datetime import timedelta
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_suffix(".c")
COUNTS = struct.Struct("=q")
READING = struct.Struct("=4q")
NS = 1_000_000_000
PER_MILLION = 1_000_000


class ShiftedClock:
    """Programs with its ``environment`` read a time of day that is right at first.

    A drift shows in the time since boot, too, by which leases are measured. Waits and the monotonic clock
    stay right.
    """

    def __init__(self, folder: Path) -> None:
        compiler = shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            pytest.skip("a clock of its own needs a C compiler: apt-get install gcc libc6-dev")
        library = folder / "shifted_clock.so"
        command = [compiler, "-O2", "-shared", "-fPIC", "-o", str(library), str(SOURCE)]
        made = subprocess.run(command, check=False, timeout=60, capture_output=True, text=True)
        if made.returncode != 0:
            pytest.skip(f"a clock of its own cannot be compiled here: {made.stderr.strip()[:300]}")
        self._file = folder / "shift"
        self._file.write_bytes(COUNTS.pack(0) + 2 * READING.pack(0, 0, 0, 0))
        self._counts = 0
        self._gained = self._since = self._rate = 0
        """What the drift had gained at ``since`` (ns), and what it gains of a million."""
        self.environment = {"LD_PRELOAD": str(library), "SHIFTED_CLOCK": str(self._file)}

    def jump_to(self, shift: timedelta) -> None:
        """Set the time of day to this offset from the machine's, and end a drift."""
        self._gain(0)
        self._write(round(shift.total_seconds() * NS) - self._gained)

    def drift(self, rate: float) -> None:
        """Let the clock gain ``rate`` seconds in each second, from the right time on."""
        self._gain(round(rate * PER_MILLION))
        self._write(-self._gained)

    def _gain(self, rate: int) -> None:
        now = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        self._gained += (now - self._since) * self._rate // PER_MILLION
        self._since, self._rate = now, rate

    def _write(self, shift: int) -> None:
        """Write a reading beside the one that counts, then let it count: programs read at any moment."""
        self._counts += 1
        with self._file.open("r+b", buffering=0) as file:
            file.seek(COUNTS.size + self._counts % 2 * READING.size)
            file.write(READING.pack(shift, self._gained, self._since, self._rate))
            file.seek(0)
            file.write(COUNTS.pack(self._counts))
