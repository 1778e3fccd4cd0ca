"""The MQTT link over a real broker that is killed, restarted, frozen and thawed."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, closing, suppress
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import pytest
import uvloop
from pydantic import SecretStr
from structlog.testing import capture_logs

from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.mqtt import link as link_module
from nena_shared.settings import ConfigurationError, MqttSettings
from support.broker import Broker, MqttPeer, free_port
from support.pausing import turn_passes
from support.waiting import PATIENCE, until, wait_until

pytestmark = pytest.mark.broker


@asynccontextmanager
async def running(link: MqttLink, *, connected: bool = True) -> AsyncIterator[asyncio.Task[None]]:
    """Run ``link`` for the time of the block, by default from the moment it is connected."""
    task = asyncio.create_task(link.run())
    try:
        if connected:
            await until(lambda: link.state.connected, what="the link's connection")
        yield task
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


def numbered(topic: str, numbers: range, **options: Any) -> list[Outbound]:
    return [Outbound(topic, str(number).encode(), **options) for number in numbers]


def numbers(payloads: list[bytes]) -> list[int]:
    return [int(payload) for payload in payloads]


async def test_publishes_in_order(broker: Broker, interface_name: str) -> None:
    link = MqttLink(broker.settings, client_id=interface_name)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        async with running(link):
            for message in numbered(f"{interface_name}/a", range(1000)):
                link.publish(message)
            assert await link.drain(PATIENCE)
        await until(lambda: len(peer.payloads()) >= 1000)

        assert numbers(peer.payloads()) == list(range(1000))
    assert (link.state.published, link.state.dropped) == (1000, 0)


async def test_receives_by_topic(broker: Broker, interface_name: str) -> None:
    one: list[Inbound] = []
    every: list[Inbound] = []
    link = MqttLink(broker.settings, client_id=interface_name)
    link.subscribe(f"{interface_name}/+/state", one.append)
    link.subscribe(f"{interface_name}/other", every.append)
    with MqttPeer(broker) as peer:
        peer.publish(f"{interface_name}/r1/state", b"kept", retain=True)
        async with running(link):
            peer.publish(f"{interface_name}/r2/state", b"\x00fresh")
            peer.publish(f"{interface_name}/r2/order", b"for somebody else")
            peer.publish(f"{interface_name}/other", b"last")
            await until(lambda: every)

    assert one == [
        Inbound(f"{interface_name}/r1/state", b"kept", retained=True),
        Inbound(f"{interface_name}/r2/state", b"\x00fresh", retained=False),
    ]
    assert link.state.received == 3


async def test_subscribes_while_connected(broker: Broker, interface_name: str) -> None:
    heard: list[bytes] = []
    link = MqttLink(broker.settings, client_id=interface_name)
    with MqttPeer(broker) as peer:
        peer.publish(f"{interface_name}/c", b"kept", retain=True)
        async with running(link):
            for level in "abc":
                link.subscribe(f"{interface_name}/{level}", lambda each: heard.append(each.payload))
            await until(lambda: heard == [b"kept"], what="the last subscription")
            peer.publish(f"{interface_name}/a", b"fresh")
            await until(lambda: heard == [b"kept", b"fresh"])
            link.cut(0.0)
            await until(lambda: heard == [b"kept", b"fresh", b"kept"], what="what is kept, after the break")
        peer.publish(f"{interface_name}/c", b"", retain=True)


@pytest.mark.provokes_failures
async def test_failing_handler_does_not_end_the_link(broker: Broker, interface_name: str) -> None:
    seen: list[bytes] = []

    def handler(message: Inbound) -> None:
        seen.append(message.payload)
        if message.payload == b"bad":
            raise RuntimeError(message.payload)

    link = MqttLink(broker.settings, client_id=interface_name)
    link.subscribe(interface_name, handler)
    with MqttPeer(broker) as peer, capture_logs() as logs:
        async with running(link):
            peer.publish(interface_name, b"bad")
            peer.publish(interface_name, b"good")
            await until(lambda: seen[-1:] == [b"good"])

    assert link.state.handler_failures == 1
    assert [line["topic"] for line in logs if line["log_level"] == "error"] == [interface_name]


async def test_unsendable_message_does_not_affect_others(broker: Broker, interface_name: str) -> None:
    link = MqttLink(broker.settings, client_id=interface_name)
    with MqttPeer(broker, f"{interface_name}/#") as peer, capture_logs() as logs:
        async with running(link):
            link.publish(Outbound(f"{interface_name}/+", b"a wildcard is no topic"))
            link.publish(Outbound(f"{interface_name}/a", b"fine"))
            await peer.wait_for(f"{interface_name}/a")
            assert await link.drain(PATIENCE)

    assert (link.state.published, link.state.dropped) == (1, 1)
    assert [line["topic"] for line in logs if line["log_level"] == "error"] == [f"{interface_name}/+"]


@pytest.mark.clause("4.1/will")
async def test_will_is_published_when_the_connection_breaks(broker: Broker, interface_name: str) -> None:
    topic = f"{interface_name}/connection"
    link = MqttLink(
        broker.settings,
        client_id=interface_name,
        hooks=LinkHooks(will=lambda: Outbound(topic, b"broken", retain=True)),
    )
    with MqttPeer(broker, topic) as peer:
        async with running(link):
            open_socket(link).shutdown(socket.SHUT_RDWR)
            assert (await peer.wait_for(topic)).payload == b"broken"


async def test_cut_link_publishes_its_will_and_stays_disconnected_for_the_given_time(
    broker: Broker, interface_name: str
) -> None:
    topic = f"{interface_name}/connection"
    link = MqttLink(
        broker.settings, client_id=interface_name, hooks=LinkHooks(will=lambda: Outbound(topic, b"broken"))
    )
    with MqttPeer(broker, topic) as peer:
        async with running(link):
            begin = perf_counter()
            link.cut(0.4)
            assert (await peer.wait_for(topic)).payload == b"broken"

            await until(lambda: link.state.connects >= 2)
            assert perf_counter() - begin >= 0.4


@pytest.mark.clause("4.1/will")
async def test_will_is_not_published_after_a_clean_disconnect(broker: Broker, interface_name: str) -> None:
    topic = f"{interface_name}/connection"
    link = MqttLink(
        broker.settings, client_id=interface_name, hooks=LinkHooks(will=lambda: Outbound(topic, b"broken"))
    )
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        async with running(link):
            pass
        peer.publish(f"{interface_name}/after", b"")
        await peer.wait_for(f"{interface_name}/after")

        assert peer.payloads(topic) == []


@pytest.mark.clause("4.1")
async def test_reconnects_after_the_broker_was_killed(own_broker: Broker) -> None:
    seen: list[bytes] = []
    greetings = iter(range(10))
    lost: list[bool] = []
    link = MqttLink(
        own_broker.settings,
        client_id="link",
        hooks=LinkHooks(
            on_connected=lambda: [Outbound("greeting", str(next(greetings)).encode(), retain=True)],
            on_lost=lambda: lost.append(True),
        ),
    )
    link.subscribe("orders", lambda message: seen.append(message.payload))
    async with running(link):
        own_broker.kill()
        await until(lambda: not link.state.connected)
        assert lost == [True]
        own_broker.restart()
        await until(lambda: link.state.connects >= 2)
        with MqttPeer(own_broker, "greeting") as peer:
            peer.publish("orders", b"go on")
            await until(lambda: seen)

            assert (await peer.wait_for("greeting")).payload == b"1"
    assert seen == [b"go on"]


async def test_greeting_is_sent_before_queued_messages(own_broker: Broker) -> None:
    link = MqttLink(
        own_broker.settings,
        client_id="link",
        hooks=LinkHooks(on_connected=lambda: [Outbound("all/greeting", b"")]),
    )
    for message in numbered("all/waiting", range(5)):
        link.publish(message)
    with MqttPeer(own_broker, "all/#") as peer:
        async with running(link):
            await until(lambda: len(peer.received()) == 6)

        assert peer.received()[0].topic == "all/greeting"
        assert numbers(peer.payloads("all/waiting")) == list(range(5))


async def test_greeting_of_a_lost_connection_is_never_sent_later(own_broker: Broker) -> None:
    greetings = iter(range(10))
    link = MqttLink(
        own_broker.settings.model_copy(update={"keep_alive": 2}),
        client_id="link",
        hooks=LinkHooks(on_connected=lambda: [Outbound("greeting", str(next(greetings)).encode())]),
    )
    with MqttPeer(own_broker, "greeting") as peer:
        async with running(link):
            await peer.wait_for("greeting", lambda each: each.payload == b"0")
            own_broker.freeze()
            open_socket(link).shutdown(socket.SHUT_RDWR)
            await until(lambda: not link.state.connected)
            own_broker.thaw()
            await until(lambda: link.state.connects >= 2)
            link.publish(Outbound("greeting", b"99"))
            await peer.wait_for("greeting", lambda each: each.payload == b"99")

        assert numbers(peer.payloads()) == sorted(numbers(peer.payloads()))


@pytest.mark.parametrize("burst", [1, 50, 450])
async def test_outbox_keeps_its_order_over_reconnects(own_broker: Broker, burst: int) -> None:
    """Messages may come twice over a break (QoS 1), but none is lost and none overtakes another for good."""
    link = MqttLink(own_broker.settings.model_copy(update={"outgoing_limit": 5000}), client_id="link")
    total, sent = 6 * burst, iter(range(6 * burst))
    with MqttPeer(own_broker, "numbers") as peer:
        async with running(link):
            for _ in range(3):
                publish_next(link, sent, burst)
                open_socket(link).shutdown(socket.SHUT_RDWR)
                publish_next(link, sent, burst)
                connects = link.state.connects
                await until(lambda connects=connects: link.state.connects > connects)  # type: ignore[misc]
            await until(lambda: total - 1 in numbers(peer.payloads()))
            assert await link.drain(PATIENCE)
        received = numbers(peer.payloads())

    assert sorted(set(received)) == list(range(total))
    steps_back = [after for before, after in pairwise(received) if after <= before]
    assert len(steps_back) <= 3, "each break sends again from one place on, at most"
    assert first_times(received) == list(range(total))


def publish_next(link: MqttLink, numbers_to_send: Any, count: int) -> None:
    for _ in range(count):
        link.publish(Outbound("numbers", str(next(numbers_to_send)).encode()))


def first_times(values: list[int]) -> list[int]:
    return list(dict.fromkeys(values))


async def test_outbox_drops_the_oldest_when_it_is_full(own_broker: Broker) -> None:
    link = MqttLink(own_broker.settings.model_copy(update={"outgoing_limit": 10}), client_id="link")
    for message in numbered("numbers", range(25)):
        link.publish(message)
    assert link.state.dropped == 15
    with MqttPeer(own_broker, "numbers") as peer:
        async with running(link):
            await until(lambda: len(peer.payloads()) == 10)

        assert numbers(peer.payloads()) == list(range(15, 25))


async def test_burst_of_statuses_leaves_the_last_one_of_each_topic_at_the_broker(
    own_broker: Broker,
) -> None:
    """More than fit in flight and into the queue, as when a whole fleet changes at once."""
    topics = [f"vehicles/{number}/status" for number in range(2500)]
    link = MqttLink(own_broker.settings, client_id="link")
    async with running(link):
        for value in (b"before", b"after"):
            for topic in topics:
                link.publish(Outbound(topic, value, retain=True))
        assert await link.drain(PATIENCE)
    with MqttPeer(own_broker, "vehicles/#") as peer:
        await until(lambda: len(peer.received()) >= len(topics))

        assert {each.topic: each.payload for each in peer.received()} == dict.fromkeys(topics, b"after")
    assert link.state.dropped == 0


async def test_messages_that_have_arrived_can_be_read_before_a_timeout_is_concluded(
    broker: Broker, interface_name: str
) -> None:
    topic, last = f"{interface_name}/a", f"{interface_name}/last"
    got: list[Inbound] = []
    link = MqttLink(broker.settings, client_id=interface_name)
    link.subscribe(topic, got.append)
    with MqttPeer(broker, last) as peer:
        async with running(link):
            for message in numbered(topic, range(16)):  # the event loop stands still meanwhile
                peer.send(topic, message.payload)
            peer.publish(last, b"")
            wait_until(lambda: bool(peer.payloads()), what="the broker has sent the others, too")
            assert not got
            await link.read_waiting(PATIENCE)
            assert numbers([each.payload for each in got]) == list(range(16))


def test_long_and_short_messages_pass_on_uvloop(broker: Broker, interface_name: str) -> None:
    """Order service and aggregator run on it."""
    payloads = [b"first", bytes(8_000_000), b"last"]

    async def exchange() -> list[bytes]:
        seen: list[bytes] = []
        link = MqttLink(broker.settings, client_id=interface_name)
        link.subscribe(interface_name, lambda message: seen.append(message.payload))
        async with running(link):
            for payload in payloads:
                link.publish(Outbound(interface_name, payload))
            await until(lambda: len(seen) == len(payloads))
            assert await link.drain(PATIENCE)
        return seen

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        assert runner.run(exchange()) == payloads


async def test_dropped_messages_are_counted_and_logged_once_a_minute(own_broker: Broker) -> None:
    link = MqttLink(own_broker.settings.model_copy(update={"outgoing_limit": 10}), client_id="link")
    with capture_logs() as logs:
        for message in numbered("numbers", range(25)):
            link.publish(message)

    assert link.state.dropped == 15
    assert [(line["dropped"], line["topic"]) for line in logs] == [(1, "numbers")]


async def test_requeueing_respects_the_limit(own_broker: Broker) -> None:
    link = MqttLink(own_broker.settings.model_copy(update={"outgoing_limit": 10}), client_id="link")
    with MqttPeer(own_broker, "numbers") as peer:
        async with running(link):
            own_broker.freeze()
            for message in numbered("numbers", range(40)):
                link.publish(message)
            open_socket(link).shutdown(socket.SHUT_RDWR)
            await until(lambda: not link.state.connected)
            assert link.state.dropped == 30
            own_broker.thaw()
            await peer.wait_for("numbers", lambda each: each.payload == b"39")


async def test_volatile_messages_are_dropped_when_the_connection_breaks(own_broker: Broker) -> None:
    link = MqttLink(own_broker.settings, client_id="link")
    link.publish(Outbound("numbers", b"0", keep=False))
    with MqttPeer(own_broker, "numbers") as peer:
        async with running(link):
            own_broker.freeze()
            for message in numbered("numbers", range(1, 400), keep=False):
                link.publish(message)
            own_broker.kill()
            await until(lambda: not link.state.connected)
            own_broker.restart()
            await until(lambda: link.state.connects >= 2)
            assert link.state.dropped == 400
            with MqttPeer(own_broker, "numbers") as later:
                link.publish(Outbound("numbers", b"400"))
                await later.wait_for("numbers")

                assert later.payloads() == [b"400"]
        assert peer.payloads() == []


class Terms:
    """A right to publish that a test grants and revokes."""

    def __init__(self) -> None:
        self.term: int | None = None

    def __call__(self) -> int | None:
        return self.term


async def test_nothing_is_published_outside_of_a_term(broker: Broker, interface_name: str) -> None:
    terms = Terms()
    link = MqttLink(broker.settings, client_id=interface_name, term=terms)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        async with running(link, connected=False):
            link.publish(Outbound(f"{interface_name}/early", b"", retain=True))
            assert not await link.drain(0.3)
            assert link.state.connects == 0
            terms.term = 1
            await until(lambda: link.state.connected)
            link.publish(Outbound(f"{interface_name}/first", b""))
            await peer.wait_for(f"{interface_name}/first")
            terms.term = None
            link.publish(Outbound(f"{interface_name}/late", b""))
            await until(lambda: not link.state.connected, what="the connection ends with the term")
            terms.term = 2
            await until(lambda: link.state.connects == 2)
            link.publish(Outbound(f"{interface_name}/second", b""))
            await peer.wait_for(f"{interface_name}/second")

            assert [each.topic for each in peer.received()] == [
                f"{interface_name}/first",
                f"{interface_name}/second",
            ]
    assert link.state.term == 2


async def test_queued_messages_are_never_written_after_the_term(own_broker: Broker) -> None:
    """Fill the outgoing queue, the messages in flight, and a socket that accepts no more."""
    terms = Terms()
    terms.term = 1
    link = MqttLink(own_broker.settings, client_id="link", term=terms)
    with MqttPeer(own_broker, "numbers") as peer:
        async with running(link):
            own_broker.freeze()
            for message in numbered("numbers", range(500), retain=True):
                link.publish(message)
                link.publish(Outbound("filling", bytes(100_000)))
            terms.term = 2
            own_broker.thaw()
            await until(lambda: link.state.connects >= 2)
            link.publish(Outbound("numbers", b"1000"))
            await peer.wait_for("numbers", lambda each: each.payload == b"1000")
        received = numbers(peer.payloads())

    assert received == [*range(len(received) - 1), 1000], "what the socket took before the end of the term"
    assert len(received) < 250


async def test_frozen_broker_is_detected_by_keep_alive(own_broker: Broker) -> None:
    link = MqttLink(own_broker.settings.model_copy(update={"keep_alive": 2}), client_id="link")
    async with running(link):
        own_broker.freeze()
        await until(lambda: not link.state.connected, what="the loss of a frozen broker")
        own_broker.thaw()
        await until(lambda: link.state.connects >= 2)


async def test_connections_to_a_frozen_broker_do_not_pile_up(
    own_broker: Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link_module, "CONNECT_TIMEOUT", 0.05)
    link = MqttLink(
        own_broker.settings, client_id="link", hooks=LinkHooks(will=lambda: Outbound("will", b"broken"))
    )
    own_broker.freeze()
    before = open_files()
    tries = count_calls(link, "_make_client", monkeypatch)
    async with running(link, connected=False):
        await until(lambda: tries() > 20)
        assert open_files() <= before + 10
        monkeypatch.setattr(link_module, "CONNECT_TIMEOUT", 10)
        own_broker.thaw()
        await until(lambda: link.state.connected)


async def test_missing_broker_is_logged_once(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = MqttSettings(port=free_port(), reconnect_min=0.01, reconnect_max=0.01)
    with capture_logs() as logs:
        link = MqttLink(settings, client_id="link")
        tries = count_calls(link, "_make_client", monkeypatch)
        async with running(link, connected=False):
            await until(lambda: tries() > 5)

    assert [line["log_level"] for line in logs] == ["warning"]
    assert "refused" in logs[0]["reason"].lower()
    assert logs[0]["port"] == settings.port
    assert link.state.last_error == logs[0]["reason"]


async def test_two_programs_with_one_client_id_disconnect_each_other_less_and_less_often(
    broker: Broker, interface_name: str
) -> None:
    settings = broker.settings.model_copy(update={"reconnect_max": 1.0})
    links = [MqttLink(settings, client_id=interface_name) for _ in range(2)]
    with capture_logs() as logs:
        async with running(links[0], connected=False), running(links[1], connected=False):
            await until(lambda: len(duplicate_id_warnings(logs)) == len(links), what="both say so")
            before = sum(each.state.connects for each in links)
            start = perf_counter()
            await until(lambda: sum(each.state.connects for each in links) >= before + 6)

            assert perf_counter() - start > 1.0
            assert len(duplicate_id_warnings(logs)) == len(links)
    assert {each["client_id"] for each in duplicate_id_warnings(logs)} == {interface_name}


def duplicate_id_warnings(logs: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return [each for each in logs if "another program uses this client ID" in each["event"]]


async def test_wrong_password_is_logged_once_in_plain_words(
    locked_broker: Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = locked_broker.settings.model_copy(update={"username": "robot", "password": SecretStr("guess")})
    with capture_logs() as logs:
        link = MqttLink(wrong, client_id="link")
        tries = count_calls(link, "_make_client", monkeypatch)
        async with running(link, connected=False):
            await until(lambda: tries() > 3)

    assert [line["log_level"] for line in logs] == ["warning"]
    assert "not authori" in logs[0]["reason"].lower()
    assert "guess" not in str(logs)


async def test_password_is_read_from_a_file(locked_broker: Broker, tmp_path: Path) -> None:
    file = tmp_path / "password"
    file.write_text("open sesame\n")
    settings = locked_broker.settings.model_copy(update={"username": "robot", "password_file": file})
    link = MqttLink(settings, client_id="link")
    async with running(link):
        assert link.state.last_error == ""

        file.unlink()
        open_socket(link).shutdown(socket.SHUT_RDWR)
        await until(lambda: "password" in link.state.last_error)
        file.write_text("open sesame\n")
        await until(lambda: link.state.connects >= 2)


def test_missing_password_file_is_reported_at_startup(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"mqtt\.password_file: "):
        MqttLink(MqttSettings(password_file=tmp_path / "none"), client_id="link")


async def test_refused_subscription_is_reported(broker_without_subscriptions: Broker) -> None:
    link = MqttLink(broker_without_subscriptions.settings, client_id="link")
    link.subscribe("secret/#", lambda _: None)
    with capture_logs() as logs:
        async with running(link):
            pass

    assert [line["topic"] for line in logs if line["log_level"] == "error"] == ["secret/#"]


async def test_a_message_that_the_broker_may_have_refused_for_its_length_is_named() -> None:
    with closing(Broker(more="max_packet_size 1500000")) as broker:
        link = MqttLink(broker.settings, client_id="link")
        async with running(link):
            link.publish(Outbound("a/plant", bytes(2_000_000), retain=True))
            await until(lambda: bool(link.state.last_error), what="the connection ends")
    assert "the broker may refuse a message of 2.0 MB on a/plant: check its limit" in link.state.last_error


async def test_drain_reports_what_is_left(own_broker: Broker) -> None:
    link = MqttLink(own_broker.settings, client_id="link")
    assert not await link.drain(0.01)
    async with running(link):
        assert await link.drain(0.01)
        own_broker.freeze()
        link.publish(Outbound("a", b""))
        assert not await link.drain(0.05)
        own_broker.thaw()
        assert await link.drain(PATIENCE)


async def test_farewell_can_directly_follow_the_greeting(broker: Broker, interface_name: str) -> None:
    """The subscriptions are not answered yet then."""
    topic, greeted = f"{interface_name}/connection", asyncio.Event()

    def greeting() -> Iterator[Outbound]:
        yield Outbound(topic, b"here", retain=True)
        assert not link.state.connected
        link.publish(Outbound(topic, b"gone", retain=True))
        greeted.set()

    link = MqttLink(broker.settings, client_id=interface_name, hooks=LinkHooks(on_connected=greeting))
    link.subscribe(f"{interface_name}/order", lambda _: None)
    with MqttPeer(broker, topic) as peer:
        async with running(link, connected=False):
            await asyncio.wait_for(greeted.wait(), PATIENCE)
            assert await link.drain(PATIENCE)
        await until(lambda: peer.payloads() == [b"here", b"gone"])


async def test_long_greeting_does_not_delay_other_messages(broker: Broker, interface_name: str) -> None:
    made: list[int] = [0]

    def greeting() -> Iterator[Outbound]:
        for number in range(1000):
            made[-1] += 1
            yield Outbound(f"{interface_name}/status/{number}", b"here", retain=True)

    async def count() -> None:
        while True:
            made.append(0)
            await turn_passes()

    counting = asyncio.create_task(count())
    link = MqttLink(broker.settings, client_id=interface_name, hooks=LinkHooks(on_connected=greeting))
    with MqttPeer(broker, f"{interface_name}/status/+") as peer:
        async with running(link):
            await until(lambda: len(peer.payloads()) == 1000)
    counting.cancel()
    assert max(made) <= link_module.IN_FLIGHT_LIMIT


async def test_link_can_be_ended_before_its_subscriptions_are_acknowledged(
    broker: Broker, interface_name: str
) -> None:
    greeted = asyncio.Event()

    def greeting() -> Iterator[Outbound]:
        greeted.set()
        yield Outbound(f"{interface_name}/connection", b"here")

    link = MqttLink(broker.settings, client_id=interface_name, hooks=LinkHooks(on_connected=greeting))
    link.subscribe(f"{interface_name}/order", lambda _: None)
    task = asyncio.create_task(link.run())
    await asyncio.wait_for(greeted.wait(), PATIENCE)
    task.cancel()
    await asyncio.wait({task}, timeout=PATIENCE)
    assert task.cancelled()


async def test_small_messages_do_not_wait_for_each_other(broker: Broker, interface_name: str) -> None:
    """Measure without TCP_NODELAY at both ends: a round trip of steady messages takes up to 44 ms.

    Only the fastest quarter counts: other work on the machine may delay the rest.
    """
    back: asyncio.Queue[bytes] = asyncio.Queue()
    link = MqttLink(broker.settings, client_id=interface_name)
    link.subscribe(f"{interface_name}/ping", lambda _: link.publish(Outbound(f"{interface_name}/pong", b"")))
    link.subscribe(f"{interface_name}/pong", lambda message: back.put_nowait(message.payload))
    async with running(link):
        assert open_socket(link).getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        seconds = []
        for _ in range(200):
            start = perf_counter()
            link.publish(Outbound(f"{interface_name}/ping", b""))
            await asyncio.wait_for(back.get(), PATIENCE)
            seconds.append(perf_counter() - start)

    assert sorted(seconds)[50] < 0.02


async def test_burst_within_the_limit_arrives_completely(broker: Broker, interface_name: str) -> None:
    seen: list[int] = []
    link = MqttLink(broker.settings, client_id=interface_name)
    link.subscribe(interface_name, lambda message: seen.append(int(message.payload)))
    sender = MqttLink(
        broker.settings.model_copy(update={"outgoing_limit": 5000}), client_id=f"{interface_name}-2"
    )
    async with running(link), running(sender):
        for message in numbered(interface_name, range(5000)):
            sender.publish(message)
        await until(lambda: len(seen) >= 5000)

    assert seen == list(range(5000))


def open_socket(link: MqttLink) -> socket.socket:
    """Return the TCP socket under a connected link, to break it or to check its options."""
    assert link._session is not None
    found = link._session.client.socket
    assert found is not None
    return found


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def count_calls(target: object, method: str, monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """Count the calls of a method, which does its work as before."""
    original, calls = getattr(target, method), []

    def counted() -> Any:
        calls.append(method)
        return original()

    monkeypatch.setattr(target, method, counted)
    return lambda: len(calls)


@pytest.fixture
def locked_broker() -> Iterator[Broker]:
    broker = Broker(users={"robot": "open sesame"})
    yield broker
    broker.close()


@pytest.fixture
def broker_without_subscriptions(tmp_path: Path) -> Iterator[Broker]:
    plugins = [*Path("/usr/lib").glob("**/mosquitto_dynamic_security.so")]
    if not plugins:
        pytest.skip("this Mosquitto has no plug-in that can refuse a subscription")
    rules = tmp_path / "rules.json"
    rules.write_text('{"defaultACLAccess": {"subscribe": false}}')
    broker = Broker(more=f"plugin {plugins[0]}\nplugin_opt_config_file {rules}\n")
    yield broker
    broker.close()


async def test_unknown_host_is_logged_and_retried() -> None:
    link = MqttLink(MqttSettings(host="a" * 80, reconnect_min=0.01), client_id="x")
    async with running(link, connected=False) as task:
        await until(lambda: "label" in link.state.last_error, what="the reason")
        assert not task.done()
