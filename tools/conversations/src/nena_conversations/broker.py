"""Listen to a conversation at a broker, and replay a recording to one."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from paho.mqtt.client import topic_matches_sub
from pydantic import SecretStr
from pydantic_core import from_json, to_json

from nena_conversations.message import Sender, sender_of
from nena_conversations.recording import Entry
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings, MqttTlsSettings
from nena_shared.tasks import Supervisor, set_within
from nena_shared.vda5050.topics import Topic

CONNECT_WITHIN: Final = 10.0
"""Timeout for connecting, seconds."""
DRAIN_WITHIN: Final = 10.0
"""Timeout for the broker to accept all messages, seconds."""
ANY_QOS: Final = 2
"""Subscription QoS: each message arrives with the QoS its sender chose."""
MAX_PAUSE: Final = 60.0
"""Maximum pause between two replayed messages, seconds."""
# MQTT sets the flag only for messages that were stored when the subscription began.
RETAINED: Final = (Topic.CONNECTION, Topic.FACTSHEET)
"""Topics that robots publish retained. A live recording does not show the retain flag."""


class BrokerError(Exception):
    """The broker is unreachable or rejects a request, for the reason in the message."""


@dataclass(frozen=True, slots=True)
class BrokerAddress:
    """A broker and topic filters."""

    settings: MqttSettings
    topic_filters: tuple[str, ...]


def is_broker(source: str) -> bool:
    """Return whether ``source`` is a broker URL, not a file name."""
    return source.startswith(("mqtt://", "mqtts://"))


def parse_address(
    url: str,
    *,
    username: str | None = None,
    password_file: Path | None = None,
    tls: MqttTlsSettings | None = None,
    filters: tuple[str, ...] = (),
) -> BrokerAddress:
    """Parse ``mqtt[s]://[user[:password]@]host[:port][/topic filter]``; ``mqtts`` or ``tls`` enables TLS.

    Raises:
        BrokerError: the URL is invalid.
    """
    try:
        parts = urlsplit(url)
        tls = (tls or MqttTlsSettings()).model_copy(update={"enabled": parts.scheme == "mqtts"})
        port = parts.port or (8883 if tls.wanted else 1883)
    except ValueError as error:
        raise BrokerError(f"Invalid broker URL '{url}': {error}") from error
    if not is_broker(url) or not parts.hostname:
        raise BrokerError(f"Invalid broker URL '{url}': use mqtt://host:port or mqtts://host:port")
    inline = unquote(parts.path.lstrip("/") + ("#" if url.endswith("#") else ""))
    settings = MqttSettings(
        host=parts.hostname,
        port=port,
        username=username or (unquote(parts.username) if parts.username else None),
        password=SecretStr(unquote(parts.password)) if parts.password else None,
        password_file=password_file,
        tls=tls,
    )
    return BrokerAddress(settings, filters or ((inline,) if inline else robot_filters()))


def robot_filters(interface_name: str = "+", robot: str = "+/+") -> tuple[str, ...]:
    """Return topic filters for ``robot`` (``manufacturer/serialNumber``), by default for all robots."""
    return tuple(f"{interface_name}/+/{robot}/{topic}" for topic in Topic)


async def listen(
    address: BrokerAddress, handle: Callable[[Entry], None], *, stop: asyncio.Event, client_id: str
) -> None:
    """Call ``handle`` for each message until ``stop`` is set or ``handle`` raises.

    Raises:
        BrokerError: the broker is unreachable or rejects the subscription.
    """
    failures: list[Exception] = []

    def on_message(inbound: Inbound) -> None:
        if stop.is_set():
            return
        try:
            handle(Entry(datetime.now(UTC), inbound.topic, inbound.payload, inbound.qos, inbound.retained))
        except Exception as error:  # noqa: BLE001 - the link would only log it
            failures.append(error)
            stop.set()

    async with connect_broker(address, client_id, on_message):
        await stop.wait()
    for failure in failures:
        raise failure


@dataclass(frozen=True, slots=True)
class EntryFilter:
    """Select messages by sender and topic; empty: all of them."""

    sender: Sender | None = None
    topic_filters: tuple[str, ...] = ()

    def matches(self, entry: Entry) -> bool:
        """Return whether a message is selected."""
        if self.sender and sender_of(entry.topic) is not self.sender:
            return False
        return not self.topic_filters or any(
            topic_matches_sub(each, entry.topic) for each in self.topic_filters
        )


def paced(entries: Iterable[Entry], speed: float) -> Iterator[tuple[float, Entry]]:
    """Yield each message with the pause before it, seconds: that of the recording divided by ``speed``."""
    last: datetime | None = None
    for entry in entries:
        pause = (entry.time - last).total_seconds() / speed if last else 0.0
        last = entry.time
        yield min(max(pause, 0.0), MAX_PAUSE), entry


def is_retained(topic: str) -> bool:
    """Return whether messages of this topic are published retained."""
    return topic.rsplit("/", 1)[-1] in RETAINED


class FreshHeaders:
    """Replace headers: headerId counts from 0 on each topic, timestamp is the current time."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()

    def apply(self, entry: Entry, now: datetime) -> Entry:
        """Return the message with a new header; unchanged if it has no header."""
        try:
            content = from_json(entry.payload)
        except ValueError:
            return entry
        if not isinstance(content, dict) or "headerId" not in content:
            return entry
        timestamp = now.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        header = {"headerId": self._counts[entry.topic], "timestamp": timestamp}
        self._counts[entry.topic] += 1
        return replace(entry, payload=to_json(content | header))


