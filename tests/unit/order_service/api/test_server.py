from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from nena_order_service.api.server import RestServer, make_standby_app, make_starting_app
from nena_shared.fleet_api.base import Role
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.tasks import Supervisor
from nena_shared.web.access import WRONG_TOKENS_AT_ONCE
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import User, hash_of, write_users
from support.waiting import PATIENCE

PATH = "/v1/vehicles"
VIC = {"authorization": "Bearer vic's"}


def saying(text: str) -> Starlette:
    async def say(_: Request) -> Response:
        return PlainTextResponse(text)

    return Starlette(routes=[Route("/{path:path}", say)])


@pytest.fixture
def users(tmp_path: Path) -> Path:
    file = tmp_path / "users.toml"
    write_users(file, [User(name="vic", role=Role.VIEWER, token_sha256=hash_of("vic's"))])
    return file


@pytest.fixture
async def door(users: Path) -> AsyncIterator[RestServer]:
    made = RestServer(saying("first"), HttpSettings(port=0, users=users))
    async with Supervisor() as supervisor:
        made.open(supervisor)
        made.open(supervisor)
        yield made
        await made.close()


@pytest.fixture
async def client(door: RestServer) -> AsyncIterator[httpx.AsyncClient]:
    async with httpx.AsyncClient(base_url=door.url, timeout=PATIENCE) as made:
        yield made


async def test_shown_applications_are_served_behind_the_same_guard(
    door: RestServer, client: httpx.AsyncClient
) -> None:
    assert (await client.get(PATH)).status_code == 401
    assert (await client.get(PATH, headers=VIC)).text == "first"
    door.show(saying("second"))

    assert (await client.get(PATH)).status_code == 401
    assert (await client.get(PATH, headers=VIC)).text == "second"
    assert (await client.get(PATH, headers={"x-api-access-key": "vic's"})).text == "second"


async def test_rate_limits_survive_showing_another_application(
    door: RestServer, client: httpx.AsyncClient
) -> None:
    wrong = {"authorization": "Bearer guess"}
    statuses = {(await client.get(PATH, headers=wrong)).status_code for _ in range(WRONG_TOKENS_AT_ONCE)}
    assert statuses == {401}
    door.show(saying("second"))

    assert (await client.get(PATH, headers=wrong)).status_code == 429


async def test_a_broken_users_file_fails_requests_but_not_the_program(
    door: RestServer, client: httpx.AsyncClient, users: Path
) -> None:
    await asyncio.to_thread(users.write_text, "[[user")
    door.show(saying("second"))

    assert (await client.get(PATH, headers=VIC)).status_code == 503
    assert (await client.get("/healthz")).text == "second"


async def test_a_server_that_never_opened_releases_its_port() -> None:
    first = RestServer(saying("first"), HttpSettings(port=0))
    settings = HttpSettings(port=int(first.url.rpartition(":")[2]))
    await first.close()

    await RestServer(saying("second"), settings).close()


WITHDRAWAL = "/opentcs/v1/transportOrders/O1/withdrawal"
FOREIGN = "http://page.example"


@asynccontextmanager
async def asking(settings: HttpSettings) -> AsyncIterator[httpx.AsyncClient]:
    door = RestServer(PlainTextResponse("done"), settings)
    async with Supervisor() as supervisor, httpx.AsyncClient(base_url=door.url, timeout=PATIENCE) as made:
        door.open(supervisor)
        yield made
        await door.close()


@pytest.fixture
async def client_of_pages() -> AsyncIterator[httpx.AsyncClient]:
    async with asking(HttpSettings(port=0)) as made:
        yield made


@pytest.mark.parametrize("origin", [FOREIGN, "null"])
@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
async def test_a_command_of_a_page_is_refused(
    client_of_pages: httpx.AsyncClient, method: str, origin: str
) -> None:
    answer = await client_of_pages.request(method, WITHDRAWAL, headers={"origin": origin})
    assert answer.status_code == 403
    assert "http.users" in answer.json()["detail"]


async def test_dns_rebinding_does_not_help_a_page(client_of_pages: httpx.AsyncClient) -> None:
    headers = {"host": "page.example", "origin": FOREIGN, "content-type": "application/json"}
    assert (await client_of_pages.post(WITHDRAWAL, headers=headers, content="{}")).status_code == 403


