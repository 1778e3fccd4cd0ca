from __future__ import annotations

import httpx

from nena_status_aggregator.aggregator import Aggregator


async def test_too_many_followers_are_told_so(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    aggregator.events.clients = 1
    answer = await client.get("/api/v1/events")
    assert (answer.status_code, answer.json()["title"]) == (503, "Service Unavailable")
