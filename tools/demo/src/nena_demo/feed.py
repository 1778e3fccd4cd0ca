"""Orders that keep coming: as many as most robots can work on, or a peak of many at once."""

from __future__ import annotations

import asyncio
import uuid
from collections import Counter
from itertools import count
from random import Random
from typing import Final

import httpx

from nena_demo.host import Host, transport
from nena_demo.plants.hall import Hall
from nena_shared.fleet_api.transport_order import TransportOrderRequest, TransportOrderState

BUSY_SHARE: Final = 0.75
"""Share of the robots for which there is an order; the others park and recharge."""
PEAK_FACTOR: Final = 3
"""Orders of a load peak for each robot."""
INTERVAL: Final = 1.0
"""Seconds between two checks of the number of open orders."""
SEED: Final = 7


class OrderFeed:
    """Creates transport orders, and counts how they end."""

    def __init__(self, host: Host, hall: Hall) -> None:
        self.open: set[str] = set()
        self.ended: Counter[TransportOrderState] = Counter()
        self._host = host
        self._hall = hall
        self._random = Random(SEED)  # noqa: S311 - stations, no secrets
        self._number = count(1)
        self._wanted = max(1, round(BUSY_SHARE * len(hall.starts)))
        self._run = uuid.uuid4().hex[:4]

    async def run(self) -> None:
        """Create an order whenever one is missing, until cancelled."""
        while True:
            missing = self._wanted - len(self.open)
            if missing > 0:
                await self._create_orders(missing)
            await asyncio.sleep(INTERVAL)

    async def peak(self) -> int:
        """Create many orders at once; return how many were accepted."""
        return await self._create_orders(PEAK_FACTOR * len(self._hall.starts))

    def changed(self, name: str, state: TransportOrderState) -> None:
        """Note the new state of an order; others than those of this feed are ignored."""
        if name in self.open and state.final:
            self.open.discard(name)
            self.ended[state] += 1

    async def _create_orders(self, number: int) -> int:
        """Create orders; none if the order service does not answer, so that they are due again later."""
        requests = [self._next_request() for _ in range(number)]
        names = {request.name for request in requests if request.name}
        self.open |= names  # an order may end before the answer arrives
        try:
            accepted = await self._host.create_many(requests)
        except httpx.HTTPError:
            accepted = set()
        self.open -= names - accepted
        return len(accepted)

    def _next_request(self) -> TransportOrderRequest:
        """Return a transport from goods in to storage, or from there to goods out, within a section."""
        section = self._random.choice(self._hall.sections)
        storage = self._random.choice(section.storage)
        number = next(self._number)
        if number % 2:
            stations = self._random.choice(section.goods_in), storage
        else:
            stations = storage, self._random.choice(section.goods_out)
        return transport(*stations, name=f"Transport-{self._run}-{number}")
