"""Fixtures for tests with a running aggregator."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from support.broker import Broker
from support.served_aggregator import Served, serving


@pytest.fixture
async def served(broker: Broker, interface_name: str) -> AsyncIterator[Served]:
    """Yield a running aggregator with separate topics."""
    async with serving(broker, interface_name) as made:
        yield made
