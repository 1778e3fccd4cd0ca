"""An active order service whose shared store rejects the writes of its start."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import httpx
import pytest
from sqlalchemy import Engine, text

from nena_demo.plants import sample_plant_path
from nena_order_service.app import serve
from nena_order_service.plant_file import PLANT_MODEL, StoredPlant, load_plant
from nena_order_service.store.database import Changes, Fence, commit_changes
from nena_order_service.store.schema import open_database
from nena_shared.tasks import TaskFailedError
from support.order_service_fleet import Fleet
from support.postgres import Postgres
from support.waiting import PATIENCE, awaited

pytestmark = pytest.mark.broker

FULL = (
    """CREATE FUNCTION full_disk() RETURNS trigger LANGUAGE plpgsql AS
    $$ BEGIN RAISE EXCEPTION 'no room is left' USING ERRCODE = 'disk_full'; END $$""",
    "CREATE TRIGGER full_disk BEFORE INSERT OR UPDATE OR DELETE ON documents EXECUTE FUNCTION full_disk()",
)
ROOM = "DROP TRIGGER full_disk ON documents"


@pytest.fixture
def full(fleet: Fleet, postgres: Postgres) -> Engine:
    """Return a store with a plant model for another file, which the start cannot remove."""
    fleet.store_url = postgres.url
    engine = open_database(postgres.url)
    stored = StoredPlant(file="another", model=load_plant(sample_plant_path()).model.to_json())
    changes = Changes()
    changes.documents[PLANT_MODEL, ""] = stored.model_dump_json(exclude_defaults=True)
    commit_changes(engine, changes)
    execute(engine, *FULL)
    return engine


def execute(engine: Engine, *statements: str) -> None:
    with engine.begin() as connection:
        for each in statements:
            connection.execute(text(each))


class Started:
    """An order service in this process."""

    def __init__(self, fleet: Fleet) -> None:
        settings = fleet.settings()
        self.stop = asyncio.Event()
        self.serving = asyncio.create_task(serve(settings, self.stop))
        self.client = httpx.AsyncClient(base_url=f"http://127.0.0.1:{settings.http.port}", timeout=PATIENCE)

    async def is_in(self, role: str) -> httpx.Response:
        async def ready() -> httpx.Response | None:
            try:
                return await self.client.get("/readyz")
            except httpx.TransportError:
                return None

        found = await awaited(
            ready, lambda told: told is not None and told.json()["role"] == role, seconds=PATIENCE, what=role
        )
        assert found is not None
        return found

    async def end(self) -> None:
        async with asyncio.timeout(PATIENCE):
            await self.serving


@pytest.fixture
async def started(fleet: Fleet, full: Engine) -> AsyncIterator[Started]:
    made = Started(fleet)
    yield made
    made.serving.cancel()
    await asyncio.gather(made.serving, return_exceptions=True)
    await made.client.aclose()
    full.dispose()


async def test_starting_with_a_full_store_is_reported_and_continues_with_room(
    started: Started, full: Engine
) -> None:
    ready = await started.is_in("starting")
    assert (ready.status_code, "no room is left" in ready.text) == (503, True)
    execute(full, ROOM)

    await started.is_in("active")
    started.stop.set()
    await started.end()


async def test_exits_when_terminated(started: Started) -> None:
    await started.is_in("starting")
    started.stop.set()

    await started.end()


async def test_exits_when_another_process_owns_the_store(started: Started, full: Engine) -> None:
    await started.is_in("starting")
    Fence.raise_for(full, "http://other:55200")

    with pytest.raises(TaskFailedError):
        await started.end()
