"""Simulates traffic control with single parts switched off: what each of them brings (decision 0038).

``PYTHONPATH=tests PYTHONHASHSEED=0 python -m bench.traffic_ablation aisles 50 --seeds 1,2 --without pushing``
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Any

from bench.traffic import Extent, case_of
from bench.traffic_halls import HALLS
from nena_order_service.engine.rerouting import Rerouting
from nena_order_service.traffic import traffic_control
from nena_order_service.traffic.evasion import Evader
from nena_order_service.traffic.traffic_control import TrafficControl
from nena_shared import log
from nena_shared.settings import LogSettings
from nena_simulate.simulation import simulate


@dataclass(frozen=True)
class Part:
    """One part, and how it is switched off: by settings, or by a change to the code."""

    what: str
    kernel: Mapping[str, Any] | None = None
    switch_off: Callable[[], None] = lambda: None


def _no_planning() -> None:
    traffic_control.CONGESTION = traffic_control.ONCOMING = 0.0


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


def main() -> None:
    """Simulate one case; the change lasts as long as the process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hall", choices=HALLS)
    parser.add_argument("robots", type=int)
    parser.add_argument("--without", choices=PARTS, default="nothing")
    parser.add_argument("--seeds", default="1")
    parser.add_argument("--minutes", type=float, default=2.0)
    arguments = parser.parse_args()
    log.configure(LogSettings(level="error"))
    part = PARTS[arguments.without]
    part.switch_off()
    case = case_of(HALLS[arguments.hall](), arguments.robots, Extent(minutes=arguments.minutes, warm_up=1.0))
    settings = {"kernel": dict(part.kernel)} if part.kernel else {}
    found = [
        simulate(replace(case, seed=int(seed), settings=settings)) for seed in arguments.seeds.split(",")
    ]
    rates = [round(each.orders_per_hour / 60, 1) for each in found]
    waits = fmean(each.doing["waits"] for each in found)
    sys.stdout.write(
        f"{arguments.hall}, {arguments.robots} robots, without {part.what}: {fmean(rates):.1f} {rates}, "
        f"{waits:.0%} waiting, {sum(each.failed for each in found)} failed\n"
    )


if __name__ == "__main__":
    main()
