"""Commands: what is passed on to an order service, here a small real HTTP server, and what is refused."""

from __future__ import annotations

import json
import threading
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import httpx
import pytest
from pydantic import HttpUrl

from nena_shared.web.access import COOKIE
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.api.control import BODY_LIMIT
from nena_status_aggregator.settings import AggregatorSettings, HistorySettings, OrderServiceSettings
from support.broker import free_port
from support.clocks import ManualClock
from support.fleet_examples import START
from support.waiting import PATIENCE

ORDER = {"destinations": [{"locationName": "A"}]}


@dataclass
class Far:
    """The requests received by the server on the other side."""

    port: int = 0
    asked: list[tuple[str, str, Any]] = field(default_factory=list)
    cookies: list[str | None] = field(default_factory=list)
    authorized: list[str | None] = field(default_factory=list)


@pytest.fixture
def far() -> Iterator[Far]:
    far = Far()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._answer(None)

        def do_POST(self) -> None:
            self._answer(json.loads(self.rfile.read(int(self.headers["content-length"]))))

        def do_PUT(self) -> None:
            self.do_POST()

        def do_DELETE(self) -> None:
            self.do_POST()

        def _answer(self, body: Any) -> None:
            far.asked.append((self.command, self.path, body))
            far.cookies.append(self.headers.get("cookie"))
            far.authorized.append(self.headers.get("authorization"))
            status = 409 if "taken" in self.path else 201 if body else 200
            self.send_response(status)
            self.send_header(
                "content-type", "application/problem+json" if status == 409 else "application/json"
            )
            self.send_header("set-cookie", "a=b")
            self.end_headers()
            self.wfile.write(b'{"name": "TO-1"}')

        def log_message(self, *_: Any) -> None:
            """Log nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        far.port = server.server_address[1]
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), name="far")
        thread.start()
        yield far
        server.shutdown()
        thread.join(PATIENCE)


def client_of(port: int | None, base: str = "http://127.0.0.1:8080") -> httpx.AsyncClient:
    settings = AggregatorSettings(history=HistorySettings(url=None))
    url = HttpUrl(f"http://127.0.0.1:{port}") if port else None
    aggregator = Aggregator(settings, ManualClock(start=START))
    app = make_app(aggregator, settings.http, OrderServiceSettings(url=url, timeout=5))
    transport = httpx.ASGITransport(app, raise_app_exceptions=False)
    return httpx.AsyncClient(transport=transport, base_url=f"{base}/api/v1/control")


@pytest.fixture
async def client(far: Far) -> AsyncIterator[httpx.AsyncClient]:
    async with client_of(far.port) as made:
        yield made


async def test_command_is_forwarded_with_its_response(client: httpx.AsyncClient, far: Far) -> None:
    answer = await client.post("/transportOrders", json=ORDER, headers={"cookie": "secret=1"})
    assert (answer.status_code, answer.json()) == (201, {"name": "TO-1"})
    assert "set-cookie" not in answer.headers
    assert far.asked == [("POST", "/v1/transportOrders", ORDER)]
    assert (far.cookies, far.authorized) == ([None], [None])


@pytest.mark.parametrize("headers", [{"authorization": "Bearer t"}, {"cookie": f"{COOKIE}=t"}])
async def test_user_token_is_forwarded_to_the_order_service(
    headers: dict[str, str], client: httpx.AsyncClient, far: Far
) -> None:
    await client.post("/transportOrders", json=ORDER, headers=headers)

    assert (far.cookies, far.authorized) == ([None], ["Bearer t"])


async def test_questions_keep_their_query_and_names_their_signs(client: httpx.AsyncClient, far: Far) -> None:
    await client.get("/vehicles/Robot%2F1%20a")
    await client.get("/transportOrders?state=FAILED&limit=5")
    assert [path for _, path, _ in far.asked] == [
        "/v1/vehicles/Robot%2F1%20a",
        "/v1/transportOrders?state=FAILED&limit=5",
    ]


async def test_a_path_is_locked(client: httpx.AsyncClient, far: Far) -> None:
    answer = await client.put("/paths/A%2FB%20---%20C/lock", json={"locked": True})
    assert answer.status_code == 201
    assert far.asked == [("PUT", "/v1/paths/A%2FB%20---%20C/lock", {"locked": True})]


async def test_a_schedule_is_deleted_and_nothing_else(client: httpx.AsyncClient, far: Far) -> None:
    for path, status in (
        ("/schedules/night", 201),
        ("/transportOrders/TO-1", 404),
        ("/schedules", 404),
        ("/plantVersions/1", 404),
    ):
        body = {"reason": "at the panel"}
        assert (await client.request("DELETE", path, json=body)).status_code == status
    assert [(method, path) for method, path, _ in far.asked] == [("DELETE", "/v1/schedules/night")]


@pytest.mark.parametrize(
    "path",
    [
        "/paths/A",
        "/vehicles/A/lock",
        "/transportOrders/A/lock",
        "/paths/A/route",
        "/schedules/A/runs",
        "/schedules",
    ],
)
async def test_only_what_the_panel_changes_accepts_put(
    client: httpx.AsyncClient, far: Far, path: str
) -> None:
    assert (await client.put(path, json={})).status_code == 404
    assert far.asked == []


async def test_problems_of_the_order_service_are_forwarded_unchanged(client: httpx.AsyncClient) -> None:
    answer = await client.post("/vehicles/taken/dispatch", json={"point": "A"})
    assert (answer.status_code, answer.headers["content-type"]) == (409, "application/problem+json")


@pytest.mark.parametrize(
    "path",
    [
        "/readyz",
        "/plantModel",
        "/transportOrders/a/b/c",
        "/traffic",
        "/traffic/plan/x",
        "/audit/x",
        "/vehicles/%2e%2e/x",
        "/vehicles/../readyz",
    ],
)
async def test_nothing_else_of_the_order_service_is_reachable(
    client: httpx.AsyncClient, far: Far, path: str
) -> None:
    answer = await client.get(path)
    assert answer.status_code == 404
    assert far.asked == []


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
        {"host": "evil.example:8080"},
        {"host": ""},
        {"host": "["},
        {"origin": "http://["},
    ],
    ids=str,
)
async def test_requests_of_other_origins_are_refused(
    client: httpx.AsyncClient, far: Far, headers: dict[str, str]
) -> None:
    answer = await client.post("/transportOrders", json=ORDER, headers=headers)
    assert answer.status_code == 403
    assert far.asked == []


async def test_own_page_may_send_commands(client: httpx.AsyncClient) -> None:
    headers = {"origin": "http://127.0.0.1:8080", "sec-fetch-site": "same-origin"}
    assert (await client.post("/transportOrders", json=ORDER, headers=headers)).status_code == 201


async def test_content_types_of_html_forms_are_refused(client: httpx.AsyncClient, far: Far) -> None:
    answer = await client.post("/transportOrders", content=b"{}", headers={"content-type": "text/plain"})
    assert answer.status_code == 415
    assert far.asked == []


async def test_endless_body_is_refused(client: httpx.AsyncClient, far: Far) -> None:
    headers = {"content-type": "application/json"}
    answer = await client.post("/transportOrders", content=b" " * (BODY_LIMIT + 1), headers=headers)
    assert answer.status_code == 413
    assert far.asked == []


async def test_a_draft_of_a_plant_may_be_long(client: httpx.AsyncClient, far: Far) -> None:
    body = {"model": {"name": "x" * BODY_LIMIT}}
    assert (await client.put("/plantDrafts/new%20aisle", json=body)).status_code == 201
    assert (await client.put("/schedules/night", json=body)).status_code == 413
    assert far.asked == [("PUT", "/v1/plantDrafts/new%20aisle", body)]


async def test_without_an_order_service_commands_are_off() -> None:
    async with client_of(None) as client:
        assert (await client.get("http://127.0.0.1:8080/api/v1/control")).json() == {"enabled": False}
        answer = await client.post("/transportOrders", json=ORDER)
    assert (answer.status_code, "--order_service.url" in answer.json()["detail"]) == (404, True)


async def test_unavailable_order_service_is_reported() -> None:
    async with client_of(free_port()) as client:
        assert (await client.get("http://127.0.0.1:8080/api/v1/control")).json() == {"enabled": True}
        answer = await client.post("/transportOrders", json=ORDER)
    assert answer.status_code == 502
    assert "Check that it is running" in answer.json()["detail"]


DRILL = {"by": "Anna", "reason": "fire drill"}


@pytest.mark.parametrize("body", [DRILL, {**DRILL, "area": {"xMin": 0, "yMin": 0, "xMax": 1, "yMax": 1}}])
async def test_stop_is_forwarded_while_the_order_service_answers(
    client: httpx.AsyncClient, far: Far, body: dict[str, Any]
) -> None:
    answer = await client.post("/stops", json=body)
    assert (answer.status_code, answer.json()) == (201, {"name": "TO-1"})
    assert far.asked == [("POST", "/v1/stops", body)]
    await client.post("/stops/stop-1/end", json=DRILL)
    assert far.asked[1:] == [("POST", "/v1/stops/stop-1/end", DRILL)]


async def test_nobody_is_told_to_stop_without_order_service_and_broker() -> None:
    async with client_of(free_port()) as client:
        answer = await client.post("/stops", json=DRILL)
        area = {**DRILL, "area": {"xMin": 0, "yMin": 0, "xMax": 1, "yMax": 1}}
        assert (await client.post("/stops", json=area)).status_code == 502
    assert answer.status_code == 503
    assert "Walk to the robots" in answer.json()["detail"]
