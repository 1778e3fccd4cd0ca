from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from support.broker import Broker
from support.wired_robot import WiredFleet


@pytest.fixture
async def fleet(broker: Broker, interface_name: str) -> AsyncIterator[WiredFleet]:
    """Return fleet control over a real broker."""
    async with WiredFleet(broker, interface_name).connected() as wired:
        yield wired
