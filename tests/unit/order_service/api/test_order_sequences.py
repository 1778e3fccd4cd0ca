"""Order sequences, and the orders in them, over REST."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

SEQUENCES = "/v1/orderSequences"
ORDERS = "/v1/transportOrders"


def order(name: str, **fields: Any) -> dict[str, Any]:
    return {"name": name, "destinations": [{"locationName": "South 2"}], **fields}


async def make(client: httpx.AsyncClient, **body: Any) -> httpx.Response:
    return await client.post(SEQUENCES, json=body)


async def test_a_sequence_is_created_filled_shown_and_completed(client: httpx.AsyncClient) -> None:
    made = await make(client, name="S", orderTypes=["Transport"], properties=[{"key": "a", "value": "b"}])
    assert (made.status_code, made.headers["location"], made.headers["etag"]) == (
        201,
        f"{SEQUENCES}/S",
        '"1"',
    )
    assert (made.json()["orders"], made.json()["finishedIndex"]) == ([], -1)
    for name in ("T-1", "T-2"):
        body = order(name, type="Transport", wrappingSequence="S")
        assert (await client.post(ORDERS, json=body)).status_code == 201
    shown = await client.get(f"{SEQUENCES}/S")
    assert shown.json()["orders"] == ["T-1", "T-2"]
    known = {"If-None-Match": shown.headers["etag"]}
    assert (await client.get(f"{SEQUENCES}/S", headers=known)).status_code == 304
    assert (await client.get(f"{ORDERS}/T-2")).json()["state"] == "ACTIVE"

    stale = await client.post(f"{SEQUENCES}/S/completion", headers={"If-Match": '"1"'})
    assert stale.status_code == 412
    done = await client.post(f"{SEQUENCES}/S/completion", headers={"If-Match": shown.headers["etag"]})
    assert (done.status_code, done.json()["complete"], done.json()["finished"]) == (200, True, False)
    assert (await client.post(f"{SEQUENCES}/S/completion")).json() == done.json()
    late = await client.post(ORDERS, json=order("T-3", type="Transport", wrappingSequence="S"))
    assert (late.status_code, "it is complete" in late.json()["detail"]) == (409, True)
    for name in ("T-1", "T-2"):
        assert (await client.post(f"{ORDERS}/{name}/withdrawal")).status_code == 200
    ended = (await client.get(f"{SEQUENCES}/S")).json()
    assert (ended["finished"], ended["finishedIndex"]) == (True, 1)
    assert (await client.post(f"{SEQUENCES}/S/completion")).json() == ended


async def test_the_same_request_creates_one_sequence(client: httpx.AsyncClient) -> None:
    first = await make(client, idempotencyKey="k", failureFatal=True)
    again = await make(client, idempotencyKey="k", failureFatal=True)
    assert (first.status_code, again.status_code, first.json()["name"]) == (201, 200, again.json()["name"])
    assert (await make(client, idempotencyKey="k")).status_code == 422
    assert first.json()["name"].startswith("OSequence-")
    await make(client, name="S")
    assert (await make(client, name="S")).status_code == 200
    assert (await make(client, name="S", failureFatal=True)).status_code == 409
    completed = await client.post(SEQUENCES, json={"name": "S", "incompleteName": True})
    assert completed.json()["name"].startswith("S-")
    keyed = await client.post(SEQUENCES, json={}, headers={"Idempotency-Key": "h"})
    assert (await make(client, idempotencyKey="h")).json()["name"] == keyed.json()["name"]


async def test_sequences_are_listed_newest_first_by_page(client: httpx.AsyncClient) -> None:
    for name in "ABC":
        await make(client, name=name, **({"intendedVehicle": "Robot-01"} if name == "B" else {}))
    await client.post(f"{SEQUENCES}/A/completion")

    async def names(**query: Any) -> list[str]:
        page = (await client.get(SEQUENCES, params=query)).json()
        return [each["name"] for each in page["orderSequences"]]

    assert await names() == ["C", "B", "A"]
    assert await names(finished="true") == ["A"]
    assert await names(finished="false") == ["C", "B"]
    assert await names(intendedVehicle="Robot-01") == ["B"]
    page = (await client.get(SEQUENCES, params={"limit": 2})).json()
    assert await names(limit=2, after=page["next"]) == ["A"]


@pytest.mark.parametrize(
    ("body", "status", "said"),
    [
        ({"intendedVehicle": "R2D2"}, 404, "R2D2"),
        ({"name": "a b"}, 422, "name"),
        ({"orderTypes": []}, 422, "orderTypes"),
        ({"type": "Transport"}, 422, "type"),
    ],
)
async def test_bad_sequences_are_refused(
    client: httpx.AsyncClient, body: dict[str, Any], status: int, said: str
) -> None:
    answer = await make(client, **body)
    assert (answer.status_code, said in answer.text) == (status, True)


async def test_unknown_resources_are_reported(client: httpx.AsyncClient) -> None:
    assert (await client.get(f"{SEQUENCES}/S")).status_code == 404
    assert (await client.post(f"{SEQUENCES}/S/completion")).status_code == 404
    lost = await client.post(ORDERS, json=order("T-1", wrappingSequence="S"))
    assert (lost.status_code, "'S'" in lost.json()["detail"]) == (404, True)
    lost = await client.post(ORDERS, json=order("T-1", dependencies=["T-0", "T-1"]))
    assert (lost.status_code, "'T-0' or 'T-1'" in lost.json()["detail"]) == (404, True)
    assert (await client.get(f"{ORDERS}/T-1")).status_code == 404


async def test_an_order_waits_for_its_dependencies_and_is_idempotent(
    client: httpx.AsyncClient,
) -> None:
    await client.post(ORDERS, json=order("T-1"))
    body = order("T-2", dependencies=["T-1"], onDependencyFailure="IGNORE")
    made = await client.post(ORDERS, json=body)
    assert (made.status_code, made.json()["state"]) == (201, "ACTIVE")
    assert made.json()["reason"] == "waits until 'T-1' is finished"
    assert (await client.post(ORDERS, json=body)).status_code == 200
    assert (await client.post(ORDERS, json={**body, "onDependencyFailure": "FAIL"})).status_code == 409
    await client.post(f"{ORDERS}/T-1/withdrawal")
    assert (await client.get(f"{ORDERS}/T-2")).json()["state"] == "DISPATCHABLE"
    failed = await client.post(ORDERS, json=order("T-3", dependencies=["T-1"]))
    assert (failed.status_code, failed.json()["state"]) == (201, "FAILED")
    assert failed.json()["reason"] == "order 'T-1', on which it depends, is withdrawn"
