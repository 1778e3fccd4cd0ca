"""An attacker on the site's network: on every topic, over every route, and with old messages."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import cycle
from random import Random

import httpx

from faults.site import Site
from nena_conversations.recording import read_file
from nena_order_service.api.asyncapi import channels
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.vda5050.topics import RobotKey, Topic
from support.conversations import FOLDER
from support.damage import VALUES, damaged

FLEET = FleetTopics()
INTERFACES = ("uagv/v2", "vda5050/v3", "uagv/v3", "uagv/v9")
"""Of robots of 2.x and 3.x, as services know them by default, and two that nobody listens to."""
STRANGERS = ("NobodyElse/x-1", "NeNa/unknown", "Ne Na/ü", "a/b")
NAMES = ("Nobody", "%00", "..%2F..%2Fetc", "%C3%BC" * 30, "x" * 3000, "%ff", "a/b", "-1")
"""Of nothing that is there: what fits by chance changes nobody's work."""
BEYOND = (
    *(("GET", "/v1/../../etc/passwd"), ("GET", "/metrics"), ("GET", "/"), ("PUT", "/v1/vehicles")),
    *(("TRACE", "/"), ("POST", "/v1/events"), ("DELETE", "/api/v1/events")),
)
"""What no description has."""
STREAMS = ("/events", "/v1/sse")
"""Ends of paths whose answers have no end."""
CONTENT_TYPES = (
    "application/json",
    "application/json",
    "text/plain",
    "application/x-www-form-urlencoded",
    "",
)
ODD_QUERIES = ("", "?limit=-1", "?limit=1e9&after=%00", "?kind=x", "?since=9999", "?" + "a=b&" * 200)
BODIES = (
    {"requestId": "r", "name": "Enemy", "destinations": [{"locationName": "Nowhere", "operation": "NOP"}]},
    {"requestId": "r", "name": "Nobody", "vehicle": "Nobody", "path": "Nobody", "locked": True},
    {"transportOrder": "Nobody", "orderSequence": "Nobody", "zoneSetId": "Nobody", "reason": "why"},
)
"""What hosts say, of nothing that is there."""
REPEATED = (Topic.STATE, Topic.VISUALIZATION, Topic.FACTSHEET, Topic.CONNECTION, Topic.INSTANT_ACTIONS)
"""What was said to or by robots; an old order is left out, which to an idle robot is an order."""

ReceivedMessage = tuple[str, bytes]


