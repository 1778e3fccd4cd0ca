"""The attention list over REST and in the metrics, and who may acknowledge."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from urllib.parse import quote

import httpx
import pytest
from typer.testing import CliRunner, Result

from nena_cli.__main__ import app
from nena_shared.fleet_api.base import Role
from nena_shared.settings import settings_with
from nena_shared.web.users import User, hash_of, write_users
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.extension import installed
from nena_status_aggregator.settings import AggregatorHttpSettings, AggregatorSettings, JamSettings
from support.clocks import ManualClock
from support.matters import CONDITIONS, Condition, ModelSite, emergency

LINE = re.compile(r'nena_attention\{acknowledged="(\w+)",kind="(\w+)"\} ([1-9]\d*)')


@pytest.fixture
def aggregator(clock: ManualClock) -> Aggregator:
    model = settings_with(AggregatorSettings, installed())
    return Aggregator(model(jam=JamSettings(robots=2, seconds=1)), clock, installed())


@pytest.fixture
def site(aggregator: Aggregator, clock: ManualClock) -> ModelSite:
    return ModelSite(aggregator.model, clock)


@pytest.fixture
def hit(site: ModelSite) -> ModelSite:
    """Return a site with an emergency stop."""
    site.robot("Hit", **emergency("MANUAL"))
    site.wait(1)
    return site


async def listed(client: httpx.AsyncClient) -> list[dict[str, object]]:
    found: list[dict[str, object]] = (await client.get("/api/v1/attention")).json()["attention"]
    return found


@pytest.fixture
def nena_status(monkeypatch: pytest.MonkeyPatch) -> Callable[[httpx.Response], Result]:
    """Return a function that runs ``nena status`` with this answer of the aggregator."""
    make = httpx.Client

    def run(listed: httpx.Response) -> Result:
        answers = {
            "/api/v1/attention": listed.content,
            "/readyz": b'{"ready": true, "role": "active", "brokerConnected": true, "storeReady": true}',
            "/v1/summary": b'{"transportOrders": {}, "vehicles": {}, "oldestOrder": null}',
        }
        answer = httpx.MockTransport(lambda asked: httpx.Response(200, content=answers[asked.url.path]))
        monkeypatch.setattr(httpx, "Client", lambda **more: make(**{**more, "transport": answer}))
        return CliRunner().invoke(app, ["status", "--json"])

    return run


@pytest.mark.parametrize("condition", CONDITIONS, ids=lambda each: each.name)
async def test_rest_fleet_metrics_and_nena_status_agree(
    client: httpx.AsyncClient,
    site: ModelSite,
    condition: Condition,
    nena_status: Callable[[httpx.Response], Result],
) -> None:
    condition.arrange(site)
    site.wait(5)
    matters = await listed(client)
    lasting = {each["id"] for each in matters}
    assert lasting == set(condition.matters)
    assert (await client.get("/api/v1/fleet")).json()["attention"] == matters
    counted = LINE.findall((await client.get("/metrics")).text)
    kinds = Counter(str(each["kind"]) for each in matters)
    assert {(kind, done): int(number) for done, kind, number in counted} == {
        (kind, "no"): number for kind, number in kinds.items()
    }
    shown = nena_status(await client.get("/api/v1/attention"))
    assert (json.loads(shown.stdout)["attention"], shown.exit_code) == (matters, int(bool(matters)))
    for matter in matters:
        await client.post(
            f"/api/v1/attention/{quote(str(matter['id']))}/acknowledgement",
            json={"by": "Anna"},
            headers={"host": "localhost"},
        )
    assert nena_status(await client.get("/api/v1/attention")).exit_code == 0


@pytest.mark.usefixtures("hit")
async def test_person_acknowledges_with_a_name(client: httpx.AsyncClient) -> None:
    address = f"/api/v1/attention/{quote('emergency_stop:Hit', safe='')}/acknowledgement"
    headers = {"host": "localhost"}
    nameless = await client.post(address, json={}, headers=headers)
    assert (nameless.status_code, nameless.json()["type"]) == (422, Rejection.NAMELESS.uri)
    done = await client.post(address, json={"by": "Anna"}, headers=headers)
    assert done.json()["acknowledged"] == {"by": "Anna", "at": "2026-01-01T00:00:01.000Z"}
    assert [each["acknowledged"] for each in await listed(client)] == [done.json()["acknowledged"]]
    assert LINE.findall((await client.get("/metrics")).text) == [("yes", "emergency_stop", "1")]
    unknown = await client.post("/api/v1/attention/jam:X/acknowledgement", json={"by": "A"}, headers=headers)
    assert (unknown.status_code, unknown.json()["type"]) == (404, Rejection.UNKNOWN_MATTER.uri)


@pytest.mark.usefixtures("hit")
async def test_page_of_another_origin_cannot_acknowledge(client: httpx.AsyncClient) -> None:
    address = "/api/v1/attention/emergency_stop:Hit/acknowledgement"
    headers = {"host": "localhost", "origin": "http://evil.example"}
    assert (await client.post(address, json={"by": "Anna"}, headers=headers)).status_code == 403


@pytest.fixture
async def signed(aggregator: Aggregator, tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    """Return a client of an aggregator with users."""
    roles = {"ann": Role.OPERATOR, "vic": Role.VIEWER}
    users = [User(name=name, role=role, token_sha256=hash_of(f"{name}'s")) for name, role in roles.items()]
    write_users(tmp_path / "users.toml", users)
    app = make_app(aggregator, AggregatorHttpSettings(users=tmp_path / "users.toml"))
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as made:
        yield made


@pytest.mark.usefixtures("hit")
async def test_name_of_a_signed_in_user_is_that_of_the_token(signed: httpx.AsyncClient) -> None:
    address = "/api/v1/attention/emergency_stop:Hit/acknowledgement"
    refused = await signed.post(address, json={}, headers={"authorization": "Bearer vic's"})
    assert refused.status_code == 403
    done = await signed.post(address, json={"by": "Somebody"}, headers={"authorization": "Bearer ann's"})
    assert done.json()["acknowledged"]["by"] == "ann"
