"""Messages come in their order and after their delay; some get lost, retained ones never."""

from __future__ import annotations

import asyncio
from random import Random

from nena_shared.mqtt import Inbound, LinkHooks, Outbound
from nena_simulate.virtual_time import VirtualClock, run
from nena_simulate.wire import SUBSCRIBING_SECONDS, Broker, Conditions, Link
from support.pausing import time_passes

MESSAGES = 1000


def heard(conditions: Conditions, *, cut: bool = False) -> tuple[list[Inbound], list[float]]:
    """Return what one program hears of what another one publishes, and when."""

    async def work(clock: VirtualClock) -> tuple[list[Inbound], list[float]]:
        broker = Broker(conditions, Random(1))
        will = Outbound("last/will", b"gone", retain=True)
        sender = Link(
            broker, LinkHooks(will=lambda: will, on_connected=lambda: [Outbound("hello", b"1", retain=True)])
        )
        receiver, messages, times = Link(broker), [], []

        def take(message: Inbound) -> None:
            messages.append(message)
            times.append(clock.monotonic())

        receiver.subscribe("#", take)
        links = [asyncio.create_task(each.run()) for each in (sender, receiver)]
        await time_passes(2 * SUBSCRIBING_SECONDS)
        for number in range(MESSAGES):
            sender.publish(Outbound(f"topic/{number % 3}", str(number).encode()))
        if cut:
            sender.cut(5.0)
            await time_passes(1)
            assert not sender.state.connected
            sender.publish(Outbound("topic/1", b"unheard"))
            await time_passes(5)
            assert sender.state.connected
        await time_passes(1)
        for each in links:
            each.cancel()
        return messages, times

    return run(work)


def test_messages_come_in_their_order_after_their_delay() -> None:
    messages, times = heard(Conditions(delay=0.5))
    plain = [each for each in messages if each.topic != "hello"]

    assert [each.payload for each in plain] == [str(number).encode() for number in range(MESSAGES)]
    assert min(times[-MESSAGES:]) >= 2 * SUBSCRIBING_SECONDS + 0.5


def test_given_share_of_messages_is_lost_but_no_retained_ones() -> None:
    messages, _ = heard(Conditions(loss=0.3))

    assert 0.6 * MESSAGES < len([each for each in messages if each.topic != "hello"]) < 0.8 * MESSAGES
    assert any(each.topic == "hello" for each in messages)


def test_interrupted_link_publishes_its_will_and_reconnects() -> None:
    messages, _ = heard(Conditions(), cut=True)
    topics = [each.topic for each in messages]

    assert topics.index("last/will") > topics.index("topic/1")
    assert topics.count("hello") == 2
    assert b"unheard" not in {each.payload for each in messages}
