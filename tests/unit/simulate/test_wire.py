"""The broker of simulations keeps and clears retained messages as real ones do."""

from __future__ import annotations

import asyncio
from random import Random

from nena_shared.mqtt import Inbound, Outbound
from nena_simulate.virtual_time import VirtualClock, run
from nena_simulate.wire import Broker, Conditions, DirectReader, Link
from support.pausing import time_passes


def test_an_empty_retained_message_is_delivered_and_clears_its_topic() -> None:
    async def work(_: VirtualClock) -> tuple[list[bytes], list[bytes]]:
        broker = Broker(Conditions(), Random(1))
        heard: tuple[list[bytes], list[bytes]] = ([], [])
        tasks = []
        for received in heard:
            link = Link(broker)

            def receive(message: Inbound, received: list[bytes] = received) -> None:
                received.append(message.payload)

            link.subscribe("nena/#", receive)
            tasks.append(asyncio.create_task(link.run()))
            await time_passes(1)
            for payload in (b"leader", b"") if received is heard[0] else ():
                broker.publish(Outbound("nena/v1/leader", payload, retain=True))
            await time_passes(1)
        for task in tasks:
            task.cancel()
        return heard

    assert run(work) == ([b"leader", b""], [])


def test_a_robot_keeps_its_codec() -> None:
    reader = DirectReader()
    assert reader.codec_of("2.1.0") is reader.codec_of("2.1.0")
