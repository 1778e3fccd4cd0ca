from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from itertools import count
from typing import Any

import httpx
import pytest
from sqlalchemy.exc import OperationalError
from starlette.types import Receive, Scope, Send

from nena_order_service.api.orders import ORDERS_AT_ONCE
from nena_order_service.service import OrderService
from nena_order_service.store import database
from nena_shared.fleet_api.base import Role
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.requests import BY_LIMIT, TransportOrderPage
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.web.access import KnownUser
from nena_shared.web.issued_tokens import OidcUser
from nena_shared.web.users import User, hash_of
from support.problems import problem

ORDERS = "/v1/transportOrders"
BODY: dict[str, Any] = {"destinations": [{"locationName": "Goods in", "operation": "Load cargo"}]}


async def test_created_order_is_answered_with_its_location_and_stored(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    answer = await client.post(ORDERS, json={**BODY, "name": "T-1"})
    assert answer.status_code == 201
    assert answer.headers["location"] == "/v1/transportOrders/T-1"
    order = TransportOrderStatus.model_validate_json(answer.content)
    assert order.state == "DISPATCHABLE"
    assert "no connection to the MQTT broker" in order.reason
    stored = await service.store.read_order(name="T-1")
    assert stored is not None
    assert stored.status == order
    assert (await client.get(answer.headers["location"])).json() == answer.json()


async def test_names_are_generated_and_completed(client: httpx.AsyncClient) -> None:
    made = (await client.post(ORDERS, json=BODY)).json()["name"]
    completed = [
        (await client.post(ORDERS, json={**BODY, "name": "Night", "incompleteName": True})).json()["name"]
        for _ in range(2)
    ]
    assert made.startswith("TOrder-")
    assert all(name.startswith("Night-") for name in completed)
    assert len({made, *completed}) == 3


async def test_used_name_is_refused(client: httpx.AsyncClient) -> None:
    await client.post(ORDERS, json={**BODY, "name": "T-1"})
    answer = await client.post(ORDERS, json={**BODY, "name": "T-1", "priority": 1})
    assert "'T-1'" in problem(answer, 409).detail


async def test_same_name_gives_the_same_order_only_for_the_same_request(client: httpx.AsyncClient) -> None:
    first = await client.post(ORDERS, json={**BODY, "name": "T-1"})
    again = await client.post(ORDERS, json={**BODY, "name": "T-1"})
    assert [first.status_code, again.status_code] == [201, 200]
    assert again.json()["name"] == "T-1"
    keyed = await client.post(ORDERS, json={**BODY, "name": "T-1", "idempotencyKey": "k"})
    assert "'T-1'" in problem(keyed, 409).detail


async def test_same_key_gives_the_same_order_also_by_header(client: httpx.AsyncClient) -> None:
    first = await client.post(ORDERS, json={**BODY, "idempotencyKey": "k"})
    again = await client.post(ORDERS, json={**BODY, "idempotencyKey": "k"})
    header = await client.post(ORDERS, json=BODY, headers={"Idempotency-Key": "k"})
    assert [first.status_code, again.status_code, header.status_code] == [201, 200, 200]
    assert first.json() == again.json() == header.json()
    assert len((await client.get(ORDERS)).json()["transportOrders"]) == 1


TRACE = "0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"


@pytest.mark.parametrize(
    ("header", "found"),
    [
        (f"00-{TRACE}", f"00-{TRACE}"),
        (f"cc-{TRACE}-later", f"00-{TRACE}"),
        (f"00-{TRACE}-later", None),
        (f"00-{'0' * 32}-b7ad6b7169203331-01", None),
        (f"00-0af7651916cd43dd8448eb211c80319c-{'0' * 16}-01", None),
        (f"ff-{TRACE}", None),
        (f"00-{TRACE.upper()}", None),
        ("00-1-2-3", None),
    ],
)
async def test_the_trace_of_the_host_is_kept_and_an_invalid_one_ignored(
    client: httpx.AsyncClient, header: str, found: str | None
) -> None:
    made = await client.post(ORDERS, json=BODY, headers={"traceparent": header})
    assert (made.status_code, made.json()["traceparent"]) == (201, found)


async def test_a_repeated_request_may_come_from_another_span(client: httpx.AsyncClient) -> None:
    keyed = {**BODY, "idempotencyKey": "k"}
    await client.post(ORDERS, json=keyed, headers={"traceparent": f"00-{TRACE}"})
    again = await client.post(ORDERS, json={**keyed, "traceparent": f"00-{TRACE[:-2]}00"})
    assert (again.status_code, again.json()["traceparent"]) == (200, f"00-{TRACE}")
    malformed = await client.post(ORDERS, json={**BODY, "traceparent": "00-1-2-3"})
    assert "traceparent" in problem(malformed, 422).errors[0]


@pytest.mark.parametrize(
    "change",
    [
        {"priority": 3},
        {"type": "Transport"},
        {"deadline": "2030-01-01T00:00:00Z"},
        {"properties": [{"key": "a", "value": "b"}]},
        {"destinations": [{"locationName": "Packing stand"}]},
        {"name": "T-2"},
        {"name": None},
        {"name": "Night", "incompleteName": True},
    ],
)
async def test_a_key_used_for_another_order_is_refused(
    client: httpx.AsyncClient, change: dict[str, object]
) -> None:
    await client.post(ORDERS, json={**BODY, "name": "T-1", "idempotencyKey": "k"})

    answer = await client.post(ORDERS, json={**BODY, "name": "T-1", "idempotencyKey": "k", **change})

    assert "'T-1'" in problem(answer, 422).detail
    assert len((await client.get(ORDERS)).json()["transportOrders"]) == 1


async def test_concurrent_requests_with_one_key_create_one_order(client: httpx.AsyncClient) -> None:
    body = {**BODY, "idempotencyKey": "k", "name": "T-1"}
    answers = await asyncio.gather(*(client.post(ORDERS, json=body) for _ in range(20)))
    assert sorted(answer.status_code for answer in answers) == [200] * 19 + [201]
    assert {answer.json()["name"] for answer in answers} == {"T-1"}


async def test_concurrent_requests_with_one_name_create_one_order(client: httpx.AsyncClient) -> None:
    answers = await asyncio.gather(*(client.post(ORDERS, json={**BODY, "name": "T-1"}) for _ in range(20)))
    assert sorted(answer.status_code for answer in answers) == [200] * 19 + [201]


async def test_unroutable_order_is_created_with_a_reason(client: httpx.AsyncClient) -> None:
    body = {"destinations": [{"locationName": "Packing stand"}, {"locationName": "Parking bay"}]}
    body["properties"] = [{"key": "tcs:resourcesToAvoid", "value": "Middle 4"}]
    order = (await client.post(ORDERS, json=body)).json()
    assert order["state"] == "UNROUTABLE"
    assert "No route" in order["reason"]


@pytest.mark.parametrize(
    ("body", "status", "said"),
    [
        (b"{", 400, "not JSON"),
        (b"[]", 422, "form"),
        (b'{"destinations": []}', 422, "form"),
        (b'{"destinations": [{}]}', 422, "form"),
        (b'{"destinations": [{"locationName": "X"}], "colour": "red"}', 422, "form"),
        (b'{"destinations": [{"locationName": "Nowhere"}]}', 404, "plant"),
        (b'{"destinations": [{"locationName": "Goods in", "operation": "Fly"}]}', 422, "plant"),
        (b'{"name": "a/b", "destinations": [{"locationName": "Goods in"}]}', 422, "form"),
        (b'{"destinations": [{"locationName": "Middle 1"}], "intendedVehicle": "R2D2"}', 404, "plant"),
        (b'{"destinations": [{"coordinate": {"x": NaN, "y": 0}}]}', 422, "form"),
        (b'{"destinations": [{"coordinate": {"x": 1e999, "y": 0}}]}', 422, "form"),
    ],
)
async def test_bad_requests_get_a_hint_and_create_nothing(
    client: httpx.AsyncClient, body: bytes, status: int, said: str
) -> None:
    found = problem(
        await client.post(ORDERS, content=body, headers={"content-type": "application/json"}), status
    )
    assert said in found.detail
    assert found.errors
    assert (await client.get(ORDERS)).json()["transportOrders"] == []


async def test_all_problems_are_reported_together(client: httpx.AsyncClient) -> None:
    body = {"destinations": [{"locationName": "Nowhere"}, {"locationName": "Goods in", "operation": "Fly"}]}
    found = problem(await client.post(ORDERS, json=body), 422)
    assert [error.split(":")[0] for error in found.errors] == ["Destination 1", "Destination 2"]


async def test_list_is_filtered_and_paged(client: httpx.AsyncClient) -> None:
    for number in range(5):
        vehicle = {"intendedVehicle": "Robot-01"} if number % 2 else {}
        await client.post(ORDERS, json={**BODY, "name": f"T-{number}", **vehicle})
    await client.post(f"{ORDERS}/T-0/withdrawal")

    page = (await client.get(ORDERS, params={"limit": 2})).json()
    assert [order["name"] for order in page["transportOrders"]] == ["T-4", "T-3"]
    following = (await client.get(ORDERS, params={"limit": 3, "after": page["next"]})).json()
    assert [order["name"] for order in following["transportOrders"]] == ["T-2", "T-1", "T-0"]
    assert following["next"] is None
    failed = (await client.get(ORDERS, params={"state": ["FAILED", "FINISHED"]})).json()
    assert [order["name"] for order in failed["transportOrders"]] == ["T-0"]
    intended = (await client.get(ORDERS, params={"intendedVehicle": "Robot-01"})).json()
    assert [order["name"] for order in intended["transportOrders"]] == ["T-3", "T-1"]
    problem(await client.get(ORDERS, params={"limit": 0}), 422)
    problem(await client.get(ORDERS, params={"after": "x"}), 422)


async def made(client: httpx.AsyncClient, number: int) -> list[str]:
    """Create orders; return their names, the newest first."""
    names = [f"T-{each}" for each in range(number)]
    for name in names:
        assert (await client.post(ORDERS, json={**BODY, "name": name})).status_code == 201
    return names[::-1]


async def test_a_long_page_is_complete_and_has_its_length(client: httpx.AsyncClient) -> None:
    names = await made(client, 3 * ORDERS_AT_ONCE)
    for limit in (ORDERS_AT_ONCE - 1, ORDERS_AT_ONCE, 3 * ORDERS_AT_ONCE - 1, 3 * ORDERS_AT_ONCE):
        answer = await client.get(ORDERS, params={"limit": limit})
        page = TransportOrderPage.model_validate_json(answer.content)
        assert [each.name for each in page.transport_orders] == names[:limit]
        assert int(answer.headers["content-length"]) == len(answer.content)
        following = names[limit:]
        assert page.next is not None if following else page.next is None
        if following:
            rest = (await client.get(ORDERS, params={"after": page.next})).json()
            assert [each["name"] for each in rest["transportOrders"]] == following
    single = (await client.get(f"{ORDERS}/{names[0]}")).json()
    assert answer.json()["transportOrders"][0] == single


async def test_orders_are_selected_by_time_of_creation(client: httpx.AsyncClient) -> None:
    names = await made(client, 3)
    created = (await client.get(f"{ORDERS}/{names[-1]}")).json()["created"]

    async def found(**query: str) -> list[str]:
        answer = await client.get(ORDERS, params=query)
        assert answer.status_code == 200, answer.text
        return sorted(each["name"] for each in answer.json()["transportOrders"])

    assert await found(since=created) == sorted(names)
    assert await found(until=created) == []
    assert await found(since="2000-01-01T00:00:00Z", until="2100-01-01T00:00:00+01:00") == sorted(names)
    assert await found(since="2100-01-01T00:00:00Z") == []
    assert (await client.get(ORDERS, params={"since": "yesterday"})).status_code == 422


async def test_a_store_that_fails_within_a_page_is_answered_as_a_problem(
    client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    await made(client, 2 * ORDERS_AT_ONCE)
    read, answers = database.read_orders, count()

    def failing(*given: Any) -> Any:
        if next(answers):
            raise OperationalError("SELECT", {}, Exception("disk I/O error"))
        return read(*given)

    monkeypatch.setattr(database, "read_orders", failing)
    problem(await client.get(ORDERS, params={"limit": 1000}), 503)


async def test_withdrawal_of_a_waiting_order_ends_it(client: httpx.AsyncClient) -> None:
    await client.post(ORDERS, json={**BODY, "name": "T-1"})
    answer = await client.post(f"{ORDERS}/T-1/withdrawal", json={"reason": "customer cancelled"})
    assert answer.status_code == 200
    assert (answer.json()["state"], answer.json()["reason"]) == ("FAILED", "customer cancelled")
    assert "already FAILED" in problem(await client.post(f"{ORDERS}/T-1/withdrawal"), 409).detail


async def test_read_only_store_acknowledges_nothing(client: httpx.AsyncClient, service: OrderService) -> None:
    service.store.problem = "disk full"
    found = problem(await client.post(ORDERS, json=BODY), 503)
    assert "disk full" in found.detail
    assert service.engine.state.orders.dispatchable() == ()


async def test_the_etag_of_an_order_is_its_version(client: httpx.AsyncClient) -> None:
    made = await client.post(ORDERS, json={**BODY, "name": "T-1"})
    tag = made.headers["etag"]
    assert tag == f'"{made.json()["version"]}"'
    same = await client.get(f"{ORDERS}/T-1", headers={"If-None-Match": tag})
    assert (same.status_code, same.content, same.headers["etag"]) == (304, b"", tag)
    other = await client.get(f"{ORDERS}/T-1", headers={"If-None-Match": '"99"'})
    assert (other.status_code, other.headers["etag"]) == (200, tag)


async def test_order_that_has_changed_meanwhile_is_not_withdrawn(client: httpx.AsyncClient) -> None:
    made = await client.post(ORDERS, json={**BODY, "name": "T-1"})
    stale = await client.post(f"{ORDERS}/T-1/withdrawal", headers={"If-Match": '"1"'})
    assert "'T-1' has changed" in problem(stale, 412).detail
    assert (await client.get(f"{ORDERS}/T-1")).json()["state"] == "DISPATCHABLE"
    fresh = await client.post(f"{ORDERS}/T-1/withdrawal", headers={"If-Match": made.headers["etag"]})
    assert (fresh.status_code, fresh.json()["state"]) == (200, "FAILED")
    assert fresh.headers["etag"] != made.headers["etag"]


async def test_a_waiting_order_is_changed_and_dispatched_anew(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    urgent = {**BODY, "name": "T-2", "priority": 3}
    asked = {**BODY, "name": "T-1", "timeout": 60, "deadline": "2020-01-01T00:00:00Z"}
    for body in (asked, urgent):
        (await client.post(ORDERS, json=body)).raise_for_status()
    assert [order.name for order in service.engine.state.orders.dispatchable()] == ["T-2", "T-1"]
    new = {"priority": 5, "intendedVehicle": "Robot-02", "deadline": "2035-01-01T00:00:00Z", "timeout": None}
    changed = await client.patch(f"{ORDERS}/T-1", json=new)
    assert changed.status_code == 200, changed.text
    order = changed.json()
    assert (order["priority"], order["intendedVehicle"], order["timeout"]) == (5, "Robot-02", None)
    assert (order["deadline"], order["late"]) == ("2035-01-01T00:00:00.000Z", False)
    entries = {each["eventCode"]: each["supplements"] for each in order["history"]}
    assert entries["nena:changed"] == ["priority=5", "deadline=2035-01-01T00:00:00.000Z", "timeout=None"]
    assert entries["nena:intendedVehicleChanged"] == ["Robot-02"]
    assert [order.name for order in service.engine.state.orders.dispatchable()] == ["T-1", "T-2"]
    assert (await client.post(ORDERS, json=asked)).status_code == 200, "the same request as before"
    left = await client.patch(f"{ORDERS}/T-1", json={"intendedVehicle": None})
    assert (left.json()["intendedVehicle"], left.json()["priority"]) == (None, 5)


async def test_an_order_that_a_vehicle_has_is_not_changed(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    (await client.post(ORDERS, json={**BODY, "name": "T-1"})).raise_for_status()
    orders = service.engine.state.orders
    (order,) = orders.dispatchable()
    orders.put(order.assigned("Robot-01", [()], Reason.of("it is near"), datetime.now(UTC)))
    refused = problem(await client.patch(f"{ORDERS}/T-1", json={"priority": 1}), 409)
    assert "BEING_PROCESSED with vehicle 'Robot-01'. Withdraw it" in refused.detail


async def test_a_change_that_is_not_possible_is_refused(client: httpx.AsyncClient) -> None:
    (await client.post(ORDERS, json={**BODY, "name": "T-1"})).raise_for_status()
    assert "set at least one" in str(problem(await client.patch(f"{ORDERS}/T-1", json={}), 422))
    problem(await client.patch(f"{ORDERS}/T-1", json={"type": "Park"}), 422)
    problem(await client.patch(f"{ORDERS}/T-1", json={"intendedVehicle": "R2D2"}), 404)
    problem(await client.patch(f"{ORDERS}/T-9", json={"priority": 1}), 404)
    problem(await client.patch(f"{ORDERS}/T-1", json={"priority": 1}, headers={"If-Match": '"99"'}), 412)
    await client.post(f"{ORDERS}/T-1/withdrawal")
    ended = problem(await client.patch(f"{ORDERS}/T-1", json={"priority": 1}), 409)
    assert "cannot be changed" in ended.detail


async def test_delivery_of_an_order_is_published(client: httpx.AsyncClient) -> None:
    await client.post(ORDERS, json={**BODY, "name": "T-1"})
    told = (await client.get(f"{ORDERS}/T-1/delivery")).json()
    assert (told["transportOrder"], told["phase"]) == ("T-1", "NONE")
    problem(await client.get(f"{ORDERS}/T-9/delivery"), 404)


async def test_each_vehicle_has_a_reason_for_an_order(client: httpx.AsyncClient) -> None:
    await client.post(ORDERS, json={**BODY, "name": "T-1"})
    told = (await client.get(f"{ORDERS}/T-1/assignment")).json()
    assert (told["transportOrder"], told["state"], told["leftOut"]) == ("T-1", "DISPATCHABLE", 0)
    assert [each["vehicle"] for each in told["vehicles"]] == ["Robot-01", "Robot-02"]
    assert all(each["reason"] and not each["fits"] for each in told["vehicles"])
    short = (await client.get(f"{ORDERS}/T-1/assignment", params={"limit": 1})).json()
    assert (len(short["vehicles"]), short["leftOut"]) == (1, 1)
    problem(await client.get(f"{ORDERS}/T-9/assignment"), 404)


async def test_a_waiting_order_is_held_and_resumed(client: httpx.AsyncClient) -> None:
    made = await client.post(ORDERS, json={"name": "T-1", "destinations": [{"locationName": "South 2"}]})
    assert made.status_code == 201, made.text
    held = (await client.post(f"{ORDERS}/T-1/hold", json={"by": "Ann", "reason": "tea"})).json()
    assert (held["held"]["by"], held["state"]) == ("Ann", "DISPATCHABLE")
    assert held["reason"].startswith("held by Ann since ")
    again = await client.post(f"{ORDERS}/T-1/hold", json={"by": "Bob"})
    assert again.json()["held"] == held["held"]
    stale = await client.post(f"{ORDERS}/T-1/resume", headers={"If-Match": '"1"'})
    problem(stale, 412)
    resumed = (await client.post(f"{ORDERS}/T-1/resume", json={"by": "Bob"})).json()
    assert resumed["held"] is None
    codes = [entry["eventCode"] for entry in resumed["history"]]
    assert codes[-3:-1] == ["nena:held", "nena:resumed"]


def ann(subject: str) -> OidcUser:
    return OidcUser("ann", Role.OPERATOR, subject, datetime.max.replace(tzinfo=UTC))


@pytest.mark.parametrize(
    ("user", "by"),
    [
        (User(name="ann", role=Role.OPERATOR, token_sha256=hash_of("ann's")), "ann"),
        (ann("17"), "ann (subject 17)"),
        (ann("7" * 255), f"ann (subject {'7' * 255})"[:BY_LIMIT]),
        (None, "somebody"),
    ],
)
async def test_the_requesting_user_is_recorded(
    service: OrderService, user: KnownUser | None, by: str
) -> None:
    async def door(scope: Scope, receive: Receive, send: Send) -> None:
        scope["state"] = {"user": user}
        await service.app(scope, receive, send)

    transport = httpx.ASGITransport(door)
    async with httpx.AsyncClient(transport=transport, base_url="http://order-service") as client:
        await client.post(ORDERS, json={**BODY, "name": "T-1"})
        held = (await client.post(f"{ORDERS}/T-1/hold")).json()
        resumed = (await client.post(f"{ORDERS}/T-1/resume")).json()

    assert held["held"]["by"] == by
    told = {entry["eventCode"]: entry["supplements"] for entry in resumed["history"]}
    assert told["nena:resumed"][0] == by


async def test_ended_orders_are_neither_held_nor_resumed(client: httpx.AsyncClient) -> None:
    await client.post(ORDERS, json={"name": "T-1", "destinations": [{"locationName": "South 2"}]})
    await client.post(f"{ORDERS}/T-1/withdrawal")
    for verb in ("hold", "resume"):
        assert "already FAILED" in problem(await client.post(f"{ORDERS}/T-1/{verb}"), 409).detail
        problem(await client.post(f"{ORDERS}/T-9/{verb}"), 404)
