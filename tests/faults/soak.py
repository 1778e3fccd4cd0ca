"""Run a site for hours, measure it window by window, and write the results to docs/soak.md.

``python -m faults.soak --minutes 120``; the exit status is 1 if something drifted or was lost.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import median, quantiles

from faults.checker import account_of, settled
from faults.drift import Window, drift
from faults.footprint import Footprint
from faults.host import Answer, Host
from faults.site import Layout, Site
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from support.markdown import row
from support.pausing import time_passes

DOCUMENT = Path(__file__).parents[2] / "docs" / "soak.md"
INTRODUCTION = Path(__file__).with_name("soak.md")
LONGEST_WINDOW = 300.0
LEAST_COUNT = 10
"""Windows of a run: enough to distinguish drift from noise."""
AT_ONCE = 10
"""Orders under way all the time: one for each robot."""
HOST_ENDS_WITHIN = 60.0

YARDSTICK_EVERY = 15.0
YARDSTICK_STEPS = 500_000
"""The yardstick: about 10 ms of work, longer than a process may run at once where others wait."""


@dataclass(frozen=True, slots=True)
class Look:
    """The end of a window, the resource use of the programs then, and the yardstick during the window."""

    end: datetime
    footprints: dict[str, Footprint]
    yardstick: list[float]


Looks = list[Look]


@dataclass(frozen=True, slots=True)
class Soaked:
    """Results of a run."""

    windows: list[Window]
    robots: int
    fault: str
    """The checker's text about orders that failed, were lost or were done twice; empty if none."""


async def soak(minutes: float, folder: Path) -> Soaked:
    """Run a site for ``minutes``.

    Raises:
        AssertionError: a program exited during the run.

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
    """Measure the programs at the end of each window; fail as soon as one of them has exited."""
    window = min(LONGEST_WINDOW, seconds / LEAST_COUNT)
    looks: Looks = []
    for number in range(round(seconds / window)):
        yardstick = await _yardstick(window)
        for name, program in site.programs.items():
            assert program.process.poll() is None, f"{name} has ended:\n{program.log[-3000:]}"
        found = site.footprints()
        looks.append(Look(datetime.now(UTC), found, yardstick))
        print(f"{number + 1}: {median(yardstick):.3f} s, {found}", flush=True)  # noqa: T201 - a person waits for hours
    return looks


async def _yardstick(seconds: float) -> list[float]:
    """Let time pass; return how long the same computation took, again and again."""
    found: list[float] = []
    ends = time.monotonic() + seconds
    while (left := ends - time.monotonic()) > 0 or not found:
        await time_passes(min(YARDSTICK_EVERY, left))
        begun = time.monotonic()
        sum(range(YARDSTICK_STEPS))
        found.append(time.monotonic() - begun)
    return found


def _windows(
    start: datetime, looks: Looks, answers: Iterable[Answer], orders: Iterable[TransportOrderStatus]
) -> list[Window]:
    """Sort the measurements by window; leave out those after the last one."""
    edges = [start, *(each.end for each in looks)]
    ended = [each for each in orders if each.finished is not None]
    return [
        Window(
            answers=[each.seconds for each in answers if since <= each.at < look.end],
            orders=[_seconds(each) for each in ended if each.finished and since <= each.finished < look.end],
            footprints=look.footprints,
            yardstick=look.yardstick,
        )
        for since, look in zip(edges, looks, strict=False)
    ]


def _seconds(order: TransportOrderStatus) -> float:
    assert order.finished, "only ended orders have a duration"
    return (order.finished - order.created).total_seconds()


def findings(soaked: Soaked) -> list[str]:
    """Return the defects found, a sentence each; empty if there are none."""
    return [*filter(None, [soaked.fault]), *drift(soaked.windows)]


def document(soaked: Soaked, *, minutes: float, load: float) -> str:
    """Return the text of the report."""
    found, windows = findings(soaked), soaked.windows
    said = "; ".join(found)
    if not found:
        said = "None lost, none failed, none done twice. No drift between the first and the last third."
    orders = sum(len(each.orders) for each in windows)
    day = datetime.now(UTC).date().isoformat()
    head = (
        f"{day}, {minutes:g} minutes, {soaked.robots} robots, {orders} orders, "
        f"machine load at the end {load:.1f}. No program exited. **{said}**"
    )
    parts = [INTRODUCTION.read_text(encoding="utf-8"), head, "", *_latencies(windows), "", *_memory(windows)]
    return "\n".join([*parts, ""])


def _latencies(windows: Sequence[Window]) -> Iterator[str]:
    yield row(["Window", "Orders ended", "Answer p50", "Answer p99", "Order p50", "Order p99", "Yardstick"])
    yield row(["---"] * 7)
    for number, window in enumerate(windows, 1):
        answers = [f"{1000 * value:.0f} ms" for value in _percentiles(window.answers)]
        ends = [f"{value:.1f} s" for value in _percentiles(window.orders)]
        busy = f"{1000 * median(window.yardstick):.0f} ms" if window.yardstick else ""
        yield row([str(number), str(len(window.orders)), *answers, *ends, busy])


def _memory(windows: Sequence[Window]) -> Iterator[str]:
    programs = sorted(windows[0].footprints)
    yield row(["Window", *(f"{each}: MB, descriptors, threads" for each in programs)])
    yield row(["---"] * (1 + len(programs)))
    for number, window in enumerate(windows, 1):
        found = [window.footprints[each] for each in programs]
        yield row(
            [str(number), *(f"{each.megabytes:.1f}, {each.descriptors}, {each.threads}" for each in found)]
        )


def _percentiles(values: Sequence[float]) -> tuple[float, float]:
    """Return the 50th and the 99th percentile."""
    if len(values) < 2:
        return (values[0], values[0]) if values else (float("nan"), float("nan"))
    hundredths = quantiles(values, n=100, method="inclusive")
    return hundredths[49], hundredths[98]


def main() -> int:
    """Run the soak test and write the report."""
    parser = argparse.ArgumentParser(description="Run a site for hours and report drift.")
    parser.add_argument("--minutes", type=float, default=120)
    parser.add_argument("--output", type=Path, default=DOCUMENT)
    wanted = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="nena-soak-"))  # keeps the logs if there are findings
    soaked = asyncio.run(soak(wanted.minutes, folder))
    found, load = findings(soaked), os.getloadavg()[0]
    if not found:
        shutil.rmtree(folder)
    wanted.output.write_text(document(soaked, minutes=wanted.minutes, load=load), encoding="utf-8")
    print("\n".join(found) or "nothing lost, no drift")  # noqa: T201
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
