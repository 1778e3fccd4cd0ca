from __future__ import annotations

from collections.abc import AsyncIterator

import httpx
import pytest

from nena_shared.clock import ManualClock
from nena_shared.plant.model import PlantModel
from nena_shared.vda5050 import v2_0, v2_1, v3_0
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import Factsheet
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.rest.app import make_app
from nena_status_aggregator.settings import AggregatorHttpSettings, AggregatorSettings, EventSettings
from support.fleet_briefs import state
from support.fleet_examples import ROBOT, START, factsheet, order_status, sample_plant


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(start=START)


@pytest.fixture
def aggregator(clock: ManualClock) -> Aggregator:
    return Aggregator(AggregatorSettings(events=EventSettings(clients=1)), clock)


@pytest.fixture
async def client(aggregator: Aggregator) -> AsyncIterator[httpx.AsyncClient]:
    app = make_app(aggregator, AggregatorHttpSettings())
    transport = httpx.ASGITransport(app, raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://aggregator") as made:
        yield made


def populate(aggregator: Aggregator) -> None:
    aggregator.model.on_link(connected=True, at=aggregator.now())
    aggregator.model.on_state(ROBOT, state(), aggregator.now())
    aggregator.model.on_order_status(order_status(), aggregator.now())
    aggregator.publish_changes()


async def test_an_empty_fleet(client: httpx.AsyncClient) -> None:
    fleet = (await client.get("/api/v1/fleet")).json()
    assert fleet["robots"] == fleet["orders"] == []
    assert fleet["plant"] is None
    assert fleet["link"] == {"connected": False, "since": None}


async def test_the_fleet_with_the_age_of_states(
    client: httpx.AsyncClient, aggregator: Aggregator, clock: ManualClock
) -> None:
    populate(aggregator)
    clock.advance(7.5)
    fleet = (await client.get("/api/v1/fleet")).json()
    assert fleet["time"] == "2026-01-01T00:00:07.500Z"
    assert [(each["id"], each["stateAge"]) for each in fleet["robots"]] == [("ACME/r1", 7.5)]
    assert [each["id"] for each in fleet["orders"]] == ["TO-1"]
    assert fleet["link"]["connected"] is True


async def test_one_robot(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    populate(aggregator)
    robot = (await client.get("/api/v1/robots/ACME/r1")).json()
    assert (robot["serialNumber"], robot["condition"], robot["stateAge"]) == ("r1", "IDLE", 0)


@pytest.mark.parametrize("codec", [v2_0.CODEC, v2_1.CODEC, v3_0.CODEC], ids=["2.0", "2.1", "3.0"])
async def test_the_actions_of_a_robot_in_the_same_names_for_each_version(
    client: httpx.AsyncClient, aggregator: Aggregator, codec: Codec
) -> None:
    populate(aggregator)
    missing = await client.get("/api/v1/robots/ACME/r1/actions")
    assert (missing.status_code, "asked for it" in missing.json()["detail"]) == (404, True)
    beep = {
        "actionType": "beep",
        "actionDescription": "makes itself heard",
        "actionScopes": ("INSTANT", "NODE"),
        "actionParameters": ({"key": "times", "valueDataType": "INTEGER"},),
        "pauseAllowed": False,
        "cancelAllowed": False,
    }
    features = {"optionalParameters": (), "mobileRobotActions": (beep,)}
    content = {**factsheet().model_dump(by_alias=True), "protocolFeatures": features}
    sheet = Factsheet.model_validate(content, strict=False)
    received = codec.decode(Factsheet, codec.encode(sheet))
    aggregator.model.on_factsheet(ROBOT, received, aggregator.now())
    assert (await client.get("/api/v1/robots/ACME/r1/actions")).json() == [
        {
            "actionType": "beep",
            "description": "makes itself heard",
            "actionScopes": ["INSTANT", "NODE"],
            "actionParameters": [
                {"key": "times", "valueDataType": "INTEGER", "description": None, "isOptional": False}
            ],
        }
    ]


async def test_orders(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    populate(aggregator)
    orders = (await client.get("/api/v1/orders")).json()
    assert [(each["id"], each["state"]) for each in orders] == [("TO-1", "BEING_PROCESSED")]
    assert orders[0]["destinations"][0] == {
        "place": "Goods in",
        "operation": "Load",
        "state": "TRAVELLING",
    }


async def test_the_plant_as_it_was_published(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    plant = sample_plant()
    aggregator.model.on_plant_model(plant)
    answer = await client.get("/api/v1/plant")
    assert PlantModel.from_json(answer.content) == plant


@pytest.mark.parametrize(
    ("path", "word"),
    [
        ("/api/v1/plant", "Start the order service"),
        ("/api/v1/robots/ACME/none", "/api/v1/fleet lists"),
        ("/api/v1/nothing", "openapi.json"),
        ("/nothing.js", "openapi.json"),
    ],
)
async def test_what_is_not_there_is_a_problem_that_says_what_to_do(
    client: httpx.AsyncClient, path: str, word: str
) -> None:
    answer = await client.get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["status"] == 404
    assert word in answer.json()["detail"]


async def test_a_wrong_method_and_a_wrong_value_are_problems(client: httpx.AsyncClient) -> None:
    refused = await client.post("/api/v1/fleet")
    assert (refused.status_code, refused.json()["status"]) == (405, 405)
    assert "GET" in refused.headers["allow"]
    invalid = await client.get("/api/v1/events", params={"after": "x" * 101})
    assert invalid.status_code == 422
    assert invalid.json()["errors"][0].startswith("query.after:")


async def test_a_failure_inside_is_a_problem_without_its_innards(
    client: httpx.AsyncClient, aggregator: Aggregator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(aggregator.model, "snapshot", lambda: 1 / 0)
    answer = await client.get("/api/v1/fleet")
    assert answer.status_code == 500
    assert "division" not in answer.text


async def test_too_many_followers_are_told_so(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    aggregator.events.clients = 1
    answer = await client.get("/api/v1/events")
    assert (answer.status_code, answer.json()["title"]) == (503, "Service Unavailable")


async def test_health_and_readiness(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    assert (await client.get("/healthz")).status_code == 200
    unready = await client.get("/readyz")
    assert unready.status_code == 503
    assert "broker" in unready.json()["detail"]
    aggregator.model.on_link(connected=True, at=aggregator.now())
    assert (await client.get("/readyz")).json() == {"status": "ready"}


async def test_metrics(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    populate(aggregator)
    answer = await client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    assert 'nena_robots{condition="IDLE"} 1.0' in answer.text
    assert "process_resident_memory_bytes" in answer.text


async def test_the_page_comes_with_a_strict_policy(client: httpx.AsyncClient) -> None:
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


async def test_files_outside_the_page_are_out_of_reach(client: httpx.AsyncClient) -> None:
    assert (await client.get("/..%2f__init__.py")).status_code == 404


async def test_the_interface_is_described(client: httpx.AsyncClient) -> None:
    described = (await client.get("/api/v1/openapi.json")).json()
    assert {
        "/api/v1/fleet",
        "/api/v1/robots/{manufacturer}/{serial}",
        "/api/v1/robots/{manufacturer}/{serial}/actions",
        "/api/v1/robots/{manufacturer}/{serial}/map",
        "/api/v1/orders",
        "/api/v1/plant",
        "/api/v1/session",
        "/api/v1/session/oidc",
        "/api/v1/control",
        "/api/v1/control/{path}",
        "/api/v1/events",
        "/healthz",
        "/api/v1/history",
        "/api/v1/history.csv",
        "/api/v1/history.jsonl",
        "/readyz",
        "/metrics",
    } == set(described["paths"])
    assert "stateAge" in described["components"]["schemas"]["RobotResource"]["properties"]
