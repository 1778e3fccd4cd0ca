"""Several orders in one request."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx

NAME = {"destinations": [{"locationName": "South 2"}]}


async def sent(
    client: httpx.AsyncClient, *orders: dict[str, Any], check: bool = False
) -> list[dict[str, Any]]:
    answer = await client.post(
        "/v1/transportOrders/batch", json={"transportOrders": orders, "checkOnly": check}
    )
    assert answer.status_code == 200, answer.text
    results: list[dict[str, Any]] = answer.json()["results"]
    return results


async def count(client: httpx.AsyncClient) -> int:
    return len((await client.get("/v1/transportOrders")).json()["transportOrders"])


BATCH = (
    {"name": "first", **NAME},
    {"name": "second", "dependencies": ["first"], **NAME},
    {"name": "third", "destinations": [{"locationName": "Nowhere"}]},
    {"name": "first", "destinations": [{"locationName": "South 3"}]},
    {"idempotencyKey": "key-5", **NAME},
)


async def test_each_order_is_created_or_refused_on_its_own(client: httpx.AsyncClient) -> None:
    results = await sent(client, *BATCH)
    assert [each["status"] for each in results] == [201, 201, 404, 409, 201]
    assert [each["name"] for each in results][:4] == ["first", "second", "third", "first"]
    assert results[1]["transportOrder"]["dependencies"] == ["first"]
    assert "Nowhere" in results[2]["problem"]["errors"][0]
    assert await count(client) == 3


async def test_a_repeated_batch_creates_nothing_twice(client: httpx.AsyncClient) -> None:
    first = await sent(client, *BATCH)
    again = await sent(client, *BATCH)
    assert [each["status"] for each in again] == [200, 200, 404, 409, 200]
    assert again[4]["name"] == first[4]["name"]
    assert await count(client) == 3


async def test_the_trace_of_the_host_counts_for_orders_without_their_own(client: httpx.AsyncClient) -> None:
    host, own = (f"00-0af7651916cd43dd8448eb211c80319c-{span:016x}-01" for span in (1, 2))
    batch = {"transportOrders": [{"name": "first", **NAME}, {"name": "second", "traceparent": own, **NAME}]}
    answer = await client.post("/v1/transportOrders/batch", json=batch, headers={"traceparent": host})
    assert [each["transportOrder"]["traceparent"] for each in answer.json()["results"]] == [host, own]


async def test_a_check_creates_nothing_and_says_the_same(client: httpx.AsyncClient) -> None:
    results = await sent(client, *BATCH, check=True)
    assert [each["status"] for each in results] == [200, 200, 404, 409, 200]
    assert all(each["transportOrder"] is None for each in results)
    assert await count(client) == 0


async def test_a_thousand_orders_are_one_request(client: httpx.AsyncClient) -> None:
    results = await sent(client, *[{"name": f"T-{number}", **NAME} for number in range(1000)])
    assert {each["status"] for each in results} == {201}
    assert (
        await client.post("/v1/transportOrders/batch", json={"transportOrders": [NAME] * 1001})
    ).status_code == 422


async def test_a_check_knows_the_earlier_orders_of_its_batch(client: httpx.AsyncClient) -> None:
    batch = (
        {"name": "A", "idempotencyKey": "a", **NAME},
        {"name": "A", "idempotencyKey": "a", **NAME},
        {"name": "B", "idempotencyKey": "a", **NAME},
        {"name": "C", "incompleteName": True, **NAME},
        {"name": "C", "incompleteName": True, **NAME},
        {"name": "D", "dependencies": ["C"], **NAME},
    )
    checked = [each["status"] for each in await sent(client, *batch, check=True)]
    created = [each["status"] for each in await sent(client, *batch)]
    assert checked == [200, 200, 422, 200, 200, 404]
    assert created == [201, 200, 422, 201, 201, 404]


async def test_equal_requests_at_the_same_time_create_one_order(client: httpx.AsyncClient) -> None:
    await client.post("/v1/transportOrders", json={"name": "first", **NAME})
    body = {"idempotencyKey": "k", "dependencies": ["first"], **NAME}
    answers = await asyncio.gather(*(client.post("/v1/transportOrders", json=body) for _ in range(3)))
    assert sorted(each.status_code for each in answers) == [200, 200, 201]
    assert len({each.json()["name"] for each in answers}) == 1
