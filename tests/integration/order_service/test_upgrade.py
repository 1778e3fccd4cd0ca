"""Upgrade, and back: the programs on the store of the first release, and on one of a newer release."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from typing import Any

import pytest

from nena_order_service.fleet.link import Outgoing
from nena_order_service.fleet.outputs import PublishOrder
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.clock import SystemClock
from nena_shared.program import EXIT_FAILED
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_1 import CODEC
from support.broker import MqttPeer
from support.keepers import Keeper
from support.order_service_fleet import Fleet, actions_done, every_order_ended
from support.order_service_work import (
    ended,
    every_order_finished_once,
    in_mid_work,
    order,
    start_robots,
    started,
)
from support.stores import OLDEST_STORE, STORES, make_newer, older_store
from support.waiting import PATIENCE

pytestmark = [pytest.mark.broker, pytest.mark.e2e, pytest.mark.timeout(900)]

AT_STORAGE, AT_SOUTH_3 = (9.0, 9.5), (15.0, 2.0)
ENDED = {"done-1": "FINISHED", "withdrawn-2": "FAILED", "unroutable-3": "UNROUTABLE"}
OPEN = ("running-4", "waiting-5")
ORDERS = tuple(f"T-{number}" for number in range(3))


def in_first_store(query: str) -> list[Any]:
    """Return the JSON documents that a query finds in the store of the first release."""
    with closing(sqlite3.connect(":memory:")) as store:
        store.executescript(OLDEST_STORE.read_text(encoding="utf-8"))
        return [json.loads(document) for (document,) in store.execute(query)]


def first_orders() -> dict[str, dict[str, Any]]:
    return {each["name"]: each for each in in_first_store("SELECT document FROM transport_orders")}


def assert_kept(before: Any, now: Any) -> None:
    """Fail where something of ``before`` is not there any more; fields may have come."""
    if isinstance(before, dict):
        for name, value in before.items():
            assert_kept(value, now[name])
    elif isinstance(before, list):
        for one, other in zip(before, now, strict=True):
            assert_kept(one, other)
    else:
        assert now == before


async def robot_takes_its_order(fleet: Fleet, wire: MqttPeer) -> None:
    """Send the robot what the first release had noted to send, as if it had been killed after that."""
    (noted,) = in_first_store("SELECT document FROM sent_orders")
    vda_order = VdaOrder.model_validate_json(json.dumps(noted["vda_order"]))
    topic = f"{fleet.interface}/v2/NeNa/robot-01"
    await wire.wait_for(f"{topic}/state")
    _, message = Outgoing(SystemClock()).make_message(
        PublishOrder(RobotKey("NeNa", "robot-01"), vda_order), "2.1.0"
    )
    wire.publish(f"{topic}/order", CODEC.encode(message))
    await wire.wait_for(f"{topic}/state", lambda state: b'"orderId":"running-4-0"' in state.payload)


@pytest.mark.parametrize(
    "sent",
    [
        pytest.param(False, id="order not sent yet", marks=pytest.mark.long),
        pytest.param(True, id="robot has its order"),
    ],
)
async def test_orders_of_the_first_release_are_completed(fleet: Fleet, keeper: Keeper, *, sent: bool) -> None:
    older_store(keeper.url)
    wire = fleet.peer()
    start_robots(fleet, [AT_STORAGE, AT_SOUTH_3])
    if sent:
        await robot_takes_its_order(fleet, wire)
    await every_order_is_completed(fleet, wire)


@pytest.mark.parametrize("release", sorted(each.stem for each in STORES.glob("[0-9]*.sql")))
async def test_orders_of_each_later_release_are_completed(fleet: Fleet, keeper: Keeper, release: str) -> None:
    older_store(keeper.url, STORES / f"{release}.sql")
    start_robots(fleet, [AT_STORAGE, AT_SOUTH_3])
    await every_order_is_completed(fleet, fleet.peer())


async def every_order_is_completed(fleet: Fleet, wire: MqttPeer) -> None:
    """Start the current order service on the orders of the first release, with one more, and wait for all."""
    client = await started(fleet.order_service())
    assert await order(client, "new-6") == 201

    orders = {each["name"]: each for each in await every_order_ended(client)}
    states = {name: each["state"] for name, each in orders.items()}
    assert states == ENDED | dict.fromkeys((*OPEN, "new-6"), "FINISHED")
    for name in ENDED:
        assert_kept(first_orders()[name], orders[name])
    history = in_first_store("SELECT document FROM history WHERE order_number = 1 ORDER BY entry")
    assert_kept(history, orders["done-1"]["history"])
    legs = ["running-4-0", "running-4-1", "waiting-5-0", "new-6-0", "new-6-1"]
    assert actions_done(wire, fleet) == dict.fromkeys(legs, 1)


async def test_repeated_requests_after_the_upgrade_return_the_old_orders(
    fleet: Fleet, keeper: Keeper
) -> None:
    older_store(keeper.url)
    client = await started(fleet.order_service())
    for name in ("done-1", "running-4"):
        before = first_orders()[name]
        stops = [each["destination"] for each in before["driveOrders"]]
        body = {
            "name": name,
            "idempotencyKey": f"key-{name}",
            "destinations": [{key: stop[key] for key in ("locationName", "operation")} for stop in stops],
            **{key: before[key] for key in ("priority", "properties")},
        }
        answer = await client.post("/v1/transportOrders", json=body)
        assert answer.status_code == 200, answer.text
        assert answer.json()["created"] == before["created"]


@pytest.mark.long
async def test_the_backup_before_the_upgrade_allows_a_downgrade(fleet: Fleet, keeper: Keeper) -> None:
    """This release plays the older one: the store is such as the next one would leave."""
    wire = fleet.peer()
    program, _ = await in_mid_work(fleet, ORDERS)
    ended(program)
    keeper.back_up()
    make_newer(keeper.url)

    older = fleet.order_service(name="older")
    assert older.process.wait(PATIENCE) == EXIT_FAILED
    (line,) = (each for each in older.log.splitlines() if "9999" in each)
    assert "the store belongs to another release" in line
    assert "restore a backup" in line
    assert "Traceback" not in older.log

    keeper.destroy()
    keeper.restore()
    await every_order_finished_once(fleet, wire, ORDERS)
