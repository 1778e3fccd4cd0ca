"""The metrics of a real edge agent, read over its own port."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from nena_edge_agent.metrics import SECTIONS
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet
from support.waiting import PATIENCE, awaited

pytestmark = pytest.mark.broker

ROBOT = {"manufacturer": "NeNa", "serial_number": "robot-01"}
SAID_LATER = {
    "nena_agent_fleet_clock_skew_seconds",
    "nena_agent_ros_session",
    "nena_trace_spans_total",
    "nena_certificate_expiry_timestamp_seconds",
    "nena_certificate_lifetime_seconds",
    "nena_recordings_total",
    "nena_recordings_waiting",
    "nena_recordings_sent_bytes_total",
}
"""Known after the first order, or of robots with ROS, traces, certificates or a black box only."""


@pytest.fixture
async def client(broker: Broker, interface_name: str, tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    """Start a loopback robot with metrics, and wait until it is connected."""
    fleet = Fleet(broker, interface_name, tmp_path)
    port = free_port()
    with fleet.stack:
        fleet.agent_of(f"metrics = {{port = {port}}}\n{fleet.agent_file()}")
        transport = httpx.AsyncHTTPTransport(retries=3)
        url = f"http://127.0.0.1:{port}"
        async with httpx.AsyncClient(base_url=url, timeout=PATIENCE, transport=transport) as client:
            await awaited(
                lambda: sample(client, "nena_agent_mqtt_connected"), lambda now: now == 1, what="it is up"
            )
            yield client


async def sample(client: httpx.AsyncClient, name: str, **labels: str) -> float | None:
    try:
        text = (await client.get("/metrics")).text
    except httpx.TransportError:
        return None
    for family in text_string_to_metric_families(text):
        for each in family.samples:
            if each.name == name and each.labels.items() >= labels.items():
                return each.value
    return None


async def test_each_metric_is_shown_with_its_robot(client: httpx.AsyncClient) -> None:
    families = {
        each.name: each for each in text_string_to_metric_families((await client.get("/metrics")).text)
    }
    for metric in (each for section in SECTIONS for each in section.metrics):
        family = families[metric.name.removesuffix("_total")]
        assert family.type == metric.kind.value
        assert family.samples or metric.name in SAID_LATER, metric.name
        for each in family.samples:
            assert set(metric.labels) <= set(each.labels), metric.name
            if "serial_number" in metric.labels:
                assert each.labels.items() >= ROBOT.items()


async def test_metrics_show_what_the_robot_does(client: httpx.AsyncClient) -> None:
    assert await sample(client, "nena_agent_journal_works") == 1
    assert (await sample(client, "nena_agent_journal_seconds_count") or 0) > 0
    assert (await sample(client, "nena_agent_disk_free_bytes") or 0) > 0
    assert (await sample(client, "nena_agent_mqtt_published_total") or 0) > 0
    assert await sample(client, "nena_agent_messages_total", outcome="malformed") == 0


@pytest.mark.parametrize(
    ("method", "path", "status"), [("GET", "/", 404), ("POST", "/metrics", 405), ("GET", "/metrics", 200)]
)
async def test_only_metrics_are_served(
    client: httpx.AsyncClient, method: str, path: str, status: int
) -> None:
    assert (await client.request(method, path)).status_code == status


async def test_oversized_requests_are_disconnected_and_others_answered(client: httpx.AsyncClient) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", client.base_url.port)
    writer.write(b"GET /metrics HTTP/1.1\r\nX: " + b"x" * 20_000)
    try:
        assert await asyncio.wait_for(reader.read(), PATIENCE) == b""
    except ConnectionResetError:
        pass  # closed with some of it unread
    finally:
        writer.close()
    assert (await client.get("/metrics")).status_code == 200
