"""What happens to the broker: orders go on where they were, none is lost, none is done twice."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from faults.extent import TIMES, only_in_whole
from support.pausing import time_passes

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(900)]

FROZEN = 25.0
"""Seconds: longer than the keep-alive of every program."""


@pytest.mark.parametrize(
    "persistence",
    [pytest.param(True, id="persistent", marks=only_in_whole), pytest.param(False, id="forgetful")],
)
async def test_killed_and_started_again(trial: Callable[..., Any], *, persistence: bool) -> None:
    async with trial(persistence=persistence) as running:
        for _ in range(2 * TIMES):
            running.site.broker.restart()
            await running.recovers("broker killed")


@only_in_whole
async def test_frozen(trial: Callable[..., Any]) -> None:
    async with trial() as running:
        for _ in range(TIMES):
            running.site.broker.freeze()
            try:
                await time_passes(FROZEN)
            finally:
                running.site.broker.thaw()
            await running.recovers("broker frozen")
