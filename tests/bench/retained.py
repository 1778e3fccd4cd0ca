"""Whether the retained statuses on MQTT equal what REST answers, once the work has come to rest."""

from __future__ import annotations

import json
import threading
from typing import Any

import httpx

from bench.lanes import Hall
from bench.wire import Wire
from support.pausing import pass_time

SETTLE_SECONDS = 30.0
LOOK_EVERY = 1.0
"""Seconds."""
TIMEOUT = 300.0
PAGE = 1000
KINDS = ("vehicles", "transportOrders")
UNPUBLISHED = ("epoch", "lastState", "precisePosition", "energyLevel")
"""Fields that differ by design: a change of these alone is not published, and only MQTT has the epoch."""


class RetainedStatuses:
    """Collects the retained statuses of a fleet, as a subscriber that comes late finds them."""

    def __init__(self, port: int) -> None:
        self._found: dict[str, dict[str, Any]] = {}
        self._lock = threading.Lock()
        topics = tuple(f"nena/v1/{kind}/+/status" for kind in KINDS)
        self._wire = Wire(port, "bench-late", topics, self._told)

    def differing(self, url: str) -> dict[str, int]:
        """Return by kind how many statuses differ from REST's; wait for those that are on the way."""
        for _ in range(round(SETTLE_SECONDS / LOOK_EVERY)):
            differing = self._differing(url)
            if not any(differing.values()):
                break
            pass_time(LOOK_EVERY)
        return differing

    def close(self) -> None:
        """Disconnect."""
        self._wire.close()

    def _differing(self, url: str) -> dict[str, int]:
        at_rest = {kind: _listed(url, kind) for kind in KINDS}
        with self._lock:
            found = dict(self._found)
        differing = {}
        for kind, listed in at_rest.items():
            told = {topic.split("/")[3]: body for topic, body in found.items() if topic.split("/")[2] == kind}
            names = {name for name, body in listed.items() if kind == "vehicles" or not _ended(body)}
            names |= {name for name, body in told.items() if kind == "vehicles" or not _ended(body)}
            differing[kind] = sum(told.get(name) != listed.get(name) for name in names)
        return differing

    def _told(self, topic: str, payload: bytes, _moment: float) -> None:
        with self._lock:
            if payload:
                self._found[topic] = _published(json.loads(payload))
            else:
                self._found.pop(topic, None)


def unlike_rest(hall: Hall) -> dict[str, int]:
    """Return how many statuses of vehicles and open orders differ."""
    late = RetainedStatuses(hall.port)
    differing = late.differing(hall.url)
    late.close()
    return {**differing, "all": sum(differing.values())}


def _published(body: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in body.items() if name not in UNPUBLISHED}


def _ended(order: dict[str, Any]) -> bool:
    return order["state"] in ("FINISHED", "FAILED", "UNROUTABLE")


def _listed(url: str, kind: str) -> dict[str, dict[str, Any]]:
    """Return everything that REST lists, by name."""
    found, after = dict[str, dict[str, Any]](), dict[str, str]()
    with httpx.Client(base_url=url, timeout=TIMEOUT) as client:
        while True:
            page = client.get(f"/v1/{kind}", params={"limit": PAGE, **after}).json()
            found.update({each["name"]: _published(each) for each in page[kind]})
            if not page.get("next"):
                return found
            after = {"after": page["next"]}
