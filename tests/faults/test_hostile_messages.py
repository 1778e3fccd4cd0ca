"""Thousands of damaged, hostile and repeated messages, on every topic and route, while the site works."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from random import Random
from typing import Any

import httpx
import pytest

from faults.enemy import Enemy
from faults.extent import HOSTILE_MESSAGES
from nena_shared.vda5050.topics import Topic

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(1800)]

HTTP_SHARE = 10
"""One request for so many messages."""


async def test_nobody_is_impressed(trial: Callable[..., Any]) -> None:
    async with trial(seed=6) as running:
        enemy = Enemy(running.site, Random(6))
        async with httpx.AsyncClient(base_url=running.site.aggregator_url, timeout=60) as aggregator:
            await enemy.look_around(aggregator)
            for number in range(HOSTILE_MESSAGES):
                payload = enemy.say()
                if number % HTTP_SHARE == 0:
                    answer = await enemy.ask(number // HTTP_SHARE, payload)
                    assert answer is None or answer.status_code != HTTPStatus.INTERNAL_SERVER_ERROR, (
                        answer.text
                    )
        await running.recovers("hostile messages")

    assert len(enemy.routes) <= HOSTILE_MESSAGES / HTTP_SHARE, "each route is asked"
    assert enemy.topics >= {*Topic, "create", "withdraw", "putZoneSet", "status", "plantModel"}
