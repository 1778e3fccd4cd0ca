"""The history is backed up, destroyed and restored as docs/operations.md describes.

A newer one is moved aside.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.program import EXIT_FAILED
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer
from support.fleet_examples import order_status
from support.keepers import Keeper, PostgresKeeper, SqliteKeeper
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.e2e]


def orders_in(history: list[dict[str, Any]]) -> list[str]:
    return [entry["order"] for entry in history if entry["order"]]


@dataclass
class Panel:
    """A running aggregator, and the publisher of its orders."""

    process: AggregatorProcess
    http: httpx.AsyncClient
    peer: MqttPeer
    topics: FleetTopics

    async def connected(self) -> None:
        """Wait until it receives messages."""

        async def fleet() -> dict[str, Any]:
            found: dict[str, Any] = (await self.http.get("/api/v1/fleet")).json()
            return found

        await awaited(
            fleet, lambda fleet: fleet["link"]["connected"], seconds=PATIENCE, what="its link stands"
        )

    async def history(self) -> list[dict[str, Any]]:
        """Return all that is kept, oldest first."""
        lines = (await self.http.get("/api/v1/history.jsonl")).raise_for_status().text
        return [json.loads(line) for line in lines.splitlines()]

    async def learns_of(self, *orders: str) -> list[dict[str, Any]]:
        """Publish orders, and return the history once they are in it."""
        for name in orders:
            self.peer.publish(
                self.topics.order_status(name), order_status(name).model_dump_json(by_alias=True)
            )
        return await awaited(
            self.history,
            lambda kept: {*orders} <= {entry["order"] for entry in kept},
            seconds=PATIENCE,
            what=f"{orders} in the history",
        )


@dataclass(frozen=True)
class Site:
    """Starts aggregators on one history."""

    broker: Broker
    interface: str
    url: str

    @property
    def options(self) -> tuple[str, ...]:
        return (
            *("--history.url", self.url),
            *("--history.interval", "0.02"),
            *("--interface_name", self.interface),
            *("--topic_prefix", f"{self.interface}/nena"),
            *("--mqtt.port", str(self.broker.port)),
            *("--http.port", "0"),
        )

    @asynccontextmanager
    async def panel(self) -> AsyncIterator[Panel]:
        with AggregatorProcess(*self.options) as process, MqttPeer(self.broker) as peer:
            topics = FleetTopics(f"{self.interface}/nena")
            async with httpx.AsyncClient(base_url=await process.url(), timeout=PATIENCE) as http:
                panel = Panel(process, http, peer, topics)
                await panel.connected()
                yield panel


@pytest.fixture(params=["sqlite", "postgresql"])
def keeper(request: pytest.FixtureRequest, tmp_path: Path) -> Keeper:
    """Return a place for the history."""
    if request.param == "sqlite":
        return SqliteKeeper(tmp_path, "history.db")
    return PostgresKeeper(request.getfixturevalue("postgres_server"), tmp_path)


async def test_lost_history_continues_from_its_last_backup(
    broker: Broker, interface_name: str, keeper: Keeper
) -> None:
    site = Site(broker, interface_name, keeper.url)
    async with site.panel() as panel:
        backed_up = await panel.learns_of("TO-1", "TO-2")
        assert orders_in(backed_up) == ["TO-1", "TO-2"]
        keeper.back_up()
        await panel.learns_of("TO-3")
        panel.process.process.kill()
        panel.process.process.wait(PATIENCE)
    keeper.destroy()

    keeper.restore()

    async with site.panel() as panel:
        now = await panel.learns_of("TO-4")
        assert panel.process.end() == 0
    assert now[: len(backed_up)] == backed_up
    assert orders_in(now[len(backed_up) :]) == ["TO-4"], "what query after the backup is forgotten"


async def test_older_aggregator_exits_on_a_newer_history_and_starts_without_it(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    """This release plays the older one: the history is such as the next one would leave."""
    file = tmp_path / "history.db"
    site = Site(broker, interface_name, f"sqlite:///{file}")
    async with site.panel() as panel:
        await panel.learns_of("TO-1")
        assert panel.process.end() == 0
    with closing(sqlite3.connect(file)) as history, history:
        history.execute("UPDATE history_schema_version SET version = 99")

    with AggregatorProcess(*site.options) as older:
        assert older.process.wait(PATIENCE) == EXIT_FAILED
        (line,) = older.output.splitlines()
        assert "the history database has schema version 99" in line
        assert "another history.url" in line

    file.rename(tmp_path / "aside.db")
    async with site.panel() as panel:
        assert orders_in(await panel.learns_of("TO-2")) == ["TO-2"]
