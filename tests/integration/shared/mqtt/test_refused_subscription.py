"""A broker that refuses a program's subscription: it is reported, and not only logged."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from nena_order_service.service import readiness
from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.mqtt import MqttLink
from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, error_types, running_agent
from support.order_service_fleet import Fleet, listening
from support.served_aggregator import serving
from support.waiting import until

pytestmark = pytest.mark.broker

PLUGIN = Path("/usr/lib/x86_64-linux-gnu/mosquitto_dynamic_security.so")
SECRET = "secret/v2/+/+/state"
RULES = {
    "defaultACLAccess": {
        "publishClientSend": True,
        "publishClientReceive": True,
        "subscribe": True,
        "unsubscribe": True,
    },
    "roles": [
        {
            "rolename": "deaf",
            "acls": [
                {"acltype": "subscribePattern", "topic": "+/v2/+/+/order", "priority": 1, "allow": False},
                {"acltype": "subscribeLiteral", "topic": SECRET, "priority": 1, "allow": False},
            ],
        }
    ],
    "groups": [{"groupname": "all", "roles": [{"rolename": "deaf"}], "clients": []}],
    "anonymousGroup": "all",
    "clients": [],
}
"""Nobody hears orders, nor states under one interface name; all else is free."""


@pytest.fixture
def strict_broker(tmp_path: Path) -> Iterator[Broker]:
    """Yield a broker that refuses subscriptions to orders, which Mosquitto's plain access list cannot do."""
    if not PLUGIN.exists():
        pytest.skip(f"Mosquitto's dynamic security plug-in is not at {PLUGIN}")
    rules = tmp_path / "security.json"
    rules.write_text(json.dumps(RULES))
    rules.chmod(0o666)
    broker = Broker(more=f"plugin {PLUGIN}\nplugin_opt_config_file {rules}\n")
    yield broker
    broker.close()


@asynccontextmanager
async def linked(broker: Broker, *topic_filters: str) -> AsyncIterator[MqttLink]:
    link = MqttLink(broker.settings, client_id="refused")
    for each in topic_filters:
        link.subscribe(each, lambda _: None)
    task = asyncio.create_task(link.run(), name="link")
    try:
        await until(lambda: link.state.connected)
        yield link
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_link_names_the_refused_subscriptions(strict_broker: Broker) -> None:
    async with linked(strict_broker, "uagv/v2/ACME/0001/order", "uagv/v2/ACME/0001/state") as link:
        assert link.state.refused == ("uagv/v2/ACME/0001/order",)


async def test_refused_optional_subscription_is_not_a_problem(strict_broker: Broker, tmp_path: Path) -> None:
    fleet = Fleet(strict_broker, "uagv", tmp_path)
    with fleet.stack:
        program = fleet.order_service()
        async with await program.client() as client:
            await listening(client)
            ready = await client.get("/readyz")
    assert ready.json()["problems"] == [], "it only watches what others send to robots"
    assert "the program works without it" in program.log
    assert "uagv/v2/+/+/order" in program.log


async def test_order_service_is_not_ready_without_its_subscriptions(
    strict_broker: Broker, tmp_path: Path
) -> None:
    url = f"sqlite:///{tmp_path / 'orders.db'}"
    store = Store(open_database(url), InstanceLock.take(url))
    try:
        async with linked(strict_broker, "uagv/v2/ACME/0001/order") as link:
            told = readiness(link, store)
        assert not told.ready
        assert any("uagv/v2/ACME/0001/order" in each for each in told.problems)
    finally:
        store.close()


@pytest.mark.clause("6.6.5.4")
async def test_aggregator_is_not_ready_without_its_subscriptions(strict_broker: Broker) -> None:
    async with serving(strict_broker, "secret") as served:
        answer = await served.http.get("/readyz")
    assert answer.status_code == 503
    assert SECRET in answer.json()["detail"]


async def test_robot_reports_that_it_cannot_receive_orders(strict_broker: Broker, tmp_path: Path) -> None:
    settings = agent_settings(strict_broker, "uagv", tmp_path)
    with MqttPeer(strict_broker, "uagv/v2/+/+/state") as peer:
        fleet = FleetControl(peer, "uagv")
        async with running_agent(settings):
            state = await fleet.state(lambda state: "SUBSCRIPTION_REFUSED" in error_types(state))

    (entry,) = state["errors"]
    assert entry["errorLevel"] == "WARNING"
    assert fleet.topic(Topic.ORDER) in entry["errorDescription"]
