"""Order services on PostgreSQL: the database hangs, and no order service leads."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import httpx
import pytest
from sqlalchemy import NullPool, create_engine, text

from alerts.watched import WatchedSite, watched
from faults.site import Layout
from nena_order_service.store.leadership import LOCK_CLASS
from support.broker import free_port
from support.order_service_fleet import role
from support.postgres import Postgres
from support.programs import Program
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.long, pytest.mark.timeout(1200)]

STANDBY = "order-service-standby"
WAIT_FOR_THE_LOCK = text("SELECT pg_advisory_lock(:lock_class, hashtext(current_schema()))")


class PairedSite(WatchedSite):
    """A site with a second order service, which stands by."""

    def __init__(self, folder: Path, layout: Layout) -> None:
        """Prepare it."""
        super().__init__(folder, layout)
        self._standby_port = free_port()

    async def start(self) -> None:
        """Start everything; the standby last, so that it stands by."""
        await super().start()
        self.start_standby()
        await self.complete()

    def start_standby(self) -> Program:
        """Start the second order service."""
        return self._program(
            STANDBY,
            "nena-order-service",
            *("--plant", self.plant, "--store.url", self._store, "--http.port", self._standby_port),
            *("--mqtt.port", self.broker.port, "--mqtt.reconnect_max", 1.0),
        )

    async def roles(self) -> dict[str, str]:
        """Return the role of each order service; empty if it does not respond."""
        ports = {"order-service": self._ports["order-service"], STANDBY: self._standby_port}
        found = {}
        for name, port in ports.items():
            async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE) as client:
                found[name] = await role(client)
        return found

    async def complete(self) -> None:
        """Wait until one leads and one stands by; start again what has exited."""

        async def look() -> list[str]:
            for name, start in (("order-service", self.start_order_service), (STANDBY, self.start_standby)):
                if self.programs[name].process.poll() is not None:
                    start()
            return sorted((await self.roles()).values())

        await awaited(look, lambda found: found == ["active", "standby"], what="a leader and a standby")

    def targets(self) -> dict[str, Any]:
        """Return what Prometheus scrapes."""
        targets = super().targets()
        return {**targets, "order_services": [*targets["order_services"], f"127.0.0.1:{self._standby_port}"]}


@asynccontextmanager
async def hanging(site: PairedSite, postgres: Postgres) -> AsyncIterator[None]:
    """Let the database hang; end with a leader and a standby."""
    with postgres.frozen():
        yield
    await site.complete()


@contextmanager
def next_in_line(postgres: Postgres) -> Iterator[None]:
    """Get the lock of the leader as soon as it is free, and keep it until the block ends."""
    engine = create_engine(postgres.url, poolclass=NullPool)
    connection = engine.connect()
    waiting = Thread(
        target=connection.execute, args=(WAIT_FOR_THE_LOCK, {"lock_class": LOCK_CLASS}), daemon=True
    )
    waiting.start()
    try:
        yield
    finally:
        waiting.join(PATIENCE)
        connection.close()
        engine.dispose()


@asynccontextmanager
async def no_leader(site: PairedSite, postgres: Postgres) -> AsyncIterator[None]:
    """Kill the leader while another client takes the lock; end with a leader and a standby."""
    roles = await site.roles()
    with next_in_line(postgres):
        (leader,) = (name for name, role in roles.items() if role == "active")
        site.programs[leader].kill()
        yield
    await site.complete()


@asynccontextmanager
async def standby_killed(site: PairedSite) -> AsyncIterator[None]:
    """Kill the standby, and start it again at the end."""
    site.programs[STANDBY].kill()
    yield
    await site.complete()


async def test_standby_and_no_leader(tmp_path: Path, own_postgres: Postgres) -> None:
    site = PairedSite(tmp_path, Layout(loopback=2, singles=1, store_url=own_postgres.url))
    async with watched(site) as watch:
        await watch.finds(
            standby_killed(site),
            {"NenaOrderServiceNotScraped": 1},
            instance=f"127.0.0.1:{site._standby_port}",
        )
        await watch.finds(no_leader(site, own_postgres), {"NenaNoLeader": 1}, severity="critical")


@asynccontextmanager
async def database_killed(site: PairedSite, postgres: Postgres) -> AsyncIterator[None]:
    """Kill the database, and start it again at the end; end with a leader and a standby."""
    postgres.stop()
    yield
    postgres.start()
    await site.complete()


async def test_killed_database(tmp_path: Path, own_postgres: Postgres) -> None:
    site = PairedSite(tmp_path, Layout(loopback=2, singles=1, store_url=own_postgres.url))
    async with watched(site) as watch:
        await watch.finds(
            database_killed(site, own_postgres), {"NenaStoreNotWritten": 2}, severity="critical"
        )


async def test_hanging_database(tmp_path: Path, own_postgres: Postgres) -> None:
    site = PairedSite(tmp_path, Layout(loopback=2, singles=1, store_url=own_postgres.url))
    async with watched(site) as watch:
        await watch.finds(hanging(site, own_postgres), {"NenaStoreNotWritten": 1}, severity="critical")
