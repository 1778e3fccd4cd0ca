from __future__ import annotations

import asyncio
from unittest.mock import Mock

import pytest

from nena_order_service.api.statuses import RetainedSweep
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import MqttLink
from nena_shared.settings import MqttSettings
from support.forgetful import cancel_again_at_once, forgetful
from support.pausing import turn_passes
from support.waiting import PATIENCE


async def test_it_ends_also_when_its_link_forgets_that_it_is_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    cancel_again_at_once(monkeypatch)
    monkeypatch.setattr(MqttLink, "run", forgetful)
    sweep = RetainedSweep(
        MqttSettings(), client_id="sweep", engine=Mock(), publisher=Mock(topics=FleetTopics())
    )
    running = asyncio.create_task(sweep.run(), name="sweep")
    await turn_passes()
    await turn_passes()
    running.cancel()
    await asyncio.wait({running}, timeout=PATIENCE)
    assert running.cancelled()