class Enemy:
    """Chooses by chance, the same for the same seed and conversation."""

    def __init__(self, site: Site, chance: Random) -> None:
        self._site = site
        self._chance = chance
        self._recorded = _recorded()
        host_topics = list(_topics_of_hosts())
        chance.shuffle(host_topics)
        self._host_topics = cycle(host_topics)
        """In turn: a choice by chance leaves one of them out in some runs."""
        self._own: set[bytes] = set()
        """What was said here."""
        self.routes: list[tuple[httpx.AsyncClient, str, str]] = []
        self.topics: set[str] = set()
        """Last levels of what was said on."""
        self._ways: tuple[Callable[[], ReceivedMessage], ...] = (
            self._to_strangers,
            self._under_a_robots_name,
            self._to_services,
            self._beside_the_standard,
            self._again,
        )

    async def look_around(self, aggregator: httpx.AsyncClient) -> None:
        """Read which routes there are, except streams."""
        for client, prefix, description in (
            (self._site.orders, "", "/openapi.json"),
            (self._site.orders, "/opentcs", "/openapi.json"),
            (aggregator, "", "/api/v1/openapi.json"),
        ):
            paths = (await client.get(prefix + description)).raise_for_status().json()["paths"]
            self.routes += [
                (client, method.upper(), prefix + path)
                for path, operations in paths.items()
                for method in operations
                if not path.endswith(STREAMS)
            ]
            self.routes += [(client, *each) for each in BEYOND]

    def say(self) -> None:
        """Publish something."""
        topic, payload = self._chance.choice(self._ways)()
        self._own.add(payload)
        self._site.wire.publish(topic, payload, qos=self._chance.choice([0, 1]))
        self.topics.add(topic.rsplit("/", 1)[1])

    async def ask(self, number: int) -> httpx.Response | None:
        """Send a request to each route in turn; None: no such request can be made."""
        client, method, path = self.routes[number % len(self.routes)]
        path = re.sub(r"\{\w+\}", lambda _: self._chance.choice(NAMES), path)
        headers = {"content-type": self._chance.choice(CONTENT_TYPES)}
        try:
            return await client.request(
                method, path + self._chance.choice(ODD_QUERIES), content=self._body(), headers=headers
            )
        except httpx.InvalidURL:
            return None

    def _to_strangers(self) -> ReceivedMessage:
        """Send a damaged message on a foreign topic, or an old one unchanged."""
        kind, payload = self._any()
        robot = self._chance.choice((*STRANGERS, "NeNa/loop-1"))
        interface = self._chance.choice(INTERFACES[1:] if robot == "NeNa/loop-1" else INTERFACES)
        return f"{interface}/{robot}/{kind}", damaged(payload, self._chance)

    def _under_a_robots_name(self) -> ReceivedMessage:
        """Send an invalid message under a robot's name: a valid one could be obeyed."""
        kind, payload = self._any()
        return self._of_a_robot(kind), unfit(damaged(payload, self._chance))

    def _to_services(self) -> ReceivedMessage:
        """Send a meaningless request as a host, or a status as the order service."""
        return next(self._host_topics), self._body()

    def _beside_the_standard(self) -> ReceivedMessage:
        """Send NeNa's internal messages, and loopback control commands."""
        control = f"{self._site.interface}/loopback/NeNa/loop-1/control"
        map_of_a_robot = FLEET.robot_map(RobotKey("NeNa", self._chance.choice(self._site.serials)))
        return self._chance.choice((map_of_a_robot, control)), self._body()

    def _again(self) -> ReceivedMessage:
        """Repeat an earlier message, with its old header."""
        topic = self._of_a_robot(self._chance.choice(REPEATED))
        said = [each.payload for each in self._site.wire.received(topic) if each.payload not in self._own]
        return topic, self._chance.choice([each for each in said if each] or [b"{}"])

    def _body(self) -> bytes:
        """Return a body like those of hosts, or random content."""
        if self._chance.random() < 1 / 3:
            return json.dumps(self._chance.choice(VALUES)).encode()
        return damaged(json.dumps(self._chance.choice(BODIES)).encode(), self._chance)

    def _any(self) -> ReceivedMessage:
        """Return the last level of a topic, and a message recorded there."""
        kind = self._chance.choice(tuple(self._recorded))
        return kind, self._chance.choice(self._recorded[kind])

    def _of_a_robot(self, kind: str) -> str:
        return f"{self._site.interface}/v2/NeNa/{self._chance.choice(self._site.serials)}/{kind}"


def unfit(payload: bytes) -> bytes:
    """Make sure that no reader accepts it as a message: its header is invalid."""
    try:
        message = json.loads(payload)
    except (ValueError, RecursionError):
        return payload
    if isinstance(message, dict):
        message["headerId"] = []
    return json.dumps(message).encode()


def _recorded() -> dict[str, list[bytes]]:
    """Return all recorded messages, by the last level of their topic."""
    found: dict[str, list[bytes]] = defaultdict(list)
    for file in sorted(FOLDER.glob("*.jsonl")):
        for each in read_file(file):
            if each.payload:
                found[each.topic.rsplit("/", 1)[1]].append(each.payload)
    return dict(found)


def _topics_of_hosts() -> Iterator[str]:
    for each in channels(FLEET):
        yield re.sub(r"\{\w+\}", "enemy", each.address)
