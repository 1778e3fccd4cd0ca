"""What a signal to the demo means."""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from nena_demo import __main__ as demo
from nena_demo.session import ProgressPrinter
from support.waiting import PATIENCE


def test_the_version_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        demo.main(["--version"])
    assert capsys.readouterr().out == f"nena-demo {version('nena-demo')}\n"


async def test_lost_cancellation_is_repeated(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stops = 0

    async def deaf(*arguments: object) -> int:
        nonlocal stops
        assert arguments
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
            try:
                await asyncio.Event().wait()
            except asyncio.CancelledError:
                stops += 1
        return 0

    monkeypatch.setattr(demo, "_run_command", deaf)
    monkeypatch.setattr(demo, "STOP_TIMEOUT", 0.1)
    async with asyncio.timeout(PATIENCE):
        status = await demo._until_stopped(argparse.Namespace(), tmp_path, ProgressPrinter(sys.stdout))

    assert (status, stops) == (demo.EXIT_STOPPED, 2)
    assert capsys.readouterr().out.count("stopping everything") == 1
