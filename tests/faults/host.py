"""A host that creates orders without end and never gives up one: it repeats the key until it is answered."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime
from random import Random

import httpx

from faults.hall import LOAD, STATIONS, UNLOAD
from faults.site import Site
from nena_shared.fleet_api.transport_order import TransportOrderState
from support.pausing import time_passes

ASK_AGAIN = 0.2
"""Seconds."""

UNFINISHED: dict[str, list[str] | int] = {
    "state": [each.value for each in TransportOrderState if not each.final],
    "limit": 1000,
}


@dataclass(frozen=True, slots=True)
class Answer:
    """That an order was taken."""

    at: datetime
    seconds: float
    """Since it was asked for."""


class Host:
    """Has ``at_once`` orders under way, all the time until :meth:`stop`."""

    def __init__(self, site: Site, *, at_once: int, seed: int) -> None:
        self._site = site
        self._chance = Random(seed)
        self.at_once = at_once
        self._going_on = True
        self.answered: set[str] = set()
        """Names of the orders that the order service has said it has."""
        self.answers: list[Answer] = []
        self.refused: list[str] = []
        """Answers that no host should get."""
        self.put_off: Counter[tuple[int, str]] = Counter()
        """Status and detail of the answers after which it asked again."""

    async def run(self) -> None:
        """Order until :meth:`stop`."""
        number = 0
        while self._going_on:
            if await self._under_way() < self.at_once:
                number += 1
                await self._order(f"T-{number}")
            else:
                await time_passes(ASK_AGAIN)

    def stop(self) -> None:
        """Order no more."""
        self._going_on = False

    async def _order(self, name: str) -> None:
        first, second = self._chance.sample(STATIONS, 2)
        body = {
            "name": name,
            "idempotencyKey": f"key of {name}",
            "destinations": [
                {"locationName": first, "operation": LOAD},
                {"locationName": second, "operation": UNLOAD},
            ],
        }
        while True:
            asked = time.monotonic()
            try:
                answer = await self._site.orders.post("/v1/transportOrders", json=body)
            except httpx.HTTPError:
                await time_passes(ASK_AGAIN)
                continue
            if answer.is_success:
                self.answered.add(name)
                self.answers.append(Answer(datetime.now(UTC), time.monotonic() - asked))
                return
            if answer.status_code < httpx.codes.INTERNAL_SERVER_ERROR:
                self.refused.append(answer.text)
                return
            self.put_off[answer.status_code, _detail(answer)] += 1
            await time_passes(ASK_AGAIN)

    async def _under_way(self) -> int:
        """Return the number of orders that have not ended; the maximum if no service answers."""
        try:
            answer = await self._site.orders.get("/v1/transportOrders", params=UNFINISHED)
            return len(answer.json()["transportOrders"])
        except (httpx.HTTPError, KeyError, ValueError):
            return self.at_once


def _detail(answer: httpx.Response) -> str:
    try:
        return str(answer.json()["detail"])
    except (ValueError, KeyError):
        return answer.text
