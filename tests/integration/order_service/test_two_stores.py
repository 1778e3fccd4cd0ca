"""Two order services with stores of their own on one fleet: only one of them leads it."""

from __future__ import annotations

import asyncio
import json
import signal
from contextlib import closing, suppress
from pathlib import Path

import httpx
import pytest

from nena_order_service.fleet.guard import ANSWERED_WITHIN, LeaderRecord
from nena_shared.fleet_api.epoch import epoch_of
from support.broker import Broker, MqttPeer, free_port
from support.mqtt_line import mqtt_line
from support.order_service_fleet import Fleet, listening, order_in, vehicle_idle
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

SLOW = 0.3
"""Seconds that each message to and from the broker takes."""
TAKEN = "another order service with another store is active for this fleet"


def own_store(fleet: Fleet, name: str) -> tuple[object, ...]:
    return ("--store.url", f"sqlite:///{fleet.folder}/{name}.db")


def topic(fleet: Fleet) -> str:
    return f"{fleet.prefix}/leader/{fleet.interface}"


async def test_the_second_service_exits_before_sending_anything(fleet: Fleet) -> None:
    fleet.agent()
    first = await fleet.order_service(name="first").client()
    await listening(first)
    await vehicle_idle(first)
    with MqttPeer(fleet.broker, f"{fleet.interface}/v2/+/+/order", f"{fleet.prefix}/vehicles/#") as wire:
        await until(lambda: wire.received(f"{fleet.prefix}/vehicles/#"))
        own = {epoch_of(each.payload) for each in wire.received()}
        wire.clear()
        second = fleet.order_service(*own_store(fleet, "second"), name="second")
        assert await asyncio.to_thread(second.process.wait, PATIENCE) != 0

        assert TAKEN in second.log
        assert [each for each in wire.received() if epoch_of(each.payload) not in own] == []
    body = {"name": "T", "destinations": [{"locationName": "South 2"}]}
    assert (await first.post("/v1/transportOrders", json=body)).is_success
    await order_in(first, "T", "FINISHED")


async def test_the_second_service_accepts_no_order_during_the_election(fleet: Fleet) -> None:
    """An order that it accepted would be in the store of a program that has exited."""
    await listening(await fleet.order_service(name="first").client())
    url, accepted = f"http://127.0.0.1:{(port := free_port())}/v1/transportOrders", []
    with mqtt_line(fleet.broker) as line:
        line.conduct.delay = SLOW
        more = (*own_store(fleet, "second"), "--mqtt.port", line.port, "--http.port", port)
        second = fleet.order_service(*more, name="second")
        async with httpx.AsyncClient(timeout=PATIENCE) as host:

            async def ended() -> bool:
                with suppress(httpx.HTTPError):
                    answer = await host.post(url, json={"destinations": [{"locationName": "South 2"}]})
                    accepted.extend([answer.text] if answer.is_success else [])
                return second.process.poll() is not None

            await awaited(ended, bool, seconds=PATIENCE, what="the second one has ended")
    assert TAKEN in second.log
    assert accepted == []


async def test_without_a_broker_to_ask_it_accepts_orders(fleet: Fleet) -> None:
    port = free_port()
    client = await fleet.order_service("--mqtt.port", port).client()
    assert (
        await client.post("/v1/transportOrders", json={"destinations": [{"locationName": "South 2"}]})
    ).is_success


async def test_readiness_says_that_the_access_list_hides_the_leader_record(
    fleet: Fleet, tmp_path: Path
) -> None:
    """Mosquitto grants the subscription, acknowledges the question, and delivers nothing."""
    rules = tmp_path / "rules"
    rules.write_text(f"topic readwrite {fleet.interface}/v2/#\n")
    rules.chmod(0o644)
    with closing(Broker(more=f"acl_file {rules}\n")) as fleet.broker:
        client = await fleet.order_service().client()

        async def told() -> str:
            return str((await client.get("/readyz")).json()["problems"])

        await awaited(told, lambda text: topic(fleet) in text and "access list" in text, what="the topic")


async def test_a_newer_service_on_a_copied_store_ends_the_older_one_with_a_message(fleet: Fleet) -> None:
    program = fleet.order_service()
    await listening(await program.client())
    with MqttPeer(fleet.broker, topic(fleet)) as peer:
        record = await peer.wait_for(topic(fleet), lambda each: bool(each.payload))
        own = LeaderRecord.model_validate_json(record.payload)
        later = own.model_copy(update={"epoch": own.epoch + 1, "instance": "later"})
        peer.publish(topic(fleet), later.model_dump_json(by_alias=True))
        assert await asyncio.to_thread(program.process.wait, PATIENCE) != 0
    assert "another order service that uses this store, or a copy of it, was started later" in program.log
    assert TAKEN not in program.log


async def test_it_leads_once_the_first_leader_has_left(fleet: Fleet) -> None:
    first = fleet.order_service(name="first")
    await listening(await first.client())
    first.kill()

    second = await fleet.order_service(*own_store(fleet, "second"), name="second").client()

    await listening(second)


async def test_a_leader_that_ends_clears_its_record(fleet: Fleet) -> None:
    program = fleet.order_service()
    await listening(await program.client())
    program.process.terminate()
    assert await asyncio.to_thread(program.process.wait, PATIENCE) == 0
    with MqttPeer(fleet.broker, topic(fleet)) as peer:
        peer.catch_up()
        assert peer.received() == []


async def test_a_stale_record_does_not_block_a_new_leader(fleet: Fleet) -> None:
    """As a broker keeps it that lost power together with the order service."""
    left = LeaderRecord(store="gone", epoch=2**40, instance="gone")
    with MqttPeer(fleet.broker, topic(fleet)) as peer:
        peer.publish(topic(fleet), left.model_dump_json(by_alias=True), retain=True)
        client = await fleet.order_service().client()

        await listening(client)
        peer.catch_up()
        assert json.loads(peer.received()[-1].payload)["store"] != "gone"
    assert ANSWERED_WITHIN < PATIENCE


async def test_a_broker_that_lost_the_record_is_sent_it_again(fleet: Fleet, own_broker: Broker) -> None:
    fleet.broker = own_broker
    client = await fleet.order_service().client()
    await listening(client)
    own_broker.restart()
    with MqttPeer(own_broker, topic(fleet)) as peer:
        await peer.wait_for(topic(fleet), lambda each: bool(each.payload))
    with MqttPeer(own_broker, topic(fleet)) as peer:
        peer.publish(topic(fleet), b"", retain=True)
        told = peer.payloads
        await until(lambda: [each != b"" for each in told()][-2:] == [False, True], what="the record again")


async def test_a_disconnected_and_replaced_leader_exits_when_it_returns(fleet: Fleet) -> None:
    """Suspend it until the broker drops it and another one with a separate store leads."""
    first = fleet.order_service("--mqtt.keep_alive", 5, name="first")
    await listening(await first.client())
    with MqttPeer(fleet.broker, topic(fleet)) as peer:
        await peer.wait_for(topic(fleet))
        first.process.send_signal(signal.SIGSTOP)
        try:
            await until(lambda: peer.received()[-1].payload == b"", what="the last will", timeout=PATIENCE)
            second = await fleet.order_service(*own_store(fleet, "second"), name="second").client()
            await listening(second)
        finally:
            first.process.send_signal(signal.SIGCONT)

        async def ended() -> bool:
            return first.process.poll() is not None

        await awaited(ended, bool, seconds=PATIENCE, what="the first one has ended")
    assert TAKEN in first.log
    await listening(second)
