from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from faults.checker import settled
from faults.host import Host
from faults.site import Site
from support.order_service_fleet import awaited

AT_WORK_WITHIN = 60.0
FLOWING_WITHIN = 120.0


@dataclass
class Trial:
    """A site under continuous orders, and the faults that it is given."""

    site: Site
    host: Host
    recovered: list[tuple[str, float]] = field(default_factory=list)
    """Each fault, with the seconds from its end until orders came to their end again."""

    def finished(self) -> int:
        """How many orders were told to have ended so far."""
        told = self.site.wire.received("nena/v1/transportOrders/+/status")
        return len({each.topic for each in told if b'"FINISHED"' in each.payload})

    async def at_work(self, more: int = 2) -> None:
        """Wait until so many further orders have ended: everything is moving."""
        wanted = self.finished() + more

        async def look() -> int:
            return self.finished()

        await awaited(
            look, lambda found: found >= wanted, seconds=FLOWING_WITHIN, what="orders come to their end"
        )

    async def recovers(self, fault: str) -> None:
        """Wait until orders come to their end again, and note how long that took."""
        start = time.monotonic()
        await self.at_work()
        self.recovered.append((fault, round(time.monotonic() - start, 1)))


@pytest.fixture
def trial(tmp_path: Path, record_property: Callable[[str, object], None]) -> Callable[..., Any]:
    """Give a block that runs a site under orders, and checks the accounts at its end."""

    @asynccontextmanager
    async def run(*, at_once: int = 8, seed: int = 1, **site: Any) -> AsyncIterator[Trial]:
        made = Site(tmp_path, **site)
        try:
            await made.start()
            host = Host(made, at_once=at_once, seed=seed)
            ordering = asyncio.create_task(host.run(), name="host")
            found = Trial(made, host)
            await found.at_work(1)
            yield found
            host.stop()
            await asyncio.wait_for(ordering, AT_WORK_WITHIN)
            account = await settled(made, host)
            for fault, seconds in found.recovered:
                record_property(f"{fault}, seconds to recover", seconds)
            record_property("orders", len(account.store))
        finally:
            await made.close()

    return run


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Show how long each fault was felt."""
    for report in terminalreporter.getreports("passed"):
        for name, value in report.user_properties:
            terminalreporter.write_line(f"{report.nodeid.rsplit('::', 1)[1]}: {name}: {value}")
