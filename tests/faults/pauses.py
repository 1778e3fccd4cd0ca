"""Suspend the active order service for 1 to 60 s, repeatedly, while robots of three kinds work.

``python -m faults.pauses --pauses 50``; the exit status is 1 if an order was done twice or lost, or a status
went back.
"""

from __future__ import annotations

import argparse
import asyncio
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from faults.checker import stored
from faults.host import Host
from faults.pair import LOOK_EVERY, ROLE_WITHIN, PairSite, judged
from nena_shared.fleet_api.transport_order import TransportOrderState
from support.pausing import time_passes
from support.postgres import Postgres
from support.waiting import PATIENCE, awaited

SHORTEST, LONGEST = 1.0, 60.0
"""Seconds."""
AT_ONCE = 5
BETWEEN = 3.0
"""Seconds from the end of a pause to the next one, in which orders are sent."""
SETTLED = 1.0
"""Seconds after which an order service that woke knows whether it was replaced."""


@dataclass(frozen=True, slots=True)
class Result:
    """What came of a run."""

    orders: int
    finished: int
    takeovers: int
    seconds: float
    findings: list[str]
    by_robot: dict[str, int]
    """Actions that each robot has done."""


def steps(count: int) -> list[float]:
    """Return so many pauses, from the shortest to the longest in equal steps."""
    if count == 1:
        return [SHORTEST]
    return [SHORTEST + (LONGEST - SHORTEST) * each / (count - 1) for each in range(count)]


async def run(pauses: list[float], folder: Path, store_url: str) -> Result:
    """Run a site with these pauses, and judge it."""
    begun = time.monotonic()
    site = PairSite(folder, store_url, library=find_spec("vda5050") is not None)
    try:
        await site.start()
        host = Host(site, at_once=AT_ONCE, seed=1)
        ordering = asyncio.create_task(host.run(), name="host")
        takeovers, stuck = 0, []
        for number, seconds in enumerate(pauses, 1):
            await time_passes(BETWEEN)
            try:
                takeovers += await _pause(site, seconds)
            except AssertionError as error:
                stuck.append(f"pause {number}, of {seconds:.1f} s: {error}")
                await site.start_again_what_is_stuck()
            print(  # noqa: T201 - a person waits for half an hour
                f"{number}: {seconds:.1f} s, {takeovers} takeovers, {len(host.answered)} orders",
                *stuck[-1:],
                flush=True,
            )
        await time_passes(BETWEEN)
        host.stop()
        await asyncio.wait_for(ordering, PATIENCE)
        findings = [*stuck, *await judged(site, host)]
        done = [each.robot for each in site.complete_history().events if each.kind == "ended"]
        states = [each.state for each in (await stored(site)).values()]
        return Result(
            len(states),
            states.count(TransportOrderState.FINISHED),
            takeovers,
            time.monotonic() - begun,
            findings,
            {each: done.count(each) for each in sorted(set(done))},
        )
    finally:
        await site.close()


async def _pause(site: PairSite, seconds: float) -> bool:
    """Suspend the active order service; return whether another one has replaced it.

    Raises:
        AssertionError: an order service did not reach the expected role in time.
    """
    leader = await site.leader()
    await site.stands_by(site.other(leader))
    async with site.paused(leader):
        await time_passes(seconds)
    await time_passes(SETTLED)
    if await site.role_of(site.other(leader)) != "active":
        return False
    process = site.programs[f"order-service-{leader}"].process

    async def ended() -> bool:
        return process.poll() is not None

    await awaited(
        ended, bool, seconds=ROLE_WITHIN, what=f"{leader}, which was replaced, has ended", every=LOOK_EVERY
    )
    site.start_service(leader)
    return True


def main() -> int:
    """Run the pauses and report."""
    parser = argparse.ArgumentParser(description="Pause the active order service again and again.")
    parser.add_argument("--pauses", type=int, default=50)
    wanted = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="nena-pauses-"))  # keeps the logs if there are findings
    postgres = Postgres()
    try:
        result = asyncio.run(run(steps(wanted.pauses), folder, postgres.url))
    finally:
        postgres.close()
    if not result.findings:
        shutil.rmtree(folder)
    print(result)  # noqa: T201
    return 1 if result.findings else 0


if __name__ == "__main__":
    sys.exit(main())
