"""Fleets on random plants: every order is finished, no robots collide, and none waits for ever."""

from __future__ import annotations

from random import Random

import pytest

from support.examples import PLANTS
from support.traffic.random_plant import random_plant, random_roads
from support.traffic.simulation import Simulation

pytestmark = pytest.mark.simulation

ORDERS = 50
ROBOTS = (2, 3, 5, 8, 12, 40, 20, 60)
LENGTHS_MM = (0, 800, 1500)
POINTS_EACH = (3, 5, 8)
ROBOTS_ON_ROADS = (2, 3, 5, 8, 12, 20, 40, 60)


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


@pytest.mark.parametrize("seed", range(PLANTS))
def test_every_order_is_finished_on_two_way_road_maps(seed: int) -> None:
    """Seed 4 has a vehicle that makes room for one which it encloses, and must not come back at once."""
    random, robots = Random(seed), ROBOTS_ON_ROADS[seed % len(ROBOTS_ON_ROADS)]
    plant, stations = random_roads(random, robots, points_each=POINTS_EACH[seed % len(POINTS_EACH)])
    simulation = Simulation(
        plant, stations, random, orders=2 * ORDERS, length_mm=LENGTHS_MM[seed % len(LENGTHS_MM)]
    )

    simulation.run()

    assert simulation.finished == 2 * ORDERS


def test_traffic_decides_again_after_the_last_event() -> None:
    """The last event closes a ring of waiting vehicles: only the next decision sends one of them away."""
    random = Random(129)
    plant, stations = random_roads(random, 5)
    simulation = Simulation(plant, stations, random, orders=ORDERS, length_mm=0)

    simulation.run()

    assert simulation.finished == ORDERS
