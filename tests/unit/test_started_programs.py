"""Programs as processes of their own, as tests start them."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

from support import programs
from support.programs import Program, as_from_a_terminal, what_of
from support.waiting import until

PYTHON = Path(sys.executable).name
READY = "print('ready', flush=True); time.sleep(600)"
DEAF = f"import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); {READY}"


async def test_programs_end_at_sigint_though_the_tests_were_started_to_ignore_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        as_from_a_terminal()
        with Program(PYTHON, "-c", f"import time; {READY}", log=tmp_path / "log") as program:
            await program.logged("ready")
    finally:
        signal.signal(signal.SIGINT, before)
    assert "KeyboardInterrupt" in program.log
    assert "PYTHONDONTWRITEBYTECODE" not in os.environ


async def test_a_program_that_does_not_end_fails_its_test_with_its_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(programs, "ENDED_WITHIN", 0.2)
    with pytest.raises(AssertionError, match=r"did not end at SIGINT; runs: .* CPU \d") as failed:  # noqa: SIM117
        with Program(PYTHON, "-c", DEAF, log=tmp_path / "log") as program:
            await program.logged("ready")
    assert "ready" in str(failed.value)
    await until(lambda: what_of(program.process) == f"exit status {-signal.SIGKILL}")
