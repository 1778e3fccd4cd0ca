"""Fleets on random plants: every order is finished, nobody collides, nothing ever stands still for good.

``NENA_PLANTS`` sets how many plants there are.
"""

from __future__ import annotations

import os
from random import Random

import pytest

from support.traffic.random_plant import random_plant
from support.traffic.simulation import Simulation

PLANTS = int(os.environ.get("NENA_PLANTS", "16"))
ORDERS = 50
ROBOTS = (2, 3, 5, 8, 12, 20, 40, 60)
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
