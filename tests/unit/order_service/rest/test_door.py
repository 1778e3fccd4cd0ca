from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from nena_order_service.api.server import RestServer
from nena_shared.tasks import Supervisor
from nena_shared.web.access import WRONG_TOKENS_AT_ONCE
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import Role, User, hash_of, write_users
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


async def test_what_is_shown_answers_behind_the_same_guard(
    door: RestServer, client: httpx.AsyncClient
) -> None:
    assert (await client.get(PATH)).status_code == 401
    assert (await client.get(PATH, headers=VIC)).text == "first"
    door.show(saying("second"))

    assert (await client.get(PATH)).status_code == 401
    assert (await client.get(PATH, headers=VIC)).text == "second"
    assert (await client.get(PATH, headers={"x-api-access-key": "vic's"})).text == "second"


async def test_what_was_counted_is_not_forgotten(door: RestServer, client: httpx.AsyncClient) -> None:
    wrong = {"authorization": "Bearer guess"}
    statuses = {(await client.get(PATH, headers=wrong)).status_code for _ in range(WRONG_TOKENS_AT_ONCE)}
    assert statuses == {401}
    door.show(saying("second"))

    assert (await client.get(PATH, headers=wrong)).status_code == 429


async def test_a_broken_file_of_users_fails_requests_and_not_the_program(
    door: RestServer, client: httpx.AsyncClient, users: Path
) -> None:
    await asyncio.to_thread(users.write_text, "[[user")
    door.show(saying("second"))

    assert (await client.get(PATH, headers=VIC)).status_code == 503
    assert (await client.get("/healthz")).text == "second"


async def test_a_door_that_was_never_open_gives_the_port_back() -> None:
    first = RestServer(saying("first"), HttpSettings(port=0))
    settings = HttpSettings(port=int(first.url.rpartition(":")[2]))
    await first.close()

    await RestServer(saying("second"), settings).close()
