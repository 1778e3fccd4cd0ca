"""The clock of a separate process, which a test changes while the process runs."""

from __future__ import annotations

import shutil
import struct
import subprocess
from datetime import timedelta
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_suffix(".c")


class ShiftedClock:
    """Programs with its ``environment`` read the machine's clock with a shift, which is none at first."""

    def __init__(self, folder: Path) -> None:
        compiler = shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            pytest.skip("a clock of its own needs a C compiler: apt-get install gcc libc6-dev")
        self._file = folder / "shift"
        library = folder / "shifted_clock.so"
        command = [compiler, "-O2", "-shared", "-fPIC", "-o", str(library), str(SOURCE)]
        made = subprocess.run(command, check=False, timeout=60, capture_output=True, text=True)
        if made.returncode != 0:
            pytest.skip(f"a clock of its own cannot be compiled here: {made.stderr.strip()[:300]}")
        self.jump_to(timedelta())
        self.environment = {"LD_PRELOAD": str(library), "SHIFTED_CLOCK": str(self._file)}

    def jump_to(self, shift: timedelta) -> None:
        """Set the clock's offset from the machine's clock."""
        mode = "r+b" if self._file.exists() else "wb"
        with self._file.open(mode) as file:
            file.write(struct.pack("=q", int(shift.total_seconds() * 1e9)))
