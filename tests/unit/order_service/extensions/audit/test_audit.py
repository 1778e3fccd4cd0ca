"""The audit trail by REST: what is recorded of which request, and when."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from datetime import timedelta
from typing import Any
from unittest.mock import MagicMock

import httpx
import pytest

from nena_order_service.api.audit import to_masked_json
from nena_order_service.api.operations import Call, Handler, HostOperations
from nena_order_service.extensions import audit
from nena_order_service.extensions.audit import AuditTrail, csv_file
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.service import OrderService
from nena_shared.fleet_api.audit import AuditPage, ChainCheck
from nena_shared.fleet_api.operations import OPERATIONS
from support.clocks import ManualClock
from support.waiting import awaited

ORDER = {"name": "T-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}


async def rows(client: httpx.AsyncClient, **query: Any) -> list[dict[str, Any]]:
    answer = await client.get("/v1/audit", params=query)
    assert answer.status_code == 200, answer.text
    found: list[dict[str, Any]] = answer.json()["entries"]
    return found


async def row(client: httpx.AsyncClient, number: int = 1) -> dict[str, Any]:
    """Return the newest row when there are this many."""
    found = await awaited(lambda: rows(client), lambda each: len(each) >= number, seconds=20, what="rows")
    assert len(found) == number, found
    return found[0]


async def test_order_is_recorded_with_its_creator(client: httpx.AsyncClient) -> None:
    await client.post("/v1/transportOrders", json=ORDER, headers={"user-agent": "wms/2"})
    found = await row(client)
    timestamp, hash_, after = found.pop("timestamp"), found.pop("hash"), json.loads(found.pop("after"))
    assert (timestamp[-1], len(hash_)) == ("Z", 64)
    assert after["state"] in {"DISPATCHABLE", "UNROUTABLE", "ACTIVE"}
    assert json.loads(found.pop("request")) == ORDER
    assert found == {
        "sequence": 1,
        "user": "anonymous",
        "interface": "REST",
        "client": "wms/2",
        "operation": "createTransportOrder",
        "objectKind": "transportOrder",
        "object": "T-1",
        "before": "",
        "result": "DONE",
        "reason": "",
    }


async def test_row_is_in_the_transaction_of_the_change(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    before = service.store.commits
    await client.post("/v1/transportOrders", json=ORDER)
    assert service.store.commits == before + 1
    assert len(await rows(client)) == 1


CHANGES: list[tuple[str, str, dict[str, Any]]] = [
    ("PUT", "/v1/vehicles/Robot-01/integrationLevel", {"integrationLevel": "TO_BE_IGNORED"}),
    ("PUT", "/v1/vehicles/Robot-01/acceptableOrderTypes", {"acceptableOrderTypes": [{"name": "Cargo"}]}),
    ("POST", "/v1/transportOrders/T-1/hold", {"by": "Anna", "reason": "blocked"}),
    ("POST", "/v1/transportOrders/T-1/withdrawal", {"reason": "not needed"}),
]


async def test_changes_are_recorded_with_the_state_before_and_after(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    await client.post("/v1/transportOrders", json=ORDER)
    for number, (method, path, body) in enumerate(CHANGES, 2):
        assert (await client.request(method, path, json=body)).status_code == 200
        entry = await row(client, number)
        assert entry["object"] == path.split("/")[3]
        assert json.loads(entry["request"]) == body
        before, after = json.loads(entry["before"]), json.loads(entry["after"])
        assert before != after
        assert {"integrationLevel", "state"} & before.keys()

    name = service.engine.plant.paths[0].name
    await client.put(f"/v1/paths/{name}/lock", json={"locked": True})
    found = await row(client, len(CHANGES) + 2)
    assert (found["objectKind"], found["object"]) == ("path", name)
    assert (found["before"], found["after"]) == ('{"locked": false}', '{"locked": true}')


async def test_stop_and_its_end_are_recorded(client: httpx.AsyncClient) -> None:
    stop = (await client.post("/v1/stops", json={"reason": "spill", "by": "Anna"})).json()
    begun = await row(client)
    assert (begun["operation"], begun["object"], begun["after"]) == ("stop", stop["name"], '{"active": true}')
    await client.post(f"/v1/stops/{stop['name']}/end", json={"by": "Ben"})
    ended = await row(client, 2)
    assert (ended["operation"], ended["object"]) == ("endStop", stop["name"])
    assert (ended["before"], ended["after"]) == ('{"active": true}', '{"active": false}')


async def test_dispatch_is_recorded_for_the_vehicle_with_its_order(client: httpx.AsyncClient) -> None:
    order = (await client.post("/v1/vehicles/Robot-01/dispatch", json={"point": "Middle 1"})).json()
    found = await row(client)
    assert json.loads(found["after"]) == {"transportOrder": order["name"]}
    assert (found["objectKind"], found["object"]) == ("vehicle", "Robot-01")


async def test_refused_request_is_recorded_with_the_reason(client: httpx.AsyncClient) -> None:
    refused: list[tuple[str, str, dict[str, Any], str]] = [
        ("POST", "/v1/transportOrders/none/withdrawal", {}, "UNKNOWN_ORDER: Unknown transport order 'none'"),
        ("PUT", "/v1/paths/none/lock", {"locked": True}, "UNKNOWN_PATH: "),
        ("POST", "/v1/transportOrders", {"destinations": [{"locationName": "none"}]}, "none"),
        ("POST", "/v1/vehicles/Robot-01/instantActions", {"actionType": "pause"}, "NOT_REACHED: "),
    ]
    for number, (method, path, body, reason) in enumerate(refused, 1):
        assert (await client.request(method, path, json=body)).status_code >= 400
        entry = await row(client, number)
        assert (entry["result"], entry["after"]) == ("REFUSED", "")
        assert reason in entry["reason"]


async def test_failed_request_is_recorded_without_internals(
    client: httpx.AsyncClient, failing_create: str
) -> None:
    assert (await client.post("/v1/transportOrders", json=ORDER)).status_code == 500
    found = await row(client)
    assert (found["result"], found["reason"]) == ("FAILED", "KeyError")
    assert failing_create not in json.dumps(found)


async def test_repeated_request_is_recorded_as_well(client: httpx.AsyncClient) -> None:
    for _ in range(2):
        await client.post("/v1/transportOrders", json={**ORDER, "idempotencyKey": "k"})
    found = await row(client, 2)
    assert (found["object"], found["result"]) == ("T-1", "DONE")
    assert found["before"] == found["after"] != ""  # unlike the row of the creation
    assert (await rows(client))[1]["before"] == ""


async def test_each_order_of_a_batch_has_a_row(client: httpx.AsyncClient) -> None:
    orders = [{**ORDER, "name": name} for name in ("T-1", "T-2", "T-1")]
    bad = {"name": "T-3", "destinations": [{"locationName": "none"}]}
    await client.post("/v1/transportOrders/batch", json={"transportOrders": [*orders, bad]})
    whole = await row(client, 3)
    assert (json.loads(whole["request"])["transportOrders"], whole["object"]) == (4, "")
    assert json.loads(whole["after"])["201"] == 2
    assert [each["object"] for each in (await rows(client))[1:]] == ["T-2", "T-1"]


async def test_reading_and_malformed_requests_are_not_recorded(client: httpx.AsyncClient) -> None:
    await client.get("/v1/transportOrders")
    assert (await client.post("/v1/transportOrders", json={"x": 1})).status_code == 422
    await client.post("/v1/transportOrders", json=ORDER)
    assert [each["object"] for each in await rows(client)] == ["T-1"]


async def test_instant_action_does_not_wait_for_its_row(
    client: httpx.AsyncClient, service: OrderService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pause must reach the robot at once, also while the database is slow or gone."""
    sent: list[str] = []
    engine = service.engine
    view = engine.view

    def online(vehicle: Any) -> Any:
        return replace(view(vehicle), link=LinkStatus.ONLINE)

    def send(_: Any, action: Any) -> None:
        sent.append(action.action_type)
        commits.append(service.store.commits)

    commits: list[int] = []
    before = service.store.commits
    monkeypatch.setattr(engine, "view", online)
    monkeypatch.setattr(engine.context.fleet, "instant_action", send)
    hurried = engine.settings.model_copy(update={"instant_action_timeout": 0.01})
    monkeypatch.setattr(engine, "settings", hurried)
    answer = await client.post("/v1/vehicles/Robot-01/instantActions", json={"actionType": "pause"})
    assert answer.status_code == 202
    assert (sent, commits) == (["startPause"], [before])
    found = await row(client)
    assert json.loads(found["after"])["status"] == "PENDING"


