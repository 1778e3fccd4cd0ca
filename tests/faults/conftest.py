from __future__ import annotations

import asyncio
import re
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from faults.checker import Account, settled
from faults.extent import ON_ROS, WHOLE
from faults.footprint import Footprint, grown
from faults.host import Host
from faults.recovery import FILE, Fault, Record
from faults.site import Layout, Site
from support.waiting import awaited

STATUS = re.compile("nena/v1/transportOrders/[^/]+/status")
AT_WORK_WITHIN = 60.0
FLOWING_WITHIN = 240.0
YARDSTICK = 10 if WHOLE else 2
"""Orders by which it is measured how long two of them take."""


@dataclass
class Trial:
    """A site under continuous orders, and the faults that it is given."""

    site: Site
    host: Host
    undisturbed: float = 0.0
    """Seconds that two orders took to end before the first fault, on average."""
    recovered: list[Fault] = field(default_factory=list)
    before: dict[str, Footprint] = field(default_factory=dict)
    _finished: set[str] = field(default_factory=set)
    """Topics of the orders that were told to have ended."""
    _looked_at: int = 0
    """So many messages of the wire."""

    def finished(self) -> int:
        """Return how many orders have been reported as ended so far."""
        history = self.site.wire.history
        new, self._looked_at = history[self._looked_at :], len(history)
        self._finished |= {
            each.topic for each in new if STATUS.match(each.topic) and b'"FINISHED"' in each.payload
        }
        return len(self._finished)

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
        self.recovered.append(Fault(fault, await self._timed()))

    async def settle_in(self) -> None:
        """Find out how things are before the first fault."""
        await self.at_work(1)
        self.undisturbed = round(await self._timed(YARDSTICK) * 2 / YARDSTICK, 1)
        self.before = self.site.footprints()

    def report(self, test: str, account: Account, after: dict[str, Footprint]) -> Record:
        """Sum up what was found."""
        return Record(
            test=test,
            undisturbed=self.undisturbed,
            faults=tuple(self.recovered),
            orders=len(account.store),
            failed=sum(each.state != "FINISHED" for each in account.store.values()),
            robots=len(self.site.serials),
            before=self.before,
            after=after,
        )

    async def _timed(self, more: int = 2) -> float:
        start = time.monotonic()
        await self.at_work(more)
        return round(time.monotonic() - start, 1)


@pytest.fixture
def trial(tmp_path: Path, request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Return a block that runs a site under orders, and checks the accounts at its end."""

    @asynccontextmanager
    async def run(
        *, at_once: int | None = None, seed: int = 1, on_ros: bool = ON_ROS, **site: Any
    ) -> AsyncIterator[Trial]:
        made = Site(tmp_path, Layout(on_ros=on_ros, **site))
        try:
            await made.start()
            host = Host(made, at_once=at_once or len(made.vehicles), seed=seed)
            ordering = asyncio.create_task(host.run(), name="host")
            found = Trial(made, host)
            await found.settle_in()
            yield found
            host.stop()
            await asyncio.wait_for(ordering, AT_WORK_WITHIN)
            account = await settled(made, host)
            after = made.footprints()
            record = found.report(request.node.nodeid.rsplit("/", 1)[-1], account, after)
            record.append_to(FILE)
            request.node.user_properties.append(("recovery", ", ".join(map(str, record.faults))))
            assert grown(found.before, after) == {}
        finally:
            await made.close()

    return run


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Show how long each fault was felt."""
    for report in terminalreporter.getreports("passed"):
        for told in (value for name, value in report.user_properties if name == "recovery"):
            terminalreporter.write_line(f"{report.nodeid.rsplit('::', 1)[1]}: {told}")
