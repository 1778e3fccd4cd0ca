"""Conversations from a broker and to one."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from pydantic import SecretStr

from nena_cli.vda5050.recording import Entry
from nena_cli.vda5050.said import SPEAKERS, Speaker
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.tasks import Supervisor
from nena_shared.vda5050.topics import Topic

CONNECT_WITHIN: Final = 10.0
"""Seconds."""
DRAIN_WITHIN: Final = 10.0
LONGEST_PAUSE: Final = 60.0
"""Seconds between two messages of a replay, at most: nobody waits a night for a robot that slept."""


class BrokerError(Exception):
    """The broker cannot be worked with; the text says why."""


@dataclass(frozen=True, slots=True)
class Place:
    """A broker, and which topics of it."""

    settings: MqttSettings
    topic_filters: tuple[str, ...]


def place(
    url: str,
    *,
    username: str | None = None,
    password_file: Path | None = None,
    filters: tuple[str, ...] = (),
) -> Place:
    """Read ``mqtt://[user[:password]@]host[:port][/topic filter]``.

    Raises:
        BrokerError: it is none.

    """
    parts = urlsplit(url)
    if parts.scheme != "mqtt" or not parts.hostname:
        message = f"'{url}' is no broker: write mqtt://host:port"
        raise BrokerError(message)
    inline = unquote(parts.path.lstrip("/") + ("#" if url.endswith("#") else ""))
    settings = MqttSettings(
        host=parts.hostname,
        port=parts.port or 1883,
        username=username or (unquote(parts.username) if parts.username else None),
        password=SecretStr(unquote(parts.password)) if parts.password else None,
        password_file=password_file,
    )
    return Place(settings, filters or ((inline,) if inline else ALL_ROBOTS))


ALL_ROBOTS: Final = tuple(f"+/+/+/+/{topic}" for topic in Topic)
"""The topics of every robot, under any interface name of one level."""


async def listen(where: Place, take: Callable[[Entry], None], *, stop: asyncio.Event, client_id: str) -> None:
    """Hand each message to ``take`` as it comes, until ``stop`` is set.

    Raises:
        BrokerError: the broker is not reached, or does not let us subscribe.

    """

    def hand_on(inbound: Inbound) -> None:
        take(Entry(datetime.now(UTC), inbound.topic, inbound.payload, 1, inbound.retained))

    async with _linked(where, client_id, hand_on):
        await stop.wait()


async def replay(
    entries: Iterable[Entry],
    where: Place,
    *,
    speed: float,
    speaker: Speaker | None,
    fresh: bool,
    client_id: str,
) -> int:
    """Publish what was recorded, in its order and with its pauses divided by ``speed``; gives how many.

    ``speaker`` leaves out what the others said; ``fresh`` puts the present time into the headers.

    Raises:
        BrokerError: the broker is not reached, or does not take the messages.

    """
    count = 0
    last: datetime | None = None
    async with _linked(where, client_id, None) as link:
        for entry in entries:
            if not _is_of(entry, speaker):
                continue
            if last is not None:
                pause = max(0.0, (entry.time - last).total_seconds() / speed)
                await asyncio.sleep(min(pause, LONGEST_PAUSE))
            last = entry.time
            retain = entry.topic.rsplit("/", 1)[-1] in (Topic.CONNECTION, Topic.FACTSHEET)
            payload = _fresh(entry.payload) if fresh else entry.payload
            link.publish(Outbound(entry.topic, payload, qos=max(entry.qos, 1), retain=retain))
            count += 1
        if not await link.drain(DRAIN_WITHIN):
            message = "the broker has not taken all messages"
            raise BrokerError(message)
    return count


@asynccontextmanager
async def _linked(
    where: Place, client_id: str, take: Callable[[Inbound], None] | None
) -> AsyncIterator[MqttLink]:
    link = MqttLink(where.settings, client_id=client_id)
    for topic_filter in where.topic_filters if take else ():
        link.subscribe(topic_filter, take or _nobody)
    async with Supervisor() as supervisor:
        supervisor.start("link", link.run())
        await _connected(link)
        yield link


async def _connected(link: MqttLink) -> None:
    try:
        async with asyncio.timeout(CONNECT_WITHIN):
            while not link.state.connected:  # noqa: ASYNC110 - the link has no event for it
                await asyncio.sleep(0.02)
    except TimeoutError:
        message = f"the broker is not reached: {link.state.last_error or 'it does not answer'}"
        raise BrokerError(message) from None
    if link.state.refused:
        message = f"the broker does not let us hear {', '.join(link.state.refused)}"
        raise BrokerError(message)


def _is_of(entry: Entry, speaker: Speaker | None) -> bool:
    last = entry.topic.rsplit("/", 1)[-1]
    return speaker is None or (last in set(Topic) and SPEAKERS[Topic(last)] is speaker)


def _fresh(payload: bytes) -> bytes:
    """Put the present time into a header; what is no message stays as it is."""
    try:
        content = json.loads(payload)
    except ValueError:
        return payload
    if not isinstance(content, dict) or "timestamp" not in content:
        return payload
    now = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return json.dumps(content | {"timestamp": now}).encode()


def _nobody(_: Inbound) -> None:
    """Take nothing."""
