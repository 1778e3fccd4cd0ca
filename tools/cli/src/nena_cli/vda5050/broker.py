"""Conversations from a broker and to one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from pydantic import SecretStr

from nena_cli.vda5050.recording import Entry
from nena_cli.vda5050.replay import FreshHeaders, is_kept, paced
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings, MqttTlsSettings
from nena_shared.tasks import Supervisor
from nena_shared.vda5050.topics import Topic

CONNECT_WITHIN: Final = 10.0
"""Seconds."""
DRAIN_WITHIN: Final = 10.0
"""Seconds."""
ANY_QOS: Final = 2
"""To subscribe with: each message then comes with the quality of service that its sender has chosen."""


class BrokerError(Exception):
    """The broker cannot be worked with; the text says why."""


@dataclass(frozen=True, slots=True)
class Place:
    """A broker, and which topics of it."""

    settings: MqttSettings
    topic_filters: tuple[str, ...]


def is_broker(source: str) -> bool:
    """Tell a broker's address from a file's name."""
    return source.startswith(("mqtt://", "mqtts://"))


def place(
    url: str,
    *,
    username: str | None = None,
    password_file: Path | None = None,
    tls: MqttTlsSettings | None = None,
    filters: tuple[str, ...] = (),
) -> Place:
    """Read ``mqtt[s]://[user[:password]@]host[:port][/topic filter]``; ``mqtts`` or ``tls`` encrypts.

    Raises:
        BrokerError: it is none.

    """
    try:
        parts = urlsplit(url)
        tls = (tls or MqttTlsSettings()).model_copy(update={"enabled": parts.scheme == "mqtts"})
        port = parts.port or (8883 if tls.wanted else 1883)
    except ValueError as error:
        message = f"'{url}' is no broker: {error}"
        raise BrokerError(message) from error
    if not is_broker(url) or not parts.hostname:
        message = f"'{url}' is no broker: write mqtt://host:port, or mqtts://host:port"
        raise BrokerError(message)
    inline = unquote(parts.path.lstrip("/") + ("#" if url.endswith("#") else ""))
    settings = MqttSettings(
        host=parts.hostname,
        port=port,
        username=username or (unquote(parts.username) if parts.username else None),
        password=SecretStr(unquote(parts.password)) if parts.password else None,
        password_file=password_file,
        tls=tls,
    )
    return Place(settings, filters or ((inline,) if inline else robot_filters()))


def robot_filters(interface_name: str = "+", robot: str = "+/+") -> tuple[str, ...]:
    """Give the filters for the topics of ``robot`` (``manufacturer/serialNumber``), by default of all."""
    return tuple(f"{interface_name}/+/{robot}/{topic}" for topic in Topic)


async def listen(where: Place, take: Callable[[Entry], None], *, stop: asyncio.Event, client_id: str) -> None:
    """Hand each message to ``take`` as it comes, until ``stop`` is set; what ``take`` raises ends it too.

    Raises:
        BrokerError: the broker is not reached, or does not let us subscribe.

    """
    failures: list[Exception] = []

    def hand_on(inbound: Inbound) -> None:
        if stop.is_set():
            return
        try:
            take(Entry(datetime.now(UTC), inbound.topic, inbound.payload, inbound.qos, inbound.retained))
        except Exception as error:  # noqa: BLE001 - the link would only log it and go on
            failures.append(error)
            stop.set()

    async with _linked(where, client_id, hand_on):
        await stop.wait()
    for failure in failures:
        raise failure


async def replay(
    entries: Iterable[Entry],
    where: Place,
    *,
    speed: float,
    fresh: bool,
    stop: asyncio.Event,
    client_id: str,
) -> int:
    """Publish messages in their order until ``stop``, and give how many.

    Their pauses are divided by ``speed``; ``fresh`` gives them new headers.

    Raises:
        BrokerError: the broker is not reached, or does not take the messages.

    """
    count = 0
    headers = FreshHeaders()
    async with _linked(where, client_id, None) as link:
        for pause, entry in paced(entries, speed):
            await _stopped_within(stop, pause)
            if stop.is_set():
                break
            said = headers.renewed(entry, datetime.now(UTC)) if fresh else entry
            link.publish(Outbound(said.topic, said.payload, qos=max(said.qos, 1), retain=is_kept(said.topic)))
            count += 1
        if not await link.drain(DRAIN_WITHIN):
            message = "the broker has not taken all messages"
            raise BrokerError(message)
    return count


async def _stopped_within(stop: asyncio.Event, seconds: float) -> None:
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            await stop.wait()


@asynccontextmanager
async def _linked(
    where: Place, client_id: str, take: Callable[[Inbound], None] | None
) -> AsyncIterator[MqttLink]:
    link = MqttLink(where.settings, client_id=client_id)
    if take:
        for topic_filter in where.topic_filters:
            link.subscribe(topic_filter, take, qos=ANY_QOS)
    async with Supervisor() as supervisor:
        supervisor.start("link", link.run())
        await _connected(link)
        yield link


async def _connected(link: MqttLink) -> None:
    """Wait for the first connection; a service would try again, a person wants to know."""
    with suppress(TimeoutError):
        async with asyncio.timeout(CONNECT_WITHIN):
            while not (link.state.connected or link.state.last_error):  # noqa: ASYNC110 - it has no event
                await asyncio.sleep(0.02)
    if not link.state.connected:
        message = f"the broker is not reached: {link.state.last_error or 'it does not answer'}"
        raise BrokerError(message)
    if link.state.refused:
        message = f"the broker does not let us hear {', '.join(link.state.refused)}"
        raise BrokerError(message)
