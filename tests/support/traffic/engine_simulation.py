"""A fleet under the real engine: orders, traffic and fleet control as in production, with time compressed.

Messages are late and some are lost; robots lose their links while they drive; the engine is killed and
restarts from its store; orders are withdrawn. The robots' real positions are checked with every move.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random
from typing import NoReturn

from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.life_cycle import BEGUN_MEANWHILE
from nena_order_service.errors import NotReroutableError, VehicleNotReachedError
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.vehicles.parking import BARRED
from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    OrderSequenceStatus,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import ReroutingOutcome, ReroutingType
from nena_shared.plant import PlantModel
from nena_shared.plant_terms import PointType
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey
from support.order_service import request
from support.pausing import turn_passes
from support.scripted_fleet import MemoryStore, key, make_engine
from support.traffic.driving_robot import DrivingRobot
from support.traffic.fitted_plant import with_docks, with_stations
from support.traffic.simulation import CollisionError, StandstillError
from support.traffic.wire import CoreFleet, Timeline, Wire

TICK = 1.0
LOOK = 2.0
REPORT_EACH = 25.0
PATIENCE = 900.0
"""Seconds without anything done, with orders left, that count as a standstill."""

IDLE_PATIENCE = 3600.0
"""Seconds without a destination reached by any host's order: to drive about is not enough."""

DRAIN = 0.4
"""Percent of charge that 1 m takes, of robots that recharge."""


HOSTS = "T"
"""What the names of hosts' orders begin with."""

HOLDABLE = (TransportOrderState.BEING_PROCESSED, TransportOrderState.DISPATCHABLE)


@dataclass(frozen=True)
class Adversity:
    """How often bad things happen, in seconds between two of them; 0: never."""

    kill: float = 0.0
    break_link: float = 0.0
    withdraw: float = 0.0
    hold: float = 0.0
    lock: float = 0.0
    reroute: float = 0.0


