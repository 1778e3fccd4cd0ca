"""Lets a site work for long, measures it window by window, and writes what was found to docs/soak.md.

``python -m faults.soak --minutes 120``; the exit status is 1 where something has drifted or was lost.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import quantiles

from faults.checker import account_of, settled
from faults.drift import Window, drift
from faults.footprint import Footprint
from faults.host import Answer, Host
from faults.site import Layout, Site
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from support.pausing import time_passes

DOCUMENT = Path(__file__).parents[2] / "docs" / "soak.md"
INTRODUCTION = Path(__file__).with_name("soak.md")
LONGEST_WINDOW = 300.0
LEAST_COUNT = 10
"""Windows of a run, so that a drift can be told from chance."""
AT_ONCE = 10
"""Orders under way all the time: one for each robot."""
HOST_ENDS_WITHIN = 60.0

Looks = list[tuple[datetime, dict[str, Footprint]]]
"""The end of each window, and what the programs took then."""


@dataclass(frozen=True, slots=True)
class Soaked:
    """What a run has come to."""

    windows: list[Window]
    robots: int
    fault: str
    """What the checker says of orders that failed, were lost or were done twice; empty: nothing."""


async def soak(minutes: float, folder: Path) -> Soaked:
    """Run a site for so long.

    Raises:
        AssertionError: a program has ended meanwhile.

    """
    site = Site(folder, Layout(on_ros=True))
    try:
        await site.start()
        host = Host(site, at_once=AT_ONCE, seed=1)
        start = datetime.now(UTC)
        ordering = asyncio.create_task(host.run(), name="host")
        looks = await _watched(site, minutes * 60)
        host.stop()
        await asyncio.wait_for(ordering, HOST_ENDS_WITHIN)
        fault = ""
        try:
            await settled(site, host)
        except AssertionError as error:
            fault = str(error) or repr(error)
        ended = (await account_of(site)).store.values()
        return Soaked(_windows(start, looks, host.answers, ended), len(site.serials), fault)
    finally:
        await site.close()


async def _watched(site: Site, seconds: float) -> Looks:
    """Look at the programs at the end of each window; fails as soon as one of them has ended."""
    window = min(LONGEST_WINDOW, seconds / LEAST_COUNT)
    looks: Looks = []
    for number in range(round(seconds / window)):
        await time_passes(window)
        for name, program in site.programs.items():
            assert program.process.poll() is None, f"{name} has ended:\n{program.log[-3000:]}"
        found = site.footprints()
        looks.append((datetime.now(UTC), found))
        print(f"{number + 1}: {found}", flush=True)  # noqa: T201 - a person waits for hours
    return looks


def _windows(
    start: datetime, looks: Looks, answers: Iterable[Answer], orders: Iterable[TransportOrderStatus]
) -> list[Window]:
    """Sort what was measured by window; what came after the last one counts for none."""
    edges = [start, *(end for end, _ in looks)]
    ended = [each for each in orders if each.finished is not None]
    return [
        Window(
            answers=[each.seconds for each in answers if since <= each.at < end],
            orders=[_seconds(each) for each in ended if each.finished and since <= each.finished < end],
            footprints=found,
        )
        for since, (end, found) in zip(edges, looks, strict=False)
    ]


def _seconds(order: TransportOrderStatus) -> float:
    assert order.finished, "it has ended"
    return (order.finished - order.created).total_seconds()


def findings(soaked: Soaked) -> list[str]:
    """Say what is not as it should be, a sentence each; nothing where all is well."""
    return [*filter(None, [soaked.fault]), *drift(soaked.windows)]


def document(soaked: Soaked, *, minutes: float, load: float) -> str:
    """Give the whole text of the report."""
    found, windows = findings(soaked), soaked.windows
    said = "; ".join(found)
    if not found:
        said = "None lost, none failed, none done twice. No drift: the last third is like the first one."
    orders = sum(len(each.orders) for each in windows)
    day = datetime.now(UTC).date().isoformat()
    head = (
        f"{day}, {minutes:g} minutes, {soaked.robots} robots, {orders} orders, "
        f"load of the machine at the end {load:.1f}. No program ended. **{said}**"
    )
    parts = [INTRODUCTION.read_text(encoding="utf-8"), head, "", *_latencies(windows), "", *_memory(windows)]
    return "\n".join([*parts, ""])


def _latencies(windows: Sequence[Window]) -> Iterator[str]:
    yield _line(["Window", "Orders ended", "Answer p50", "Answer p99", "Order p50", "Order p99"])
    yield _line(["---"] * 6)
    for number, window in enumerate(windows, 1):
        answers = [f"{1000 * value:.0f} ms" for value in _percentiles(window.answers)]
        ends = [f"{value:.1f} s" for value in _percentiles(window.orders)]
        yield _line([str(number), str(len(window.orders)), *answers, *ends])


def _memory(windows: Sequence[Window]) -> Iterator[str]:
    programs = sorted(windows[0].footprints)
    yield _line(["Window", *(f"{each}: MB, descriptors, threads" for each in programs)])
    yield _line(["---"] * (1 + len(programs)))
    for number, window in enumerate(windows, 1):
        found = [window.footprints[each] for each in programs]
        yield _line(
            [str(number), *(f"{each.megabytes:.1f}, {each.descriptors}, {each.threads}" for each in found)]
        )


def _percentiles(values: Sequence[float]) -> tuple[float, float]:
    """Give the 50th and the 99th."""
    if len(values) < 2:
        return (values[0], values[0]) if values else (float("nan"), float("nan"))
    hundredths = quantiles(values, n=100, method="inclusive")
    return hundredths[49], hundredths[98]


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def main() -> int:
    """Run it, and write the report."""
    parser = argparse.ArgumentParser(description="Lets a site work for long, and tells what has drifted.")
    parser.add_argument("--minutes", type=float, default=120)
    parser.add_argument("--output", type=Path, default=DOCUMENT)
    wanted = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="nena-soak-"))  # with the logs, where something was found
    soaked = asyncio.run(soak(wanted.minutes, folder))
    found, load = findings(soaked), os.getloadavg()[0]
    if not found:
        shutil.rmtree(folder)
    wanted.output.write_text(document(soaked, minutes=wanted.minutes, load=load), encoding="utf-8")
    print("\n".join(found) or "nothing lost, no drift")  # noqa: T201
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
