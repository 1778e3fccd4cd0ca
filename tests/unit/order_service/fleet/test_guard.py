from __future__ import annotations

import asyncio

import pytest

from nena_order_service.fleet import guard
from nena_order_service.fleet.guard import FleetGuard
from nena_shared.mqtt import always
from nena_shared.settings import MqttSettings
from support.pausing import time_passes
from support.waiting import PATIENCE


async def test_the_decision_timeout_starts_once_the_broker_is_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(guard, "DECIDED_WITHIN", 0.05)
    monkeypatch.setattr(guard, "CONNECTED_WITHIN", PATIENCE)
    guarding = FleetGuard(MqttSettings(), "nena/v1/leader/uagv", store="S", epoch=1, term=always)
    deciding = asyncio.create_task(guarding.decided())
    await time_passes(0.2)
    assert not deciding.done(), "the broker is still being connected"
    guarding._ask_leader()
    async with asyncio.timeout(PATIENCE):
        await deciding
    assert not guarding.won.is_set()
