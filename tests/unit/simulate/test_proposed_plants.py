"""Plants proposed from robots' maps: orders between random points finish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from nena_plant_formats.from_map.free_space import RobotSize
from nena_plant_formats.from_map.proposal import propose_plant
from nena_plant_formats.from_map.robot_map import read_map
from nena_simulate.demand import Demand, read_orders
from nena_simulate.simulation import simulate
from nena_simulate.site import Case
from support.drawn_maps import Pixels, office, warehouse, write_map

pytestmark = pytest.mark.simulation

ORDERS = 100
EVERY = 15
"""Seconds between two orders."""


@pytest.mark.parametrize("draw", [office, warehouse])
def test_three_robots_finish_a_hundred_orders(tmp_path: Path, draw: Callable[[], Pixels]) -> None:
    read = read_map(write_map(tmp_path, draw()))
    size = RobotSize(width=0.6, length=0.8, clearance=0.1)
    plant = propose_plant(read, size, spacing=3.0, speed=1.0).model
    random, names = Random(7), [point.name for point in plant.points]
    rows = (f"{EVERY * at},{','.join(random.sample(names, 2))}\n" for at in range(ORDERS))
    orders = tmp_path / "orders.csv"
    orders.write_text("at,from,to\n" + "".join(rows), encoding="utf-8")
    case = Case(plant, Demand(), 3, hours=1.2)
    figures = simulate(replace(case, demand=read_orders(orders, plant, case.operations())))
    assert (figures.finished, figures.failed) == (ORDERS, 0)