class EngineSimulation:
    """Transport orders of two stations each for a fleet, from first to last."""

    engine: Engine

    def __init__(
        self,
        plant: PlantModel,
        stations: tuple[str, ...],
        random: Random,
        *,
        orders: int,
        ahead: int,
        length_mm: int,
        adversity: Adversity | None = None,
        dispatch: DispatchSettings | None = None,
    ) -> None:
        self.plant = with_stations(plant, stations, length_mm)
        self.recharging = bool(dispatch and dispatch.recharging.enabled)
        if self.recharging:
            self.plant = with_docks(self.plant)
        self.random = random
        self.store = MemoryStore()
        self.settings = EngineSettings(
            release_ahead=ahead, default_map_id="hall", dispatch=dispatch or DispatchSettings()
        )
        self.adversity = adversity or Adversity()
        self.timeline = Timeline()
        self.wire = Wire(self.timeline, random)
        self.orders = [random.sample(stations, 2) for _ in range(orders)]
        self.robots = {each.key: each for each in self._make_robots(length_mm)}
        self.fleet = CoreFleet(self.timeline, self.wire, self.robots)
        self.ends: dict[str, TransportOrderStatus] = {}
        self.withdrawn: set[str] = set()
        self.locks: dict[str, bool] = {}
        self.locked = 0
        self.rerouted: Counter[ReroutingOutcome] = Counter()
        self.kills = 0
        self.breaks = 0
        self.finished = 0
        self.reached = 0
        """Destinations of hosts' orders."""
        self.automatic: Counter[str] = Counter()
        """Orders that the order service made by itself and that were finished, by type."""
        self.given_up = 0
        self._done: dict[str, int] = {}
        self._working: set[RobotKey] = set()
        self._left_to_create = orders
        self._next_look_for_trouble = 5.0

    def _make_robots(self, length_mm: int) -> Iterator[DrivingRobot]:
        """Put each vehicle's robot on a point outside of all blocks."""
        points, blocks = self.plant.points, self.plant.blocks
        outside = [each.name for each in points if not any(each.name in one.members for one in blocks)]
        starts = self.random.sample(outside, len(self.plant.vehicles))
        for vehicle, start in zip(self.plant.vehicles, starts, strict=True):
            robot = DrivingRobot(key=key(vehicle.name), plant=self.plant, length_mm=length_mm)
            robot.put_on(start)
            if self.recharging:
                robot.drain, robot.charge = DRAIN, self.random.uniform(25, 100)
            yield robot

    def run(self) -> None:
        """Run until every order is at its end; raises CollisionError or StandstillError."""
        asyncio.run(self._run())

    @property
    def driven_nodes(self) -> int:
        """How many things the robots have done."""
        return sum(robot.progress for robot in self.robots.values())

    async def _run(self) -> None:
        await self._start_engine()
        for number, stops in enumerate(self.orders):
            self._later(number, stops)
        self.timeline.after(TICK, self._tick)
        self.timeline.after(LOOK, self._look)
        for robot in self.robots.values():
            self.timeline.after(self.random.uniform(0, REPORT_EACH), lambda robot=robot: self._report(robot))  # type: ignore[misc] # bound at once
        await self._go_on_while(self._left)
        self._judge()
        self.adversity = Adversity()
        if self.settings.dispatch.parking.enabled:
            await self._go_on_while(self._restless)

    async def _go_on_while(self, wanted: Callable[[], bool]) -> None:
        done, since = -1, self.timeline.clock.seconds
        reached, reached_at = -1, since
        while wanted():
            self.timeline.step()
            await turn_passes()  # the engine goes on with what it does in parts
            now = self.timeline.clock.seconds
            if self.driven_nodes != done:
                done, since = self.driven_nodes, now
            if self.reached != reached:
                reached, reached_at = self.reached, now
            if now - since > PATIENCE or now - reached_at > IDLE_PATIENCE:
                raise StandstillError(self._story())
            if self._strikes(self.adversity.kill):
                await self._kill()

    def _restless(self) -> bool:
        """Return whether anybody has still to park or to recharge, and could."""
        if next(self.engine.state.orders.unfinished(), None) is not None:
            return True
        return any(
            not (robot.charging or self._parks(robot) or self._barred(robot))
            for robot in self.robots.values()
        )

    def _barred(self, robot: DrivingRobot) -> bool:
        """Return whether a robot does not park for the sake of others, which have made room often enough."""
        vehicle = self.engine.registry.of(robot.key)
        return vehicle is not None and str(BARRED) in self.engine.reporter.vehicle_status(vehicle).reason

    def _parks(self, robot: DrivingRobot) -> bool:
        return self.plant.point(robot.last_node_id).type is PointType.PARK_POSITION

    def _later(self, number: int, stops: list[str]) -> None:
        """Create orders as a host: some at once, the others one after the other."""

        def create() -> None:
            self.engine.create(request(*(f"at {stop}:Load" for stop in stops)), f"{HOSTS}{number}")
            self._left_to_create -= 1

        self.timeline.after(2.0 + max(0, number - len(self.robots)) * 2.0, create)

    def _left(self) -> bool:
        return bool(self._left_to_create) or any(map(_of_host, self.engine.state.orders.unfinished()))

    def _strikes(self, mean: float) -> bool:
        """Return whether something bad happens, at about each tick."""
        if not mean or self.timeline.clock.seconds < self._next_look_for_trouble:
            return False
        self._next_look_for_trouble = self.timeline.clock.seconds + TICK
        return self.random.random() < TICK / mean

    async def _start_engine(self) -> None:
        away = self.fleet.away
        self.fleet = CoreFleet(self.timeline, self.wire, self.robots)
        self.fleet.away = away
        self.fleet.on_message = self._told
        self.engine = await make_engine(
            self.plant,
            self.store,
            self.fleet,
            clock=self.timeline.clock,
            settings=self.settings,
            locks=self.locks,
        )
        self.engine.unit_of_work.listeners.append(self)
        self.fleet.connect()

    async def _kill(self) -> None:
        """Kill the order service, and start it again."""
        self.kills += 1
        self.fleet.alive = False
        self.engine.close("it was killed")
        await self._start_engine()

    def _tick(self) -> None:
        self.timeline.after(TICK, self._tick)
        self.fleet.tick()
        for robot in self.robots.values():
            robot.recharge(TICK)
        if self.adversity.break_link and self.random.random() < TICK / self.adversity.break_link:
            self._break(self.random.choice(list(self.robots.values())))
        if self.adversity.withdraw and self.random.random() < TICK / self.adversity.withdraw:
            self._withdraw()
        if self.adversity.hold and self.random.random() < TICK / self.adversity.hold:
            self._hold()
        if self.adversity.lock and self.random.random() < TICK / self.adversity.lock:
            self._lock()
        if self.adversity.reroute and self.random.random() < TICK / self.adversity.reroute:
            self._reroute()

    def _look(self) -> None:
        self.timeline.after(LOOK, self._look)
        self.engine.run_checks()

    def _report(self, robot: DrivingRobot) -> None:
        self.timeline.after(REPORT_EACH, lambda: self._report(robot))
        self.fleet.report(robot)

    def _break(self, robot: DrivingRobot) -> None:
        """Break a robot's link for a while; it drives on to the end of its base."""
        if robot.key in self.fleet.away:
            return
        self.breaks += 1
        self.fleet.away.add(robot.key)
        self.fleet.tell_connection(robot, ConnectionState.CONNECTION_BROKEN)

        def back() -> None:
            self.fleet.away.discard(robot.key)
            self.fleet.tell_connection(robot, ConnectionState.ONLINE)
            self.fleet.report(robot)

        self.timeline.after(self.random.uniform(5, 60), back)

    def _withdraw(self) -> None:
        orders = filter(_of_host, self.engine.state.orders.unfinished())
        alive = [each for each in orders if each.state in HOLDABLE]
        if alive:
            order = self.random.choice(alive)
            self.withdrawn.add(order.name)
            self.engine.withdraw(order.number, "not needed", immediate=self.random.random() < 0.5)

    def _hold(self) -> None:
        """Hold an order for a while, as a person does."""
        orders = filter(_of_host, self.engine.state.orders.unfinished())
        alive = [each for each in orders if each.state in HOLDABLE and not each.held]
        if not alive:
            return
        order = self.random.choice(alive)
        self.engine.hold(order.number, "Ann", "tea", immediate=self.random.random() < 0.5)

        def resume() -> None:
            known = self.engine.state.orders.find(order.number)
            if known and known.held:
                self.engine.resume(order.number, "Ann", "go")

        self.timeline.after(self.random.uniform(5, 120), resume)

    def _lock(self) -> None:
        """Lock a path for a while."""
        path = self.random.choice(self.plant.paths).name
        self.locked += 1
        self._set_lock(path, locked=True)
        self.timeline.after(self.random.uniform(5, 120), lambda: self._set_lock(path, locked=False))

    def _set_lock(self, path: str, *, locked: bool) -> None:
        self.locks[path] = locked
        self.engine.context.finder.set_locks(self.locks)
        self.engine.plant_changed()

    def _reroute(self) -> None:
        """Request a rerouting of a vehicle that works on an order."""
        vehicle = self.random.choice(list(self.engine.registry))
        try:
            done = self.engine.reroute(vehicle, self.random.choice(list(ReroutingType)))
        except (NotReroutableError, VehicleNotReachedError):
            return
        self.rerouted[done.outcome] += 1

    def _told(self, robot: DrivingRobot) -> None:
        """Make a robot that received a message report, and continue."""
        self.fleet.report(robot)
        self._go_on(robot)

    def _go_on(self, robot: DrivingRobot) -> None:
        seconds = robot.depart()
        if seconds is not None:
            self._check(robot)
            self.fleet.report(robot)
            self.timeline.after(seconds, lambda: self._arrive(robot))
        elif robot.key not in self._working and robot.begins_action():
            self._working.add(robot.key)
            self.fleet.report(robot)
            self.timeline.after(self.random.uniform(2, 20), lambda: self._end_action(robot))

    def _arrive(self, robot: DrivingRobot) -> None:
        robot.arrive()
        self._check(robot)
        self._told(robot)

    def _end_action(self, robot: DrivingRobot) -> None:
        self._working.discard(robot.key)
        robot.end_actions()
        self._told(robot)

    def _check(self, robot: DrivingRobot) -> None:
        """Check that no other robot is where this one is, and that it holds all of that."""
        on = robot.resources()
        name = robot.key.serial_number
        for other in self.robots.values():
            if other is not robot and (shared := on & other.resources()):
                self._collided(f"{name} and {other.key.serial_number} are at {sorted(shared)}")
        held = {resource for each in self.engine.traffic.held_by(name) for resource in each.uses}
        if not on <= held:
            self._collided(f"{name} is on {sorted(on - held)}, which it does not hold")

    def _collided(self, what: str) -> NoReturn:
        message = f"{what}\n{self._story()}"
        raise CollisionError(message)

    def _judge(self) -> None:
        """Check that all orders have ended, and well unless they were withdrawn."""
        assert self.ends.keys() == {f"{HOSTS}{number}" for number in range(len(self.orders))}
        for order in self.ends.values():
            finished = order.state is TransportOrderState.FINISHED
            stopped = order.name in self.withdrawn or order.reason == str(BEGUN_MEANWHILE)
            assert finished or stopped, f"{order.name}: {order.reason}"
        self.finished = sum(order.state is TransportOrderState.FINISHED for order in self.ends.values())
        self.withdrawn |= {name for name, order in self.ends.items() if order.reason == str(BEGUN_MEANWHILE)}

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Receive a change of an order, as hosts do."""
        if not status.name.startswith(HOSTS):
            self.automatic[status.type] += status.state is TransportOrderState.FINISHED
            self.given_up += status.state.final and "gives way" in status.reason
            return
        done = sum(each.state is DriveOrderState.FINISHED for each in status.drive_orders)
        self.reached += done - self._done.get(status.name, 0)
        self._done[status.name] = done
        if status.state.final:
            self.ends[status.name] = status

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Receive a change of an order sequence, as hosts do."""

    def _story(self) -> str:
        lines = [f"{self.timeline.clock.seconds:.1f} s, {self.kills} kills, {self.breaks} breaks"]
        for vehicle in self.engine.registry:
            status, held = (
                self.engine.reporter.vehicle_status(vehicle),
                self.engine.traffic.held_by(vehicle.name),
            )
            lines.append(
                f"{vehicle.name} {status.connection} on {self.robots[vehicle.key].body}, "
                f"holds {[each.point for each in held]}, {status.transport_order}: {status.reason}"
            )
        lines += [f"{each.name}: {each.status.reason}" for each in self.engine.state.orders.unfinished()]
        return "\n".join(lines)


def _of_host(order: TransportOrder) -> bool:
    return order.name.startswith(HOSTS)
