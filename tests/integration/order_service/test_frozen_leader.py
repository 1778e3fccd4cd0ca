"""An active order service that hangs, is replaced and wakes sends neither orders nor statuses."""

from __future__ import annotations

import asyncio
import json
import signal

import httpx
import pytest

from nena_shared.fleet_api.epoch import epoch_of, with_epoch
from support.broker import Broker, MqttPeer
from support.instant_robot import InstantRobot, instant_robot
from support.order_service_fleet import Fleet, every_order_ended, order_in, role, vehicle_idle
from support.pausing import time_passes
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ECHO_DELAY = 0.3
"""Seconds after which the robot reports that it has an order."""
BACKLOG = 300
"""States of the robot that wait in front of its echo."""
STRICTLY_BY_AGE = ("--engine.dispatch.age_window", 0)
ORDERS = {"T-1": "South 2", "T-2": "South 1", "T-3": "South 2"}


async def active(client: httpx.AsyncClient) -> None:
    await awaited(lambda: role(client), lambda told: told == "active", seconds=PATIENCE, what="it is active")


def body(name: str) -> dict[str, object]:
    return {
        "name": name,
        "destinations": [{"locationName": ORDERS[name]}],
        "intendedVehicle": "Robot-01",
    }


async def test_a_leader_that_wakes_after_a_takeover_sends_nothing(shared: Fleet, broker: Broker) -> None:
    first = shared.order_service(*STRICTLY_BY_AGE, name="first")
    client = await first.client()
    await active(client)
    standby = await shared.order_service(*STRICTLY_BY_AGE, name="second").client()
    frozen = asyncio.Event()
    loop = asyncio.get_running_loop()

    def freeze(_order: str, robot: InstantRobot) -> None:
        if not frozen.is_set():
            first.process.send_signal(signal.SIGSTOP)
            for _ in range(BACKLOG):
                robot.report()
            loop.call_soon_threadsafe(frozen.set)

    with instant_robot(broker, shared.interface, delay=ECHO_DELAY, on_order=freeze) as robot:
        await vehicle_idle(client)
        with MqttPeer(broker, f"{shared.prefix}/vehicles/robot-01/status") as now:
            epochs = {epoch_of((await now.wait_for()).payload)}
        asked = asyncio.create_task(client.post("/v1/transportOrders", json=body("T-1")))
        await asyncio.wait_for(frozen.wait(), PATIENCE)
        asked.cancel()
        await active(standby)
        for name in ("T-2", "T-3"):
            assert (await standby.post("/v1/transportOrders", json=body(name))).is_success
        try:
            for name in ORDERS:
                await order_in(standby, name, "FINISHED")
            with MqttPeer(broker, f"{shared.prefix}/#") as statuses:
                await until(lambda: statuses.received(f"{shared.prefix}/vehicles/#"))
                statuses.clear()
                first.process.send_signal(signal.SIGCONT)
                await until(lambda: first.process.poll() is not None, what="the old one has ended")
                await time_passes(2 * ECHO_DELAY)
                begun = [(name.rsplit("-", 1)[0], times) for name, times in robot.begun.items()]
                assert begun == [(name, 1) for name in ORDERS]
                will = f"{shared.prefix}/orderService/status"  # of the broker; readers know its old epoch
                stale = [each.topic for each in statuses.received() if epoch_of(each.payload) in epochs]
                assert [topic for topic in stale if topic != will] == []
        finally:
            first.process.send_signal(signal.SIGCONT)
    assert "another order service is now active on this store" in first.log
    await every_order_ended(standby)
    with MqttPeer(broker, f"{shared.prefix}/vehicles/robot-01/status") as now:
        await now.wait_for()

        async def states() -> list[str]:
            shown = (await standby.get("/v1/vehicles/Robot-01")).json()
            return [json.loads(now.payloads()[-1])["state"], shown["state"]]

        await awaited(states, lambda both: both[0] == both[1], what="the broker keeps what is so")


async def test_retained_statuses_of_an_older_epoch_are_cleared(shared: Fleet) -> None:
    gone = f"{shared.prefix}/vehicles/gone/status"
    with MqttPeer(shared.broker, f"{shared.prefix}/vehicles/+/status") as statuses:
        statuses.publish(gone, with_epoch(b'{"name":"Gone"}', 0), retain=True)
        await statuses.wait_for(gone)
        await active(await shared.order_service().client())
        await statuses.wait_for(gone, lambda message: message.payload == b"")
