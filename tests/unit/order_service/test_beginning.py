from __future__ import annotations

import asyncio
import sys

import pytest

from nena_order_service.app import has_begun, serve
from nena_order_service.settings import OrderServiceSettings, StoreSettings
from nena_shared.extensions.tracing import TracingSettings
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import Supervisor, TaskFailedError
from support.forgetful import cancel_again_at_once, forgetful
from support.waiting import PATIENCE


class Start:
    """A beginning that waits for a store of the test's own."""

    def __init__(self) -> None:
        self.stop = asyncio.Event()
        self.room = asyncio.Event()
        self.problem = ""
        self.told = 0
        self.heard = asyncio.Event()

    async def begin(self) -> None:
        await self.room.wait()

    def tell(self) -> None:
        self.told += 1
        self.heard.set()

    async def run(self, supervisor: Supervisor) -> bool:
        async with asyncio.timeout(PATIENCE):
            return await has_begun(
                self.begin(), supervisor, self.stop, waits=lambda: bool(self.problem), show=self.tell
            )


async def test_a_working_store_reports_nothing() -> None:
    start = Start()
    start.room.set()
    async with Supervisor() as supervisor:
        assert await start.run(supervisor)
    assert start.told == 0


async def test_a_store_that_rejects_writes_is_reported_once_and_waited_for() -> None:
    start = Start()
    start.problem = "disk is full"
    async with Supervisor() as supervisor:
        running = asyncio.create_task(start.run(supervisor))
        await asyncio.wait_for(start.heard.wait(), PATIENCE)
        assert not running.done()
        start.room.set()
        assert await running
    assert start.told == 1


async def test_a_stopping_program_no_longer_waits() -> None:
    start = Start()
    async with Supervisor() as supervisor:
        running = asyncio.create_task(start.run(supervisor))
        start.stop.set()
        assert not await running


async def test_a_failed_part_ends_the_wait() -> None:
    async def fail() -> None:
        raise RuntimeError

    async with Supervisor() as supervisor:
        supervisor.start("store", fail())
        with pytest.raises(TaskFailedError, match="store"):
            await Start().run(supervisor)


async def test_a_failed_start_reports_the_reason() -> None:
    class Broken(Start):
        async def begin(self) -> None:
            message = "no such plant"
            raise ValueError(message)

    async with Supervisor() as supervisor:
        with pytest.raises(ValueError, match="no such plant"):
            await Broken().run(supervisor)


async def test_a_start_that_swallows_its_cancellation_is_cancelled_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Forgetful(Start):
        async def begin(self) -> None:
            await forgetful()

    cancel_again_at_once(monkeypatch)
    start = Forgetful()
    async with Supervisor() as supervisor:
        running = asyncio.create_task(start.run(supervisor))
        asyncio.get_running_loop().call_later(0.01, start.stop.set)
        await asyncio.wait({running}, timeout=PATIENCE / 2)
        assert running.done()
        assert not running.result()


async def test_a_standby_without_the_extra_for_traces_ends_at_its_start(
    settings: OrderServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program that noticed it only at a takeover would leave the fleet without an order service."""
    monkeypatch.setitem(sys.modules, "nena_shared.extensions.tracing.export", None)
    stop = asyncio.Event()
    stop.set()
    standby = settings.model_copy(
        update={
            "store": StoreSettings.model_validate({"url": "postgresql://127.0.0.1:1/nena"}),
            "tracing": TracingSettings.model_validate({"endpoint": "http://127.0.0.1:1/v1/traces"}),
        }
    )
    with pytest.raises(ConfigurationError, match=r"install the extra nena-order-service\[tracing\]"):
        await serve(standby, stop)
