"""Thousands of damaged and hostile messages, over every topic and every route, while the site works."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import httpx
import pytest

from faults.extent import HOSTILE_MESSAGES
from faults.site import Site
from nena_cli.vda5050.recording import read_file
from nena_shared.vda5050.topics import Topic
from support.conversations import FOLDER
from support.damage import damaged

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(1800)]

HTTP_SHARE = 10
"""One request for so many messages."""
STRANGERS = ("NobodyElse/x-1", "NeNa/unknown", "Ne Na/ü", "a/b")
ROUTES = (
    ("POST", "/v1/transportOrders"),
    ("POST", "/v1/transportOrders/T-1/withdrawal"),
    ("POST", "/v1/vehicles/loop-1/dispatch"),
    ("POST", "/v1/vehicles/loop-1/instantActions"),
    ("POST", "/v1/vehicles/loop-1/initialPosition"),
    ("GET", "/v1/transportOrders/%00"),
    ("GET", "/v1/../../etc/passwd"),
    ("PUT", "/v1/vehicles"),
)
"""What fits by chance goes to nobody that is under way."""


def topics_of(site: Site, topic: str) -> list[str]:
    """Where a message of this kind may be sent: to strangers, and beside where it belongs."""
    first = [f"{site.interface}/{version}" for version in ("v2", "v3", "v9")]
    strange = [f"{each}/{robot}/{topic}" for each in first for robot in STRANGERS]
    return [*strange, f"{site.interface}/v2/{topic}", f"{site.interface}/v3/NeNa/loop-1/{topic}"]


async def test_nobody_is_impressed(trial: Callable[..., Any]) -> None:
    chance = Random(6)
    said = [each for file in sorted(FOLDER.glob("*.jsonl")) for each in read_file(file) if each.payload]
    async with trial(seed=6) as running:
        site = running.site
        for number in range(HOSTILE_MESSAGES):
            entry = chance.choice(said)
            topic = entry.topic.rsplit("/", 1)[1]
            payload = damaged(entry.payload, chance)
            if chance.random() < 0.5:  # what is no message at all may come under a robot's own name, too
                site.wire.publish(chance.choice(topics_of(site, topic)), payload, qos=chance.choice([0, 1]))
            else:
                target = f"{site.interface}/v2/NeNa/{chance.choice(site.serials)}/{topic}"
                site.wire.publish(target, broken(payload), qos=1)
            if number % HTTP_SHARE == 0:
                await ask(site, chance, payload)
        site.wire.publish("nena/v1/hosts/enemy/transportOrders/create", broken(payload))
        await running.recovers("hostile messages")


def broken(payload: bytes) -> bytes:
    """Make sure that it is no valid message: what is valid under a robot's name is what the robot says."""
    return payload[:-1] + b"\xff" if payload else b"\xff"


async def ask(site: Site, chance: Random, payload: bytes) -> None:
    """Send one request; whatever is answered, it is no failure of the service."""
    method, path = chance.choice(ROUTES)
    headers = {"content-type": chance.choice(["application/json", "text/plain", ""])}
    try:
        answer = await site.orders.request(method, path, content=broken(payload), headers=headers)
    except httpx.InvalidURL:
        return
    assert answer.status_code < httpx.codes.INTERNAL_SERVER_ERROR, f"{method} {path}: {answer.text}"


def test_every_kind_of_topic_is_tried() -> None:
    said = {each.topic.rsplit("/", 1)[1] for file in FOLDER.glob("*.jsonl") for each in read_file(file)}

    assert {Topic.ORDER, Topic.INSTANT_ACTIONS, Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET} <= said