async def test_programs_may_command_and_anyone_may_read(client_of_pages: httpx.AsyncClient) -> None:
    assert (await client_of_pages.post(WITHDRAWAL)).text == "done"
    assert (await client_of_pages.get("/v1/vehicles", headers={"origin": FOREIGN})).text == "done"


async def test_with_a_login_the_token_decides(tmp_path: Path) -> None:
    file = tmp_path / "users.toml"
    write_users(file, [User(name="olga", role=Role.OPERATOR, token_sha256=hash_of("olga's"))])
    async with asking(HttpSettings(port=0, users=file)) as client:
        headers = {"origin": FOREIGN}
        assert (await client.post(WITHDRAWAL, headers=headers)).status_code == 401
        headers["authorization"] = "Bearer olga's"
        assert (await client.post(WITHDRAWAL, headers=headers)).text == "done"


def client_of_standby(active_url: str, problem: str = "") -> httpx.AsyncClient:
    app = make_standby_app(lambda: active_url, lambda: problem)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://standby")


@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "DELETE"])
async def test_every_request_is_redirected(method: str) -> None:
    async with client_of_standby("http://active.example") as standby:
        answer = await standby.request(method, "/v1/vehicles/Robot-01")
    problem = Problem.model_validate_json(answer.content)
    assert (answer.status_code, problem.status) == (503, 503)
    assert "http://active.example/v1/vehicles/Robot-01" in problem.detail
    assert answer.headers["link"] == '<http://active.example/v1/vehicles/Robot-01>; rel="alternate"'
    assert answer.headers["retry-after"] == "1"


@pytest.mark.parametrize("name", ["Auftrag%20Ж", "%3E;%20rel=%22self%22"])
async def test_a_name_is_passed_on_unchanged(name: str) -> None:
    async with client_of_standby("http://active.example") as standby:
        answer = await standby.get(f"/v1/transportOrders/{name}")
    place = f"http://active.example{answer.request.url.raw_path.decode()}"
    assert (answer.status_code, answer.headers["link"]) == (503, f'<{place}>; rel="alternate"')
    assert place in answer.json()["detail"]


async def test_a_standby_without_a_known_active_service_reports_it() -> None:
    async with client_of_standby("", problem="connection refused") as standby:
        answer = await standby.get("/v1/vehicles")
        ready = await standby.get("/readyz")
        assert (await standby.get("/healthz")).status_code == 200
    assert "not known yet" in answer.json()["detail"]
    assert "link" not in answer.headers
    assert (ready.status_code, ready.json()["role"], ready.json()["storeReady"]) == (503, "standby", False)
    assert "connection refused" in " ".join(ready.json()["problems"])


def client_of_starting(problem: str) -> httpx.AsyncClient:
    transport = httpx.ASGITransport(make_starting_app(lambda: problem))
    return httpx.AsyncClient(transport=transport, base_url="http://starting")


async def test_it_does_not_blame_a_database_that_answers() -> None:
    async with client_of_starting("") as starting:
        ready = await starting.get("/readyz")
    assert (ready.status_code, ready.json()["storeReady"]) == (503, True)
    assert "asks the MQTT broker" in ready.json()["problems"][0]


async def test_a_starting_service_is_healthy_and_reports_what_it_waits_for() -> None:
    async with client_of_starting("database or disk is full") as starting:
        assert (await starting.get("/healthz")).status_code == 200
        ready = await starting.get("/readyz")

    assert ready.status_code == 503
    assert (ready.json()["role"], ready.json()["ready"], ready.json()["storeReady"]) == (
        "starting",
        False,
        False,
    )
    assert "database or disk is full" in ready.json()["problems"][0]


@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "DELETE"])
async def test_everything_else_is_for_later(method: str) -> None:
    async with client_of_starting("database or disk is full") as starting:
        answer = await starting.request(method, "/v1/transportOrders")

    told = Problem.model_validate_json(answer.content)
    assert (answer.status_code, told.status, answer.headers["retry-after"]) == (503, 503, "1")
    assert "database or disk is full" in told.detail
    assert "store.url" in told.detail
