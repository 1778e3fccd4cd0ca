"""Measures the examples of docs/hall-planning.md by ``nena simulate``.

``PYTHONPATH=tests python -m bench.planning_examples`` writes a line for each.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

from bench.traffic_halls import APART_MM, SPUR_MM, Hall, Sketch
from nena_shared.plant import PointType
from nena_simulate.demand import Demand, every_relation
from nena_simulate.simulation import simulate_all
from nena_simulate.site import Case

COLUMNS, ROWS = 10, 6
SERVED = ((1, 0), (4, 0), (7, 0), (0, 2), (9, 3), (5, 3), (3, 2), (2, 5), (5, 5), (8, 5))
"""Columns and rows of the stations."""
PARKING = ((0, 0), (3, 0), (6, 0), (9, 0), (0, 5), (3, 5), (6, 5), (9, 5), (0, 3), (9, 1))
ROBOTS = 8
HOURS = 0.5
SPEED, WORK_SECONDS = 1.5, 5.0
PER_HOUR = 150.0
"""Orders, where they do not wait without end."""
PARK = {"kernel": {"dispatch": {"parking": {"enabled": True, "delay": 0.0}}}}


def grid(name: str, *, one_way: bool, spurs: bool, parking: bool = False) -> Hall:
    """Return a hall of 60 points, 4 m apart, with ten stations."""
    sketch = Sketch()
    place = {
        (column, row): sketch.point(f"P{column}-{row}", column * APART_MM, row * APART_MM)
        for column in range(COLUMNS)
        for row in range(ROWS)
    }
    for (column, row), here in place.items():
        for other, against in (((column + 1, row), row % 2), ((column, row + 1), column % 2)):
            if other not in place:
                continue
            ends = here, place[other]
            if one_way and not _outer(column, row, other):
                sketch.one_way(*(reversed(ends) if against else ends))
            else:
                sketch.two_way(*ends)
    stations = [_aside(sketch, "S", place[at]) if spurs else place[at] for at in SERVED]
    for at in PARKING if parking else ():
        _aside(sketch, "W", place[at], PointType.PARK_POSITION)
    return sketch.hall(name, stations)


def _outer(column: int, row: int, other: tuple[int, int]) -> bool:
    """Return whether a path lies at the edge of the hall, where all ways stay two-way."""
    along = row == other[1]
    return row in (0, ROWS - 1) if along else column in (0, COLUMNS - 1)


def _aside(sketch: Sketch, kind: str, point: str, type_: PointType = PointType.HALT_POSITION) -> str:
    aisle, shift = sketch.points[point], SPUR_MM * 7 // 10
    side = -1 if kind == "W" else 1
    spur = sketch.point(f"{kind}{point[1:]}", aisle.x_mm + side * shift, aisle.y_mm + shift, type_)
    sketch.two_way(point, spur)
    return spur


def examples() -> Iterator[Case]:
    """Yield the cases of the guide."""
    two_way = grid("two-way aisles, stations on them", one_way=False, spurs=False)
    one_way = grid("one-way aisles, stations on them", one_way=True, spurs=False)
    spurs = grid("one-way aisles, stations on spurs", one_way=True, spurs=True)
    both = grid("two-way aisles, stations on spurs", one_way=False, spurs=True)
    parking = grid("the same with parking on spurs", one_way=True, spurs=True, parking=True)
    for hall in (two_way, one_way, both, spurs):
        yield _case(hall, ROBOTS)
    for robots in (4, 6, 10, 12, 16):
        yield _case(spurs, robots)
    rates = every_relation(spurs.plant)
    scale = PER_HOUR / len(rates)
    drawn = Demand(relations=tuple(replace(each, per_hour=scale) for each in rates))
    yield replace(_case(spurs, ROBOTS), demand=drawn)
    yield replace(_case(parking, ROBOTS), demand=drawn, settings=PARK)


def _case(hall: Hall, robots: int) -> Case:
    return Case(
        plant=hall.plant,
        demand=Demand(backlog=ROBOTS),
        robots=robots,
        hours=HOURS,
        warm_up=300.0,
        speed=SPEED,
        work_seconds=WORK_SECONDS,
    )


def main() -> None:
    """Measure the examples."""
    cases = list(examples())
    for case, found in zip(cases, simulate_all(cases, jobs=2), strict=True):
        kind = "backlog" if case.demand.backlog else f"{PER_HOUR:.0f} an hour"
        cells = (
            f"{case.plant.name}, {kind}",
            str(case.robots),
            f"{found.orders_per_hour:.0f}",
            f"{found.lead_p50:.0f} / {found.lead_p95:.0f}",
            f"{found.doing['waits']:.0%}",
            f"{found.empty_share:.0%}",
        )
        sys.stdout.write(f"| {' | '.join(cells)} |\n")


if __name__ == "__main__":
    main()