async def test_rows_fit_into_the_chain(client: httpx.AsyncClient) -> None:
    for number in range(5):
        await client.post("/v1/transportOrders", json={**ORDER, "name": f"T-{number}"})
    await client.post("/v1/transportOrders/none/withdrawal")
    await row(client, 6)
    checking = ChainCheck()
    found: list[str] = []
    after: dict[str, str] = {}
    while True:
        answer = await client.get("/v1/audit", params={"limit": 2, "oldestFirst": True, **after})
        page = AuditPage.model_validate_json(answer.content)
        found += checking.problems(page)
        if page.next is None:
            break
        after = {"after": page.next}
    assert (found, checking.rows) == ([], 6)


@pytest.mark.parametrize("path", ["/v1/audit", "/v1/audit.csv"])
async def test_unknown_filter_is_refused(client: httpx.AsyncClient, path: str) -> None:
    assert (await client.get(path, params={"usr": "ann"})).status_code == 400


async def test_trail_is_exported_as_csv(client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_file, "PAGE", 2)
    for number in range(5):
        await client.post("/v1/transportOrders", json={**ORDER, "name": f"T-{number}"})
    await client.post("/v1/transportOrders/none/withdrawal", headers={"User-Agent": "=1+1"})
    await row(client, 6)
    answer = await client.get("/v1/audit.csv")
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    found = [*csv.DictReader(io.StringIO(answer.text))]
    listed = (await client.get("/v1/audit")).json()["entries"]
    assert [each["sequence"] for each in found] == [str(each["sequence"]) for each in listed]
    assert set(found[0]) == set(listed[0])
    filters: dict[str, str | bool] = {"result": "REFUSED", "oldestFirst": True}
    (refused,) = csv.DictReader(io.StringIO((await client.get("/v1/audit.csv", params=filters)).text))
    assert refused["object"] == "none"
    assert refused["client"] == "'=1+1"  # no spreadsheet executes it


