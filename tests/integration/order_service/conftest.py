from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest

from support.broker import Broker
from support.keepers import Keeper, PostgresKeeper, SqliteKeeper
from support.order_service_fleet import Fleet, running
from support.postgres import Postgres
from support.published import problems_in


@pytest.fixture
def fleet(broker: Broker, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(broker, interface_name, tmp_path)
    with made.stack:
        yield made
    assert problems_in(each for peer in made.peers for each in peer.history) == []


@pytest.fixture
async def service(fleet: Fleet) -> AsyncIterator[Callable[..., Awaitable[httpx.AsyncClient]]]:
    """Yield a function that starts the order service in this process, and returns its client."""
    async with AsyncExitStack() as stack:

        async def start(**settings: Any) -> httpx.AsyncClient:
            return await stack.enter_async_context(running(fleet.settings(**settings)))

        yield start


@pytest.fixture(params=[pytest.param("sqlite", marks=pytest.mark.long), "postgresql"])
def keeper(request: pytest.FixtureRequest, fleet: Fleet, tmp_path: Path) -> Iterator[Keeper]:
    """Yield the fleet's store."""
    if request.param == "sqlite":
        made: Keeper = SqliteKeeper(tmp_path)
    else:
        made = PostgresKeeper(request.getfixturevalue("postgres_server"), tmp_path)
    fleet.store_url = made.url
    yield made
    fleet.stack.close()
    made.destroy()


@pytest.fixture
def shared(fleet: Fleet, postgres: Postgres) -> Fleet:
    """Return a fleet whose store several order services may use."""
    fleet.store_url = postgres.url
    return fleet
