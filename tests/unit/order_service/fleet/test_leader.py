from __future__ import annotations

import asyncio

import pytest

from nena_order_service.fleet import leader
from nena_order_service.fleet.leader import LeaderElection
from nena_shared.mqtt import always
from nena_shared.settings import MqttSettings
from support.pausing import time_passes
from support.waiting import PATIENCE


async def test_the_decision_timeout_starts_once_the_broker_is_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(leader, "DECIDED_WITHIN", 0.05)
    monkeypatch.setattr(leader, "CONNECTED_WITHIN", PATIENCE)
    election = LeaderElection(MqttSettings(), "nena/v1/leader/uagv", store="S", epoch=1, term=always)
    deciding = asyncio.create_task(election.decided())
    await time_passes(0.2)
    assert not deciding.done(), "the broker is still being connected"
    election._ask()
    async with asyncio.timeout(PATIENCE):
        await deciding
    assert not election.won.is_set()
