from __future__ import annotations

from importlib.metadata import version

import httpx
import pytest

from nena_shared.web.compression import takes_gzip
from nena_status_aggregator.aggregator import Aggregator


async def test_files_outside_the_panel_are_not_served(client: httpx.AsyncClient) -> None:
    assert (await client.get("/..%2f__init__.py")).status_code == 404


async def test_openapi_document_is_served(client: httpx.AsyncClient) -> None:
    described = (await client.get("/api/v1/openapi.json")).json()
    assert {
        "/api/v1/fleet",
        "/api/v1/robots/{manufacturer}/{serial}",
        "/api/v1/robots/{manufacturer}/{serial}/actions",
        "/api/v1/robots/{manufacturer}/{serial}/map",
        "/api/v1/orders",
        "/api/v1/peripherals",
        "/api/v1/control/stops",
        "/api/v1/control/stops/{name}/end",
        "/api/v1/plant",
        "/api/v1/attention",
        "/api/v1/attention/{matter_id}/acknowledgement",
        "/api/v1/session",
        "/api/v1/session/oidc",
        "/api/v1/control",
        "/api/v1/control/{path}",
        "/api/v1/events",
        "/healthz",
        "/api/v1/recordings",
        "/api/v1/recordings/{manufacturer}/{serial}/{name}",
        "/api/v1/history",
        "/api/v1/history.csv",
        "/api/v1/history.jsonl",
        "/api/v1/replay",
        "/api/v1/report",
        "/api/v1/report.csv",
        "/readyz",
        "/metrics",
    } == set(described["paths"])
    assert "stateAge" in described["components"]["schemas"]["RobotResource"]["properties"]


async def test_page_has_a_strict_content_security_policy(client: httpx.AsyncClient) -> None:
    page = await client.get("/")
    assert page.headers["content-type"].startswith("text/html")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "*" not in policy
    assert page.headers["cache-control"] == "no-cache"
    script = await client.get("/main.js")
    assert script.headers["content-type"].split(";")[0] in ("text/javascript", "application/javascript")
    assert script.headers["x-content-type-options"] == "nosniff"


async def test_health_and_readiness(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    alive = await client.get("/healthz")
    assert alive.json() == {"status": "ok", "version": version("nena-status-aggregator")}
    unready = await client.get("/readyz")
    assert unready.status_code == 503
    assert "broker" in unready.json()["detail"]
    aggregator.model.on_link(connected=True, at=aggregator.now())
    assert (await client.get("/readyz")).json() == {"status": "ready"}


@pytest.mark.usefixtures("populated")
async def test_metrics_are_compressed_for_clients_that_accept_gzip(client: httpx.AsyncClient) -> None:
    plain = await client.get("/metrics", headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers
    packed = await client.get("/metrics", headers={"accept-encoding": "br;q=1.0, gzip;q=0.5"})
    assert packed.headers["content-encoding"] == "gzip"
    assert packed.headers["vary"] == "Accept-Encoding"
    assert int(packed.num_bytes_downloaded) < len(plain.content) / 3
    names = [{line.split(" ")[0] for line in each.text.splitlines()} for each in (plain, packed)]
    assert names[0] == names[1]


@pytest.mark.parametrize(
    ("header", "taken"),
    [
        ("gzip", True),
        ("*", True),
        ("GZIP;q=0.1", True),
        ("gzip;q=0", False),
        ("gzip; q=0.000", False),
        ("br", False),
        ("", False),
    ],
)
def test_accept_encoding_header(header: str, *, taken: bool) -> None:
    assert takes_gzip(header) is taken
