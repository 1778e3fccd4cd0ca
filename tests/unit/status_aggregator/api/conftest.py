"""The HTTP application over an aggregator without a broker."""

from __future__ import annotations

from collections.abc import AsyncIterator

import httpx
import pytest

from nena_shared.settings import settings_with
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.extension import installed
from nena_status_aggregator.settings import AggregatorHttpSettings, AggregatorSettings, EventSettings
from support.clocks import ManualClock
from support.fleet_examples import ROBOT, START, order_status
from support.fleet_records import state


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(start=START)


@pytest.fixture
def aggregator(clock: ManualClock) -> Aggregator:
    model = settings_with(AggregatorSettings, installed())
    return Aggregator(model(events=EventSettings(clients=1)), clock, installed())


@pytest.fixture
def populated(aggregator: Aggregator) -> Aggregator:
    """Return the aggregator with a robot and an order."""
    aggregator.model.on_link(connected=True, at=aggregator.now())
    aggregator.model.on_state(ROBOT, state(), aggregator.now())
    aggregator.model.on_order_status(order_status(), aggregator.now())
    aggregator.publish_changes()
    return aggregator


@pytest.fixture
async def client(aggregator: Aggregator) -> AsyncIterator[httpx.AsyncClient]:
    app = make_app(aggregator, AggregatorHttpSettings())
    transport = httpx.ASGITransport(app, raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://aggregator") as made:
        yield made
