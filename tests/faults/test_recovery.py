"""Kill the order service at random moments, with twenty robots: nothing is lost or done twice.

Nor is any robot ever granted a place where another one may be, which the conversation alone shows.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import pytest

from faults.conftest import Trial
from faults.extent import ORDER_KILLS, only_in_whole
from faults.site import Site
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC
from support.pausing import time_passes
from support.postgres import Postgres
from support.traffic.conversation import Conversation
from support.waiting import awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(3600)]

ROBOTS = 20
AT_ONCE = 24
LONGEST_LIFE = 3.0
"""Seconds between a recovery and the next kill, at the most."""
AGREED_WITHIN = 30.0


@pytest.mark.long
async def test_order_service_killed_at_random_moments(trial: Callable[..., Any]) -> None:
    chance = Random(50)
    async with trial(seed=50, at_once=AT_ONCE, loopback=ROBOTS, on_ros=False) as running:
        for _ in range(ORDER_KILLS):
            await _life(chance)
            _kill_order_service(running.site)
            await running.recovers("order service killed")
            await _agree(running)
    assert _clashes(running.site.wire.history) == []


@only_in_whole
async def test_order_service_broker_and_database_killed_in_any_order(
    trial: Callable[..., Any], own_postgres: Postgres
) -> None:
    chance = Random(51)
    site = {"loopback": ROBOTS, "on_ros": False, "store_url": own_postgres.url}
    async with trial(seed=51, at_once=AT_ONCE, **site) as running:
        for _ in range(ORDER_KILLS):
            await _life(chance)
            begin = len(running.site.wire.history)
            fault = chance.choice(("order service", "order service", "broker", "database"))
            if fault == "order service":
                _kill_order_service(running.site)
            elif fault == "broker":
                running.site.broker.restart()
                begin = len(running.site.wire.history)
            else:
                own_postgres.stop()
                own_postgres.start()
            await running.recovers(f"{fault} killed")
            await _agree(running)
            assert _clashes(running.site.wire.history[begin:]) == []


async def _life(chance: Random) -> None:
    await time_passes(chance.uniform(0.0, LONGEST_LIFE))


def _kill_order_service(site: Site) -> None:
    site.programs["order-service"].kill()
    site.start_order_service()


async def _agree(running: Trial) -> None:
    """Wait until the order service knows which robot works on each reported order."""

    async def differences() -> dict[str, str]:
        works = _work(running.site)
        answers = [await running.site.orders.get(f"/v1/transportOrders/{name}") for name in works.values()]
        found = {}
        for (robot, name), answer in zip(works.items(), answers, strict=True):
            order = answer.json()
            if order["state"] not in ("FINISHED", "FAILED") and order["processingVehicle"] != robot:
                found[robot] = f"{name} is {order['state']} at {order['processingVehicle']}"
        return found

    await awaited(
        differences,
        lambda found: not found,
        seconds=AGREED_WITHIN,
        what="every order is where the robots say",
    )


def _work(site: Site) -> dict[str, str]:
    """Return the transport order that each robot reports to work on, by its serial number."""
    states: dict[str, State] = {}
    for message in site.wire.received(f"{site.interface}/v2/+/+/state"):
        states[message.topic.split("/")[-2]] = CODEC.decode(State, message.payload)
    return {
        serial: state.order_id.rsplit("-", 1)[0]
        for serial, state in states.items()
        if state.node_states and state.order_id.startswith("T-")
    }


def _clashes(messages: list[Inbound]) -> list[str]:
    conversation = Conversation()
    conversation.read(each for each in messages if "/v2/" in each.topic)
    return conversation.clashes
