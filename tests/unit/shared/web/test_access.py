from __future__ import annotations

from pathlib import Path

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from nena_shared.clock import ManualClock
from nena_shared.web.access import COOKIE, WRONG_TOKENS_AT_ONCE, AccessControl, reading_or
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import Role, User, UserBook, hash_of, write_users

RULE = reading_or(Role.OPERATOR, everybody=frozenset({"/healthz"}))
REQUESTS = 30


async def who(request: Request) -> Response:
    user = request.state.user
    return JSONResponse(user.name if user else None)


class Door:
    """An application behind access control, as clients meet it."""

    def __init__(self, folder: Path, *, login: bool = True, cookies: bool = False) -> None:
        self.file = folder / "users.toml"
        self.clock = ManualClock()
        write_users(
            self.file,
            [User(name=role.name.lower(), role=role, token_sha256=hash_of(role.name)) for role in Role],
        )
        settings = HttpSettings(port=0, requests_per_second=1, burst=REQUESTS)
        book = UserBook(self.file) if login else None
        app = Starlette(routes=[Route("/{path:path}", who, methods=["GET", "POST", "DELETE"])])
        self.client = httpx.AsyncClient(
            transport=httpx.ASGITransport(AccessControl(app, settings, RULE, book, self.clock, cookies)),
            base_url="http://door",
        )

    async def ask(
        self, method: str, path: str = "/orders", token: str = "", **headers: str
    ) -> httpx.Response:
        if token:
            headers["authorization"] = f"Bearer {token}"
        return await self.client.request(method, path, headers=headers)


@pytest.fixture
def door(tmp_path: Path) -> Door:
    return Door(tmp_path)


@pytest.mark.parametrize(
    ("role", "method", "status"),
    [
        ("VIEWER", "GET", 200),
        ("VIEWER", "POST", 403),
        ("VIEWER", "DELETE", 403),
        ("OPERATOR", "GET", 200),
        ("OPERATOR", "POST", 200),
        ("ADMIN", "POST", 200),
    ],
)
async def test_each_role_may_do_what_it_may(door: Door, role: str, method: str, status: int) -> None:
    answer = await door.ask(method, token=role)

    assert answer.status_code == status
    if status == 200:
        assert answer.json() == role.lower()
    else:
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["detail"] == f"{role.lower()} is {role.lower()}; this takes the role operator."


@pytest.mark.parametrize(
    "header", ["", "Bearer wrong", "Bearer ", "Basic VIEWER", "VIEWER", "Bearer VIEWER x"]
)
async def test_without_a_token_of_somebody_it_is_401(door: Door, header: str) -> None:
    answer = await door.ask("GET", **({"authorization": header} if header else {}))

    assert answer.status_code == 401
    assert answer.headers["www-authenticate"].startswith("Bearer")
    assert "Authorization: Bearer" in answer.json()["detail"]


async def test_what_is_for_everybody_takes_no_token(door: Door) -> None:
    assert (await door.ask("GET", "/healthz")).status_code == 200
    assert (await door.ask("GET", "/healthz/more")).status_code == 401


async def test_cookies_count_only_where_other_pages_are_kept_out(door: Door) -> None:
    assert (await door.ask("GET", cookie=f"{COOKIE}=VIEWER")).status_code == 401


async def test_a_browser_shows_its_token_as_a_cookie(tmp_path: Path) -> None:
    door = Door(tmp_path, cookies=True)
    assert (await door.ask("GET", cookie=f"a=b; {COOKIE}=VIEWER")).json() == "viewer"
    assert (await door.ask("POST", cookie=f"{COOKIE}=VIEWER")).status_code == 403
    assert (await door.ask("GET", cookie=f"{COOKIE}=wrong")).status_code == 401
    assert (await door.ask("GET", cookie="{}=;;\x7f")).status_code == 401


async def test_without_a_file_of_users_everybody_may(tmp_path: Path) -> None:
    door = Door(tmp_path, login=False)

    assert (await door.ask("POST")).json() is None
    assert (await door.ask("POST", token="anything")).json() is None


async def test_who_asks_too_often_waits(door: Door) -> None:
    for _ in range(REQUESTS):
        assert (await door.ask("GET", token="VIEWER")).status_code == 200
    answer = await door.ask("GET", token="VIEWER")
    assert (answer.status_code, answer.headers["retry-after"]) == (429, "1")
    assert (await door.ask("GET", token="ADMIN")).status_code == 200, "each has a limit of its own"
    door.clock.advance(1.0)

    assert (await door.ask("GET", token="VIEWER")).status_code == 200


async def test_tokens_are_not_found_by_trying(door: Door) -> None:
    for number in range(WRONG_TOKENS_AT_ONCE):
        assert (await door.ask("GET", token=f"guess {number}")).status_code == 401
    assert (await door.ask("GET", token="guess")).status_code == 429
    assert (await door.ask("GET", token="VIEWER")).status_code == 200, "others come from there, too"
    door.clock.advance(5.0)

    assert (await door.ask("GET", token="guess")).status_code == 401


async def test_a_broken_file_of_users_closes_the_door(door: Door) -> None:
    door.file.write_text("[[user")

    answer = await door.ask("GET", token="ADMIN")
    assert answer.status_code == 503
    assert str(door.file) not in answer.text
    assert (await door.ask("GET", "/healthz")).status_code == 200
