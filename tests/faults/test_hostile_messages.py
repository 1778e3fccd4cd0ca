"""Thousands of damaged, hostile and repeated messages, on every topic and route, while the site works."""

from __future__ import annotations

import re
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

HTTP_SHARE = 5
"""One request for so many messages."""
STRICT_SERVICES = {"NENA_FLEET__STRICT": "true"}
STRICT_ROBOTS = {"NENA_STRICT": "true"}
"""Whoever may write a robot's topics is believed where a message can be repaired; here all are refused."""
REPLAYED = ("repeated", "late")
"""What a replayed state counts as: only the newest one is a repeated one."""
SWITCHED_OFF = "/api/v1/control"
"""Where the aggregator says that it has no order service to ask, 503."""


async def test_hostile_messages_do_no_harm(trial: Callable[..., Any]) -> None:
    async with trial(seed=6, services_in=STRICT_SERVICES, robots_in=STRICT_ROBOTS) as running:
        enemy = Enemy(running.site, Random(6))
        async with httpx.AsyncClient(base_url=running.site.aggregator_url, timeout=60) as aggregator:
            await enemy.look_around(aggregator)
            for number in range(HOSTILE_MESSAGES):
                enemy.say()
                if number % HTTP_SHARE == 0:
                    assert_answered(await enemy.ask(number // HTTP_SHARE))
            await running.recovers("hostile messages")
            metrics = (await aggregator.get("/metrics")).raise_for_status().text

    assert len(enemy.routes) <= HOSTILE_MESSAGES / HTTP_SHARE, "each route is asked"
    assert enemy.topics >= {
        *Topic,
        "create",
        "withdraw",
        "putZoneSet",
        "status",
        "plantModel",
        "map",
        "control",
    }
    assert count(metrics, 'nena_messages_malformed_total{topic="state"}') > 0
    ignored = [f'nena_messages_ignored_total{{reason="{reason}",topic="state"}}' for reason in REPLAYED]
    assert sum(count(metrics, each) for each in ignored) > 0


def assert_answered(answer: httpx.Response | None) -> None:
    """Check that a request was answered without a failure of the service."""
    if answer is not None and not answer.request.url.path.startswith(SWITCHED_OFF):
        assert answer.status_code < HTTPStatus.INTERNAL_SERVER_ERROR, f"{answer.request.url}: {answer.text}"


def count(metrics: str, sign: str) -> float:
    """Return the value of a metric, 0 if it is missing."""
    found = re.search(rf"^{re.escape(sign)} (\S+)$", metrics, re.MULTILINE)
    return float(found[1]) if found else 0.0
