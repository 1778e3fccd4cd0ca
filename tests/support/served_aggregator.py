"""An aggregator with its MQTT link and HTTP server, in the event loop of the test."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Self

import httpx

from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.settings import settings_with
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from nena_status_aggregator.__main__ import serve
from nena_status_aggregator.extension import installed
from nena_status_aggregator.settings import AggregatorHttpSettings, AggregatorSettings, HistorySettings
from support.broker import Broker, MqttPeer, free_port
from support.fleet_examples import ROBOT
from support.waiting import PATIENCE, awaited

LOOK_EVERY = 0.02
"""Seconds."""


@dataclass
class Served:
    """A running aggregator as a client sees it."""

    http: httpx.AsyncClient
    robots: TopicScheme
    fleet: FleetTopics

    def send(
        self, peer: MqttPeer, topic: Topic, message: Header, *, robot: RobotKey = ROBOT, retain: bool = False
    ) -> None:
        """Publish a message of a robot."""
        peer.publish(self.robots.of(robot, topic), CODEC.encode(message), retain=retain)

    async def get(self, path: str) -> Any:
        return (await self.http.get(path)).json()

    async def until(self, path: str, accept: Callable[[Any], bool], *, seconds: float = PATIENCE) -> Any:
        """Request ``path`` until ``accept`` is true for the response."""
        return await awaited(lambda: self.get(path), accept, seconds=seconds, what=path, every=LOOK_EVERY)

    async def metric(self, line: str, *, seconds: float = PATIENCE) -> None:
        """Wait until ``/metrics`` contains this line."""

        async def text() -> str:
            return (await self.http.get("/metrics")).text

        await awaited(
            text, lambda shown: line in shown.splitlines(), seconds=seconds, what=line, every=LOOK_EVERY
        )


class EventReader:
    """Reads server-sent events one by one."""

    def __init__(self, response: httpx.Response) -> None:
        self._lines = response.aiter_lines()
        self.last_id = ""

    async def next(self, kind: str, accept: Callable[[Any], bool] = lambda _: True) -> Any:
        """Return the data of the next event of ``kind`` for which ``accept`` is true."""
        async with asyncio.timeout(PATIENCE):
            while True:
                event = await self._event()
                if event["event"] == kind and accept(data := json.loads(event["data"])):
                    return data

    async def _event(self) -> dict[str, str]:
        fields: dict[str, str] = {}
        async for line in self._lines:
            if not line:
                self.last_id = fields.get("id", self.last_id)
                return fields
            name, _, value = line.partition(": ")
            fields[name] = value
        message = "the stream has ended"
        raise AssertionError(message)

    @classmethod
    @asynccontextmanager
    async def open(cls, http: httpx.AsyncClient, *, last_id: str | None = None) -> AsyncIterator[Self]:
        headers = {"last-event-id": last_id} if last_id else {}
        async with http.stream("GET", "/api/v1/events", headers=headers) as response:
            assert response.headers["content-type"].startswith("text/event-stream")
            yield cls(response)


@asynccontextmanager
async def serving(broker: Broker, interface_name: str, **settings: Any) -> AsyncIterator[Served]:
    """Run an aggregator until the block ends."""
    port = free_port()
    chosen = settings_with(AggregatorSettings, installed())(
        mqtt=broker.settings,
        http=AggregatorHttpSettings(port=port),
        interface_name=interface_name,
        topic_prefix=f"{interface_name}/nena",
        **{"history": HistorySettings(url=None), **settings},
    )
    stop = asyncio.Event()
    running = asyncio.create_task(serve(chosen, stop), name="aggregator")
    transport = httpx.AsyncHTTPTransport(retries=8)
    url = f"http://127.0.0.1:{port}"
    async with httpx.AsyncClient(transport=transport, base_url=url, timeout=PATIENCE) as http:
        served = Served(http, TopicScheme(interface_name), FleetTopics(f"{interface_name}/nena"))
        await served.until("/api/v1/fleet", lambda fleet: fleet["link"]["connected"])
        yield served
        stop.set()
        await asyncio.wait_for(running, PATIENCE)
