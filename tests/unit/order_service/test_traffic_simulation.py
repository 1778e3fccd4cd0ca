"""Fleets on random plants under the real engine: orders end, no robots collide, and none waits for ever."""

from __future__ import annotations

from random import Random

import pytest

from nena_order_service.dispatching.settings import DispatchSettings, ParkingSettings, RechargingSettings
from support.examples import ENGINE_PLANTS
from support.traffic.engine_simulation import Adversity, EngineSimulation
from support.traffic.random_plant import random_plant

pytestmark = pytest.mark.simulation

ORDERS = 50
ROBOTS = (2, 6, 12, 20, 3, 60, 8, 40, 5)
"""Many of them take minutes: they come with the soak."""
LENGTHS_MM = (0, 800, 1500)
AHEAD = (0, 2, 1, 3)
ADVERSITY = (
    Adversity(),
    Adversity(kill=120.0, break_link=60.0, lock=60.0, reroute=20.0),
    Adversity(withdraw=90.0, kill=400.0, hold=60.0),
    Adversity(lock=20.0, reroute=5.0),
)


IDLE_ROBOTS = (6, 8, 30, 14, 60, 3)
FEW = 6
"""So few may have orders or recharge all the time, so that none parks."""
IDLE_ONES_MOVE = DispatchSettings(
    recharging=RechargingSettings(enabled=True), parking=ParkingSettings(enabled=True, delay=0.0)
)


def simulated(seed: int, random: Random, robots: int, dispatch: DispatchSettings) -> EngineSimulation:
    """Return a simulation that has run."""
    plant, stations = random_plant(random, robots)
    simulation = EngineSimulation(
        plant,
        stations,
        random,
        orders=ORDERS,
        ahead=AHEAD[seed % len(AHEAD)],
        length_mm=LENGTHS_MM[seed % len(LENGTHS_MM)],
        adversity=ADVERSITY[seed % len(ADVERSITY)],
        dispatch=dispatch,
    )
    simulation.run()
    return simulation


@pytest.mark.parametrize("seed", range(ENGINE_PLANTS))
def test_every_order_ends_without_a_collision_or_a_standstill(seed: int) -> None:
    simulation = simulated(seed, Random(seed), ROBOTS[seed % len(ROBOTS)], DispatchSettings())

    assert simulation.finished + len(simulation.withdrawn) >= ORDERS
    assert simulation.driven_nodes > ORDERS


@pytest.mark.parametrize("seed", range(max(2, ENGINE_PLANTS // 10)))
def test_parking_and_recharging_vehicles_block_no_orders(seed: int) -> None:
    robots = IDLE_ROBOTS[seed % len(IDLE_ROBOTS)]
    simulation = simulated(seed, Random(1000 + seed), robots, IDLE_ONES_MOVE)

    assert simulation.finished + len(simulation.withdrawn) >= ORDERS
    assert simulation.automatic["Park"] > 0 or robots <= FEW, "few may recharge all the time"
    assert simulation.automatic["Charge"] > 0
