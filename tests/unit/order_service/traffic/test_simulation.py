"""Fleets on random plants: every order is finished, nobody collides, nothing ever stands still for good."""

from __future__ import annotations

from random import Random

import pytest

from support.examples import PLANTS
from support.traffic.random_plant import random_plant
from support.traffic.simulation import Simulation

ORDERS = 50
ROBOTS = (2, 3, 5, 8, 12, 40, 20, 60)
LENGTHS_MM = (0, 800, 1500)


@pytest.mark.parametrize("seed", range(PLANTS))
def test_every_order_is_finished_without_a_collision_or_a_standstill(seed: int) -> None:
    random, robots = Random(seed), ROBOTS[seed % len(ROBOTS)]
    plant, stations = random_plant(random, robots)
    simulation = Simulation(
        plant, stations, random, orders=ORDERS, length_mm=LENGTHS_MM[seed % len(LENGTHS_MM)]
    )

    simulation.run()

    assert simulation.finished == ORDERS
    assert simulation.driven_mm > 0
