"""While a robot is stopped on the usual way, the others take a longer one instead of a place behind it."""

from __future__ import annotations

import asyncio

import pytest

from bench.halls import APART_MM, Hall, Sketch, two_halls
from nena_simulate.demand import Demand
from nena_simulate.simulation import observe
from nena_simulate.site import Case, Disturbances, Site
from nena_simulate.virtual_time import VirtualClock, run

STOPPED_AT, STOPPED_FOR = 30.0, 240.0


def ring_with_a_long_way_round() -> Hall:
    """Return a one-way ring with stations on spurs, and a long way round three of its points."""
    sketch, corners = (
        Sketch(),
        [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (6, 0), (6, 2), (3, 2), (0, 2)],
    )
    ring = [
        sketch.point(f"R{number}", column * APART_MM, row * APART_MM)
        for number, (column, row) in enumerate(corners)
    ]
    for here, there in zip(ring, [*ring[1:], ring[0]], strict=True):
        sketch.one_way(here, there)
    around = [sketch.point(f"X{number}", (2 + number) * APART_MM, -3 * APART_MM) for number in range(5)]
    for here, there in zip(["R2", *around], [*around, "R6"], strict=True):
        sketch.one_way(here, there)
    spurs = [sketch.point(f"S{at}", sketch.points[f"R{at}"].x_mm, 3 * APART_MM) for at in (7, 8, 9)]
    for spur in spurs:
        sketch.two_way(spur, f"R{spur[1:]}")
    spurs.append(sketch.point("S0", -APART_MM, 0))
    sketch.two_way("S0", "R0")
    return sketch.hall("ring", spurs)


@pytest.mark.simulation
def test_orders_go_on_around_a_stopped_robot() -> None:
    hall = ring_with_a_long_way_round()
    case = Case(
        plant=hall.plant,
        demand=Demand(backlog=3),
        robots=4,
        hours=(STOPPED_AT + STOPPED_FOR) / 3600,
        speed=3.0,
        work_seconds=2.0,
        disturbances=Disturbances(dead=(STOPPED_AT, STOPPED_FOR), dead_at=("R3", "R4")),
    )

    finishes = observe(case).finishes

    meanwhile = [at for at in finishes if at > STOPPED_AT + 60]
    assert len(meanwhile) > 10, "none was finished when robots queued behind it"


@pytest.mark.simulation
def test_robots_do_not_pile_up_behind_a_robot_that_is_stopped_in_a_door() -> None:
    """There were 23 behind it, now 6; in each hall there are orders that do not lead through the door."""
    case = Case(
        plant=two_halls().plant,
        demand=Demand(backlog=26),
        robots=52,
        hours=150 / 3600,
        speed=1.5,
        disturbances=Disturbances(dead=(60, STOPPED_FOR), dead_at=("A02-05", "B02-00")),
    )

    async def serve(clock: VirtualClock) -> Site:
        site = Site(case, clock)
        await site.run(case.hours * 3600, lambda: asyncio.sleep(0))
        return site

    traffic = run(serve).engine.traffic
    behind = set(traffic._stopped)
    assert len(behind) == 1
    waiting = {
        name: why.vehicles for name in traffic.scheduler.vehicle_names if (why := traffic.refusal_of(name))
    }
    while more := {name for name in waiting if not behind.isdisjoint(waiting[name])} - behind:
        behind |= more
    assert len(behind) <= 20
