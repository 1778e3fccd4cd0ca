from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest
from starlette.responses import PlainTextResponse

from nena_order_service.api.server import RestServer
from nena_shared.tasks import Supervisor
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import Role, User, hash_of, write_users
from support.waiting import PATIENCE

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
async def client() -> AsyncIterator[httpx.AsyncClient]:
    async with asking(HttpSettings(port=0)) as made:
        yield made


@pytest.mark.parametrize("origin", [FOREIGN, "null"])
@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
async def test_a_command_of_a_page_is_refused(client: httpx.AsyncClient, method: str, origin: str) -> None:
    answer = await client.request(method, WITHDRAWAL, headers={"origin": origin})
    assert answer.status_code == 403
    assert "http.users" in answer.json()["detail"]


async def test_a_name_that_was_made_to_point_here_helps_no_page(client: httpx.AsyncClient) -> None:
    headers = {"host": "page.example", "origin": FOREIGN, "content-type": "application/json"}
    assert (await client.post(WITHDRAWAL, headers=headers, content="{}")).status_code == 403


async def test_programs_command_and_anybody_reads(client: httpx.AsyncClient) -> None:
    assert (await client.post(WITHDRAWAL)).text == "done"
    assert (await client.get("/v1/vehicles", headers={"origin": FOREIGN})).text == "done"


async def test_with_a_login_the_token_decides(tmp_path: Path) -> None:
    file = tmp_path / "users.toml"
    write_users(file, [User(name="olga", role=Role.OPERATOR, token_sha256=hash_of("olga's"))])
    async with asking(HttpSettings(port=0, users=file)) as client:
        headers = {"origin": FOREIGN}
        assert (await client.post(WITHDRAWAL, headers=headers)).status_code == 401
        headers["authorization"] = "Bearer olga's"
        assert (await client.post(WITHDRAWAL, headers=headers)).text == "done"
