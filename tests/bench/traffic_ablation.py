"""Simulates traffic control with single parts switched off: what each of them brings (decision 0038).

``PYTHONPATH=tests PYTHONHASHSEED=0 python -m bench.traffic_ablation aisles 50 --seeds 1,2 --without pushing``

With ``--core`` traffic control alone is simulated: the oldest order gets the nearest robot, no messages are
sent, and waiting robots get no new routes. That takes a fraction of the time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from random import Random
from statistics import fmean
from typing import Any

from bench.pibt import WORK_SECONDS
from bench.traffic import Extent, case_of
from bench.traffic_halls import HALLS, ROBOT_MM, SPEED_MM_S, Hall
from nena_order_service.engine.rerouting import Rerouting
from nena_order_service.traffic import route_search, traffic_control
from nena_order_service.traffic.evasion import Evader
from nena_order_service.traffic.traffic_control import TrafficControl
from nena_shared import log
from nena_shared.settings import LogSettings
from nena_simulate.simulation import simulate
from support.traffic.simulation import Simulation


@dataclass(frozen=True)
class Part:
    """One part, and how it is switched off: by settings, or by a change to the code."""

    what: str
    kernel: Mapping[str, Any] | None = None
    switch_off: Callable[[], None] = lambda: None


def _no_planning() -> None:
    route_search.CONGESTION = route_search.ONCOMING = 0.0


def _no_new_routes() -> None:
    Rerouting.kept_waiting = lambda _: ()  # type: ignore[method-assign, assignment]


def _no_pushing() -> None:
    Evader.evade = lambda *_: iter(())  # type: ignore[method-assign]


def _no_right_of_way() -> None:
    claim = TrafficControl._claim_section

    def without(self: TrafficControl, vehicle: str, ahead: Any, _: object, **more: int) -> Any:
        return claim(self, vehicle, ahead, None, **more)

    TrafficControl._claim_section = without  # type: ignore[assignment]


def _whole_routes() -> None:
    traffic_control.SECTION = 10_000


PARTS: Mapping[str, Part] = {
    "nothing": Part("nothing"),
    "planning": Part("routes avoid traffic", switch_off=_no_planning),
    "rerouting": Part("new routes for waiting robots", switch_off=_no_new_routes),
    "pushing": Part("robots at rest make room", switch_off=_no_pushing),
    "right-of-way": Part("the oldest waiting robot reserves its section", switch_off=_no_right_of_way),
    "sections": Part("claims by sections instead of whole routes", switch_off=_whole_routes),
    "bases": Part("bases as long as needed instead of whole sections", {"release_seconds": 0.0}),
    "assignment": Part("orders and robots assigned together", {"dispatch": {"choosers": "ORDERS"}}),
    "crowding": Part("orders to crowded stations are dearer", {"dispatch": {"crowding": 0.0}}),
}


IN_CORE = ("nothing", "planning", "pushing", "right-of-way", "sections")
"""Parts of traffic control itself."""
BACKLOG = 100_000


class Core(Simulation):
    """Traffic control alone, with a backlog that never empties."""

    def __init__(self, hall: Hall, robots: int, seed: int) -> None:
        stations = tuple(hall.station_points.values())
        plant, random = hall.with_robots(robots), Random(seed)
        super().__init__(plant, stations, random, orders=BACKLOG, length_mm=ROBOT_MM)
        self.speed = SPEED_MM_S

    def work_seconds(self) -> float:
        """Return how long a vehicle works at a station."""
        return WORK_SECONDS

    def orders_per_minute(self, minutes: float) -> float:
        """Run for so long after a minute of warm-up."""
        while self.now < 60 and self.step():
            pass
        before = self.finished
        while self.now < 60 * (1 + minutes) and self.step():
            pass
        return (self.finished - before) / minutes


def main() -> None:
    """Simulate one case; the change lasts as long as the process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hall", choices=HALLS)
    parser.add_argument("robots", type=int)
    parser.add_argument("--without", choices=PARTS, default="nothing")
    parser.add_argument("--seeds", default="1")
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--core", action="store_true", help="traffic control alone")
    arguments = parser.parse_args()
    if arguments.core and arguments.without not in IN_CORE:
        parser.error(f"--core can only be without {', '.join(IN_CORE[1:])}")
    log.configure(LogSettings(level="error"))
    part = PARTS[arguments.without]
    part.switch_off()
    hall, robots, minutes = HALLS[arguments.hall](), arguments.robots, arguments.minutes
    seeds = [int(seed) for seed in arguments.seeds.split(",")]
    sys.stdout.write(f"{arguments.hall}, {robots} robots, without {part.what}: ")
    if arguments.core:
        rates = [Core(hall, robots, seed).orders_per_minute(minutes) for seed in seeds]
        sys.stdout.write(f"{_summary(rates)}, traffic control alone\n")
        return
    case = case_of(hall, robots, Extent(minutes=minutes, warm_up=1.0))
    settings = {"kernel": dict(part.kernel)} if part.kernel else {}
    found = [simulate(replace(case, seed=seed, settings=settings)) for seed in seeds]
    waits = fmean(each.doing["waits"] for each in found)
    failed = sum(each.failed for each in found)
    rates = [each.orders_per_hour / 60 for each in found]
    sys.stdout.write(f"{_summary(rates)}, {waits:.0%} waiting, {failed} failed\n")


def _summary(rates: list[float]) -> str:
    return f"{fmean(rates):.1f} {[round(each, 1) for each in rates]}"


if __name__ == "__main__":
    main()
