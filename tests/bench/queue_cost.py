"""(q) What an order costs in the order service's engine while others wait, beside one without a queue.

Microseconds of CPU in this process, for an order from its creation to its end: life cycle, dispatching,
routes and traffic control, without HTTP, database, broker and robots' messages. The least of several rounds.
"""

from __future__ import annotations

import logging
from random import Random
from time import process_time

import structlog

from bench.figures import Figures
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.pausing import turn_passes
from support.plants import grid_name, grid_plant
from support.scripted_fleet import ForgetfulStore, ScriptedFleet, make_engine

COLUMNS, ROWS = 20, 10
ROBOTS = 10
WAITING = 4_000
"""Orders that wait."""
ROUNDS = 5
ORDERS = 20
"""Orders that end in each round."""
PARTS = 50
"""Maximum number of times that a robot drives to the end of its base."""


async def measure() -> Figures:
    """Measure with an empty queue and with a long one; the ratio is that of the rates."""
    quiet = structlog.make_filtering_bound_logger(logging.CRITICAL)
    structlog.configure(wrapper_class=quiet)
    try:
        empty, long = await _least(0), await _least(WAITING)
    finally:
        structlog.reset_defaults()
    return {
        "robots": ROBOTS,
        "waiting": WAITING,
        "empty_queue_us": empty * 1e6,
        "long_queue_us": long * 1e6,
        "rate_of_empty_queue": empty / long,
    }


async def _least(waiting: int) -> float:
    """Return the CPU time of an order, seconds, while so many others wait."""
    site = await _Site.started()
    for _ in range(waiting + ROBOTS):
        site.create()
    await site.end_orders(ORDERS)
    rounds = []
    for _ in range(ROUNDS):
        begin = process_time()
        ended = await site.end_orders(ORDERS)
        rounds.append((process_time() - begin) / ended)
    return min(rounds)


class _Site:
    """Robots on a grid that do at once what they are sent; each order that ends is replaced by a new one."""

    def __init__(self, engine: Engine, fleet: ScriptedFleet) -> None:
        self._engine = engine
        self._fleet = fleet
        self._lot = Random(1)
        self._made = 0

    @classmethod
    async def started(cls) -> _Site:
        """Start the engine with all robots at rest in the first row."""
        names = [f"V{index}" for index in range(ROBOTS)]
        grid = grid_plant(COLUMNS, ROWS)
        plant = PlantModel(
            name="grid",
            points=grid.points,
            paths=grid.paths,
            vehicles=tuple(Vehicle(name=name) for name in names),
        )
        fleet = ScriptedFleet({name: grid_name(2 * index, 0) for index, name in enumerate(names)})
        settings = EngineSettings(default_map_id="map")
        engine = await make_engine(plant, ForgetfulStore(), fleet, settings=settings)
        for name, place in tuple(fleet.at.items()):
            fleet.appear(name, place)
        return cls(engine, fleet)

    def create(self) -> None:
        """Create an order to a random point."""
        self._made += 1
        point = grid_name(self._lot.randrange(COLUMNS), self._lot.randrange(ROWS))
        self._engine.create(request(point), f"T{self._made}")

    async def end_orders(self, number: int) -> int:
        """Let robots drive until so many orders have ended; return their number."""
        before = ended = self._ended()
        while ended - before < number:
            for robot in tuple(self._fleet.missions):
                parts = PARTS
                while parts and not self._fleet.finish(robot.serial_number):
                    parts -= 1
                for _ in range(self._ended() - ended):
                    ended += 1
                    self.create()
            await turn_passes()
        return ended - before

    def _ended(self) -> int:
        return self._engine.state.orders.statistics.ended[TransportOrderState.FINISHED]
