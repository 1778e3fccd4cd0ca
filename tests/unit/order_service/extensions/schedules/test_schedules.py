"""Schedules by REST, and the orders that they create."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

import httpx
import pytest

from nena_order_service.api.mqtt import COMMANDS
from nena_order_service.extensions.schedules import ScheduledOrders, schedules
from nena_order_service.extensions.schedules.schedules import Schedules
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings
from support.clocks import ManualClock

START = datetime(2026, 3, 28, 12, tzinfo=UTC)
"""The day before Berlin sets its clocks forward."""
MILK_RUN = "/v1/schedules/milk-run"
BODY = {
    "transportOrder": {"destinations": [{"locationName": "Storage", "operation": "NOP"}], "priority": 3},
    "cron": "0 6 * * *",
    "timeZone": "Europe/Berlin",
}
HOUR, DAY = 3600.0, 24 * 3600.0


@pytest.fixture
def clock(service: OrderService) -> ManualClock:
    made = ManualClock(start=START)
    service.engine.clock = made
    return made


async def put(
    client: httpx.AsyncClient, path: str = MILK_RUN, status: int = 201, **fields: Any
) -> dict[str, Any]:
    answer = await client.put(path, json={**BODY, **fields})
    assert answer.status_code == status, answer.text
    schedule: dict[str, Any] = answer.json()
    return schedule


async def orders(client: httpx.AsyncClient) -> list[str]:
    """Return the names of all orders, the oldest first."""
    found = (await client.get("/v1/transportOrders")).json()["transportOrders"]
    return [each["name"] for each in reversed(found)]


def schedules_of(service: OrderService) -> Schedules:
    extension = service.extensions["schedules"]
    assert isinstance(extension, ScheduledOrders)
    return extension.schedules


async def run_due(service: OrderService) -> None:
    await schedules_of(service).run_due()
    await service.engine.unit_of_work.wait_committed()


@pytest.mark.usefixtures("clock")
async def test_schedule_is_stored_listed_and_deleted(client: httpx.AsyncClient) -> None:
    made = await put(client)
    assert (made["name"], made["createdOrders"], made["skippedRuns"], made["lastRuns"]) == (
        "milk-run",
        0,
        0,
        [],
    )
    assert made["nextRuns"][:2] == ["2026-03-29T04:00:00.000Z", "2026-03-30T04:00:00.000Z"]
    assert made["transportOrder"]["priority"] == 3
    assert (await client.get(MILK_RUN)).json() == made
    assert (await client.get("/v1/schedules")).json() == {"schedules": [made]}

    assert await put(client, status=200) == made
    changed = await put(client, status=200, cron="30 2 * * *")
    assert changed["nextRuns"][0] == "2026-03-29T01:00:00.000Z", "2:30 does not exist on this day"

    assert (await client.delete(MILK_RUN)).json() == changed
    assert (await client.get(MILK_RUN)).status_code == 404
    assert (await client.delete(MILK_RUN)).status_code == 404
    assert (await client.get("/v1/schedules")).json() == {"schedules": []}


async def test_order_is_created_at_its_time(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock
) -> None:
    await put(client)
    clock.advance(16 * HOUR - 1)
    await run_due(service)
    assert await orders(client) == []
    clock.advance(1.2)
    for _ in range(2):
        await run_due(service)
    assert await orders(client) == ["milk-run-20260329T040000Z"]
    order = (await client.get("/v1/transportOrders/milk-run-20260329T040000Z")).json()
    assert (order["priority"], order["driveOrders"][0]["destination"]["locationName"]) == (3, "Storage")

    schedule = (await client.get(MILK_RUN)).json()
    assert (schedule["createdOrders"], schedule["nextRuns"][0]) == (1, "2026-03-30T04:00:00.000Z")
    run = {"planned": "2026-03-29T04:00:00.000Z", "transportOrder": "milk-run-20260329T040000Z"}
    assert schedule["lastRuns"] == [{**run, "reason": "", "codedReason": None}]


@pytest.mark.parametrize(("catch_up", "created"), [(0, []), (2, ["30", "31"]), (9, ["29", "30", "31"])])
async def test_missed_runs_are_skipped_or_caught_up(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock, catch_up: int, created: list[str]
) -> None:
    await put(client, catchUp=catch_up)
    clock.advance(3 * DAY + HOUR)
    await run_due(service)
    assert await orders(client) == [f"milk-run-202603{day}T040000Z" for day in created]
    schedule = (await client.get(MILK_RUN)).json()
    assert (schedule["createdOrders"], schedule["skippedRuns"]) == (len(created), 3 - len(created))
    assert "not active" in schedule["lastRuns"][-1]["reason"]
    metrics = (await client.get("/metrics")).text
    for outcome, number in (("created", len(created)), ("skipped", 3 - len(created))):
        assert f'nena_order_service_schedule_runs_total{{outcome="{outcome}"}} {number}.0' in metrics
    clock.advance(DAY - 9 * HOUR + 1)
    await run_due(service)
    assert (await orders(client))[len(created) :] == ["milk-run-20260401T040000Z"]


async def test_a_run_is_skipped_while_too_many_orders_of_the_schedule_are_open(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock
) -> None:
    await put(client, maxOpenOrders=2)
    clock.advance(16 * HOUR)
    for _ in range(4):
        await run_due(service)
        clock.advance(DAY)
    assert await orders(client) == ["milk-run-20260329T040000Z", "milk-run-20260330T040000Z"]
    schedule = (await client.get(MILK_RUN)).json()
    assert (schedule["createdOrders"], schedule["skippedRuns"]) == (2, 2)
    assert schedule["lastRuns"][0]["codedReason"]["code"] == "orders_open"

    await client.post("/v1/transportOrders/milk-run-20260329T040000Z/withdrawal")
    await run_due(service)
    assert (await orders(client))[-1] == "milk-run-20260402T040000Z"


async def test_of_caught_up_runs_the_latest_create_orders_if_only_some_may_be_open(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock
) -> None:
    await put(client, catchUp=5, maxOpenOrders=2)
    clock.advance(3 * DAY + HOUR)
    await run_due(service)
    assert await orders(client) == ["milk-run-20260330T040000Z", "milk-run-20260331T040000Z"]


async def test_run_that_was_missed_long_ago_is_passed(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock
) -> None:
    await put(client, cron="0 6 1 * *", catchUp=1)
    clock.advance(20 * DAY)
    await run_due(service)
    schedule = (await client.get(MILK_RUN)).json()
    assert (await orders(client), schedule["nextRuns"][0]) == ([], "2026-05-01T04:00:00.000Z")
    assert "more than 7 days ago" in schedule["lastRuns"][0]["reason"]


async def test_restart_continues_after_the_last_run(
    client: httpx.AsyncClient, service: OrderService, settings: OrderServiceSettings, clock: ManualClock
) -> None:
    await put(client, catchUp=5)
    clock.advance(DAY)
    await run_due(service)
    before = (await client.get(MILK_RUN)).json()

    again = OrderService(settings, service.engine.plant, service.store)
    again.engine.clock = clock
    await again.hosts.load()
    await schedules_of(again).load()
    assert json.loads(schedules_of(again).get("milk-run").model_dump_json(by_alias=True)) == before
    await again.engine.start(again.fleet)
    clock.advance(DAY)
    await run_due(again)
    assert await orders(client) == ["milk-run-20260329T040000Z", "milk-run-20260330T040000Z"]


async def test_clock_that_is_set_back_creates_no_order_again(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock
) -> None:
    await put(client, catchUp=5)
    clock.advance(DAY)
    await run_due(service)
    service.engine.clock = back = ManualClock(start=START)
    await put(client, status=200, catchUp=4)  # from now on, which is before the run
    back.advance(DAY)
    await run_due(service)
    assert await orders(client) == ["milk-run-20260329T040000Z"]
    assert "already an order" in (await client.get(MILK_RUN)).json()["lastRuns"][0]["reason"]


async def test_change_loses_no_run_that_is_due(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock
) -> None:
    await put(client)
    clock.advance(16 * HOUR)
    await put(client, status=200, cron="0 7 * * *")
    assert await orders(client) == ["milk-run-20260329T040000Z"]
    row = (await client.get("/v1/audit")).json()["entries"][0]
    assert (row["operation"], json.loads(row["after"])["cron"]) == ("putSchedule", "0 7 * * *")
    clock.advance(HOUR)
    await run_due(service)
    assert (await orders(client))[1:] == ["milk-run-20260329T050000Z"]


async def test_disabled_schedule_catches_up_nothing(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock
) -> None:
    await put(client, catchUp=9)
    disabled = (await client.put(f"{MILK_RUN}/enabled", json={"enabled": False})).json()
    assert (disabled["enabled"], disabled["nextRuns"]) == (False, [])
    clock.advance(3 * DAY)
    await run_due(service)
    await client.put(f"{MILK_RUN}/enabled", json={"enabled": True})
    await run_due(service)
    assert await orders(client) == []
    clock.advance(DAY)
    await run_due(service)
    assert len(await orders(client)) == 1
    assert (await client.put("/v1/schedules/x/enabled", json={"enabled": True})).status_code == 404


async def test_order_that_no_longer_fits_the_plant_is_reported(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    await put(client)
    monkeypatch.delitem(service.engine.plant.locations_by_name, "Storage")
    clock.advance(16 * HOUR)
    await run_due(service)
    schedule = (await client.get(MILK_RUN)).json()
    assert "unknown location or point 'Storage'" in schedule["lastRuns"][0]["reason"]
    assert (schedule["skippedRuns"], schedule["nextRuns"][0]) == (1, "2026-03-30T04:00:00.000Z")


async def test_due_run_waits_for_the_store(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(schedules, "LOOK_INTERVAL", 0.0)
    await put(client)
    clock.advance(16 * HOUR)
    service.store.problem = "disk full"
    await schedules_of(service).run_due()
    refused = await client.put(MILK_RUN, json={**BODY, "cron": "0 7 * * *"})
    assert refused.status_code == 503
    service.store.problem = ""
    assert await orders(client) == []
    await run_due(service)
    assert await orders(client) == ["milk-run-20260329T040000Z"]


async def test_schedule_that_fails_is_retried_and_holds_up_no_other(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(schedules, "LOOK_INTERVAL", 0.0)
    await put(client)
    await put(client, "/v1/schedules/other")
    find = service.engine.store.read_order

    async def fail(*, name: str) -> TransportOrder | None:
        if name.startswith("milk-run"):
            raise RuntimeError(name)
        return await find(name=name)

    clock.advance(16 * HOUR)
    with monkeypatch.context() as failing:
        failing.setattr(service.engine.store, "read_order", fail)
        await run_due(service)
    assert await orders(client) == ["other-20260329T040000Z"]
    assert (await client.get(MILK_RUN)).json()["createdOrders"] == 0, "it has no order yet"
    await run_due(service)
    assert await orders(client) == ["other-20260329T040000Z", "milk-run-20260329T040000Z"]


async def test_invalid_schedule_is_refused(client: httpx.AsyncClient) -> None:
    refused: list[tuple[dict[str, Any], int, str]] = [
        ({"cron": "0 25 * * *"}, 422, "Invalid hour '25'"),
        ({"timeZone": "Europe/Berln"}, 422, "Did you mean 'Europe/Berlin'"),
        ({"transportOrder": {"destinations": [{"locationName": "Storag"}]}}, 404, "Did you mean 'Storage'"),
        ({"transportOrder": {**BODY["transportOrder"], "name": "T"}}, 422, "name"),  # type: ignore[dict-item]
        ({"catchUp": 101}, 422, "catchUp"),
        ({"every": "day"}, 422, "every"),
    ]
    for fields, status, problem in refused:
        answer = await client.put(MILK_RUN, json={**BODY, **fields})
        assert answer.status_code == status, answer.text
        assert problem in " ".join(answer.json()["errors"])
    assert (await client.get("/v1/schedules")).json() == {"schedules": []}


async def test_number_of_schedules_is_limited(
    client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(schedules, "SCHEDULES_LIMIT", 1)
    await put(client)
    await put(client, status=200, cron="0 7 * * *")
    answer = await client.put("/v1/schedules/second", json=BODY)
    assert answer.status_code == 409
    assert "1 schedules already" in answer.json()["detail"]


@pytest.mark.usefixtures("clock")
async def test_changes_are_in_the_audit_trail(client: httpx.AsyncClient) -> None:
    await put(client)
    await client.put(f"{MILK_RUN}/enabled", json={"enabled": False})
    await client.delete(MILK_RUN)
    rows = (await client.get("/v1/audit")).json()["entries"]
    assert [(each["operation"], each["objectKind"], each["object"]) for each in rows] == [
        (name, "schedule", "milk-run") for name in ("deleteSchedule", "enableSchedule", "putSchedule")
    ]
    states = [(each["before"], each["after"]) for each in reversed(rows)]
    first = '{"cron": "0 6 * * *", "timeZone": "Europe/Berlin", "enabled": true}'
    disabled = first.replace("true", "false")
    assert states == [("", first), (first, disabled), (disabled, '{"deleted": true}')]


async def test_mqtt_command_is_the_same_definition(service: OrderService, clock: ManualClock) -> None:
    command = COMMANDS["putSchedule"].model_validate({"schedule": "S", "requestId": "1", **BODY})
    put_schedule = schedules_of(service).put
    assert (await put_schedule("S", command))[1]  # type: ignore[arg-type] # made by create_model
    clock.advance(DAY)
    status, new = await put_schedule("S", command)  # type: ignore[arg-type]
    assert (new, status.next_runs[0]) == (False, datetime(2026, 3, 29, 4, tzinfo=UTC)), "it is still due"


async def test_unreadable_schedule_is_left_out(service: OrderService, client: httpx.AsyncClient) -> None:
    await put(client)
    stored = (await service.store.documents("schedule"))["milk-run"]
    documents = service.engine.state.pending.stored.documents
    with service.engine.unit_of_work.begin():
        documents["schedule", "broken"] = "{}"
        documents["schedule", "another-cron"] = stored.replace("0 6 * * *", "0 25 * * *")
    await service.engine.unit_of_work.wait_committed()
    again = Schedules(service.engine)
    await again.load()
    assert [each.name for each in again.all()] == ["milk-run"]


async def test_task_waits_until_a_schedule_is_due(
    client: httpx.AsyncClient, service: OrderService, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It looks at the clock at least each second, because the clock may be set."""
    waits: list[float] = []

    async def wait(_event: object, seconds: float) -> bool:
        waits.append(seconds)
        clock.advance(seconds)
        return False

    monkeypatch.setattr(schedules, "set_within", wait)
    await put(client)
    clock.advance(16 * HOUR - 1.25)
    for _ in range(2):
        await schedules_of(service).run_when_due()
    assert waits == [1.0, pytest.approx(0.25)]
    await service.engine.unit_of_work.wait_committed()
    assert (await client.get(MILK_RUN)).json()["createdOrders"] == 1
