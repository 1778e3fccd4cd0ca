from __future__ import annotations

import httpx
import pytest

from nena_status_aggregator.aggregator import Aggregator


async def test_health_and_readiness(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    assert (await client.get("/healthz")).status_code == 200
    unready = await client.get("/readyz")
    assert unready.status_code == 503
    assert "broker" in unready.json()["detail"]
    aggregator.model.on_link(connected=True, at=aggregator.now())
    assert (await client.get("/readyz")).json() == {"status": "ready"}


@pytest.mark.usefixtures("populated")
async def test_metrics(client: httpx.AsyncClient) -> None:
    answer = await client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    assert 'nena_robots{condition="IDLE"} 1.0' in answer.text
    assert "process_resident_memory_bytes" in answer.text