async def replay(
    entries: Iterable[Entry],
    address: BrokerAddress,
    *,
    speed: float,
    fresh: bool,
    stop: asyncio.Event,
    client_id: str,
) -> int:
    """Publish messages in their order until ``stop``, and return their number.

    Pauses are divided by ``speed``; ``fresh`` replaces headers.

    Raises:
        BrokerError: the broker is unreachable or does not accept the messages in time.
    """
    count = 0
    headers = FreshHeaders()
    async with connect_broker(address, client_id) as link:
        for pause, entry in paced(entries, speed):
            await set_within(stop, pause)
            if stop.is_set():
                break
            sent = headers.apply(entry, datetime.now(UTC)) if fresh else entry
            link.publish(
                Outbound(sent.topic, sent.payload, qos=max(sent.qos, 1), retain=is_retained(sent.topic))
            )
            count += 1
        if not await link.drain(DRAIN_WITHIN):
            raise BrokerError(f"the broker did not accept all messages within {DRAIN_WITHIN:.0f} s")
    return count


@asynccontextmanager
async def connect_broker(
    address: BrokerAddress, client_id: str, handle: Callable[[Inbound], None] | None = None
) -> AsyncIterator[MqttLink]:
    """Connect to a broker; ``handle`` gets the messages of the address's topic filters.

    Raises:
        BrokerError: the broker is unreachable or rejects the subscription.
    """
    link = MqttLink(address.settings, client_id=client_id)
    if handle:
        for topic_filter in address.topic_filters:
            link.subscribe(topic_filter, handle, qos=ANY_QOS)
    async with Supervisor() as supervisor:
        supervisor.start("link", link.run())
        await _wait_for_connection(link)
        yield link


async def _wait_for_connection(link: MqttLink) -> None:
    """Wait for the first connection, without retries: a person waits for the result."""
    with suppress(TimeoutError):
        async with asyncio.timeout(CONNECT_WITHIN):
            while not (link.state.connected or link.state.last_error):  # noqa: ASYNC110 - it has no event
                await asyncio.sleep(0.02)
    if not link.state.connected:
        raise BrokerError(f"Cannot connect to the broker: {link.state.last_error or 'no answer'}")
    if link.state.refused:
        raise BrokerError(f"The broker refused the subscription to {', '.join(link.state.refused)}")