async def test_old_rows_are_deleted(
    client: httpx.AsyncClient, service: OrderService, monkeypatch: pytest.MonkeyPatch
) -> None:
    await client.post("/v1/transportOrders", json=ORDER)
    trail = service.extensions["audit"]
    assert isinstance(trail, AuditTrail)
    await trail.delete_expired()
    assert len(await rows(client)) == 1
    now = trail.clock.now()
    clock = ManualClock()
    monkeypatch.setattr(clock, "now", lambda: now + timedelta(days=91))
    monkeypatch.setattr(trail, "clock", clock)
    await trail.delete_expired()
    answer = (await client.get("/v1/audit")).json()
    assert (answer["entries"], answer["deleted"]["sequence"]) == ([], 1)
    await client.post("/v1/transportOrders", json={**ORDER, "name": "T-2"})
    assert [each["sequence"] for each in await rows(client)] == [2]


async def test_rows_wait_in_memory_up_to_a_limit(
    service: OrderService, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit, "WAITING_LIMIT", 2)
    commit, held = service.store.commit, []

    def hold(changes: Any, then: Any) -> None:
        held.append((changes, then))

    monkeypatch.setattr(service.store, "commit", hold)
    for _ in range(5):
        await client.post("/v1/transportOrders/none/withdrawal")
    assert len(held) == 2
    monkeypatch.setattr(service.store, "commit", commit)
    for changes, then in held:
        commit(changes, then)
    await service.engine.unit_of_work.wait_committed()
    await client.post("/v1/transportOrders/none/withdrawal")
    await row(client, 3)


async def test_every_changing_operation_is_recorded(client: httpx.AsyncClient, service: OrderService) -> None:
    async def fail() -> None:
        raise RuntimeError

    body = MagicMock(zone_set_id="x")
    body.model_dump.return_value = {}
    for operation in OPERATIONS:
        operations = HostOperations(service.hosts.trail, [Handler(operation, fail)])
        with pytest.raises(RuntimeError):
            await operations.execute(operation, Call("x", body, "ann"))
    await service.engine.unit_of_work.wait_committed()
    changing = [each.name for each in OPERATIONS if each.method != "GET"]
    assert [each["operation"] for each in await rows(client)] == changing[::-1]


def test_secrets_are_masked() -> None:
    content = {
        "parameters": [{"key": "wifiPassword", "value": "hunter2"}, {"key": "map", "value": "m"}],
        "apiKey": "abc",
        "peripheralReservationToken": "door-1",
        "nested": {"client_secret": {"a": 1}},
    }
    assert json.loads(to_masked_json(content)) == {
        "parameters": [{"key": "wifiPassword", "value": "***"}, {"key": "map", "value": "m"}],
        "apiKey": "***",
        "peripheralReservationToken": "door-1",
        "nested": {"client_secret": "***"},
    }


@pytest.mark.parametrize(
    "name", ["token", "accessKey", "Authorization", "wifi.psk", "mqttPwd", "doorPinCode", "refresh_token"]
)
def test_values_of_further_secrets_are_masked(name: str) -> None:
    content = {name: "hunter2", "properties": [{"key": name, "value": "hunter2"}]}
    assert "hunter2" not in to_masked_json(content)


@pytest.mark.parametrize("name", ["peripheralReservationToken", "key", "keypad", "spin", "author"])
def test_other_values_are_recorded(name: str) -> None:
    assert to_masked_json({name: "x"}) == f'{{"{name}":"x"}}'
