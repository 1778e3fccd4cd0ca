"""The database is killed under the order service: what was answered is kept, all else refused meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from faults.extent import TIMES
from support.postgres import Postgres

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(900)]


@pytest.mark.long
async def test_killed_and_started_again(trial: Callable[..., Any], own_postgres: Postgres) -> None:
    async with trial(seed=7, store_url=own_postgres.url) as running:
        for _ in range(2 * TIMES):
            own_postgres.stop()
            own_postgres.start()
            await running.recovers("database killed")
