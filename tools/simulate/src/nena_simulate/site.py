"""The simulated site: the real order service, and edge agents with loopback robots, in one process."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from math import hypot
from pathlib import Path
from random import Random
from typing import Any, Self

from sqlalchemy import create_engine

from nena_edge_agent.actions.robot_ports import RobotPorts
from nena_edge_agent.actions.settings import OperationBase
from nena_edge_agent.agent import RobotAgent
from nena_edge_agent.driver.port import Pose, PoseReport
from nena_edge_agent.extension import Robot
from nena_edge_agent.loopback.control import SimulationControl
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.program import make_registry
from nena_edge_agent.protocol.events import Event
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import DescriptionSettings, EdgeAgentSettings, IntervalSettings, JournalSettings
from nena_order_service.building import make_engine, make_fleet
from nena_order_service.fleet.link import FleetLink
from nena_order_service.routing.router import access_points
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.database import Changes, Unfinished
from nena_order_service.store.store import Store
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import Destination, TransportOrderRequest
from nena_shared.plant import NO_OPERATION, PlantModel, Point, PointType, Vehicle
from nena_shared.plant import property_keys as keys
from nena_shared.plant.driver_properties import OPTIONAL_PARAMETERS, TOPIC_PREFIX
from nena_shared.plant.track import MM_PER_M
from nena_shared.settings import settings_with
from nena_shared.tasks import Supervisor
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.topics import RobotKey
from nena_simulate.demand import (
    Demand,
    DemandError,
    Relation,
    Transport,
    Ways,
    describe_drawn,
    every_relation,
)
from nena_simulate.operations import Operations
from nena_simulate.wire import Broker, Conditions, DirectCodec, DirectReader, Link

MANUFACTURER = "NeNa"
MAP_ID = "simulation"
READY_SECONDS = 120.0
POSE_SECONDS = 30.0
"""Interval between two poses while a robot drives, s, as that of states; it reports each node in any case."""
LOOK = 0.25
"""Seconds between two checks of the backlog."""
NO_VEHICLES = "The plant model has no vehicles: the robots have openTCS's default size."


@dataclass(frozen=True, slots=True)
class Disturbances:
    """Deliberately simulated faults."""

    loss: float = 0.0
    """Share of the messages that get lost."""
    speed_spread: float = 0.0
    """Maximum random deviation of a robot's speed, as a share of it."""
    dead: tuple[float, float] | None = None
    """Time at which a robot stops and falls silent, and for how long, seconds."""
    dead_at: tuple[str, ...] = ()
    """Points of which the robot must have passed one last; empty: any point."""


@dataclass(frozen=True, slots=True)
class Case:
    """Everything that a result depends on."""

    plant: PlantModel
    demand: Demand
    robots: int
    hours: float
    seed: int = 1
    warm_up: float = 0.0
    """Warm-up that is excluded from the figures, seconds."""
    speed: float = 1.0
    """Speed of the robots, m/s."""
    work_seconds: float = 5.0
    """Duration of picking and dropping, seconds."""
    starts: tuple[str, ...] = ()
    """Start points of the first robots; the others start at parking positions, then at random points."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the order service."""
    disturbances: Disturbances = Disturbances()
    encoded: bool = False
    """Whether messages are encoded and decoded as between programs, which only takes longer."""

    def order_service_settings(self) -> OrderServiceSettings:
        """Return the settings of the order service. Raises pydantic's ValidationError."""
        if not self.settings:
            return OrderServiceSettings(plant=Path("-"))
        from nena_order_service.extension import installed  # noqa: PLC0415 - it takes a tenth of the start

        return settings_with(OrderServiceSettings, installed())(plant=Path("-"), **self.settings)

    def operations(self) -> Operations:
        """Return the operations of the plant."""
        return Operations(self.plant, self.order_service_settings().engine.action_types)

    def runs(self, seeds: Sequence[int] = (), parts: int = 1) -> list[Self]:
        """Return the case with each of ``seeds``; or split into ``parts``, each with the next seed.

        Raises:
            DemandError: recorded orders cannot be split.
            ValueError: both are given; the parts of one seed would be those of the next.
        """
        if parts > 1 and len(seeds) > 1:
            message = "several seeds cannot be split into parts; use --parts 1"
            raise ValueError(message)
        if parts > 1 and self.demand.orders:
            message = "recorded orders cannot be simulated in parts; use --parts 1"
            raise DemandError(message)
        shorter = replace(self, hours=self.hours / parts)
        return [replace(shorter, seed=seed + part) for seed in seeds or (self.seed,) for part in range(parts)]


class VolatileStore(Store):
    """Stores nothing: simulated programs are never restarted. A commit takes as long as on a fast disk."""

    def __init__(self, commit_seconds: float) -> None:
        super().__init__(create_engine("sqlite://"))
        self._seconds = commit_seconds

    def commit(self, changes: Changes, then: Callable[[], None]) -> None:
        """Call ``then`` a moment later, in the order of commits."""
        if not changes and not self._then:
            then()
            return
        if not self._then:
            asyncio.get_running_loop().call_later(self._seconds, self._after_commit)
        self._then.append(then)

    async def read_unfinished(self) -> Unfinished:
        """Return nothing."""
        return Unfinished((), {}, 0)

    async def documents(self, kind: str) -> dict[str, str]:  # noqa: ARG002 - as in Store
        """Return nothing."""
        return {}

    def _after_commit(self) -> None:
        waiting, self._then = self._then, []
        for each in waiting:
            each()


COMMIT_SECONDS = 0.004


class SimulatedRobot:
    """A loopback robot with its agent, and the distance it has driven."""

    def __init__(
        self,
        vehicle: Vehicle,
        start: Point,
        case: Case,
        broker: Broker,
        random: Random,
        *,
        operations: tuple[OperationBase, ...],
    ) -> None:
        self.vehicle = vehicle
        self.loaded = False
        """Whether it carries something; set by the observer of its states."""
        self.driven = {False: 0.0, True: 0.0}
        """Metres driven without and with a load."""
        self._last: Pose | None = None
        self.start = start
        self._pose = Pose(start.x_m, start.y_m, 0.0, start.map_id or vehicle.map_id or MAP_ID)
        spread = case.disturbances.speed_spread
        self._speed = case.speed * random.uniform(1 - spread, 1 + spread)
        self.driver: LoopbackDriver
        self.agent: RobotAgent
        self._link = RobotLink()
        self.control = SimulationControl(self._link.cut)
        self._settings = EdgeAgentSettings(
            manufacturer=MANUFACTURER,
            serial_number=vehicle.serial_number or vehicle.name,
            map_id=self._pose.map_id,
            driver="loopback",
            journal=JournalSettings(enabled=False),
            description=DescriptionSettings(maximum_speed=case.speed),
            interval=IntervalSettings(visualization=0.0),
            loopback=LoopbackSettings(drain=0.0, pose_interval=POSE_SECONDS),
            operations=operations,
            # openTCS's properties send them to every robot.
            tolerated_parameters=("edges.orientation", "edges.reachOrientationBeforeEntering"),
        )
        self._broker = broker
        self._encoded = case.encoded

    @property
    def key(self) -> RobotKey:
        """The robot's manufacturer and serial number."""
        return RobotKey(self._settings.manufacturer, self._settings.serial_number)

    async def run(self, clock: Clock) -> None:
        """Serve until cancelled."""
        settings = self._settings
        ports = RobotPorts(None, settings.actions)
        robot = Robot(self.key, self._link, ports.drive, None)
        registry = make_registry(settings, self.control, robot)

        def make_driver(put: Callable[[Event], None], _: Pose | None) -> LoopbackDriver:
            def emit(event: Event) -> None:
                if isinstance(event, PoseReport):
                    self._count_distance(event.pose)
                put(event)

            self.driver = LoopbackDriver(
                settings.loopback, self._pose, emit=emit, clock=clock, speed=self._speed
            )
            self.control.use_driver(self.driver, put)
            return self.driver

        self.agent = RobotAgent(
            settings,
            robot,
            ports.observe_driver(make_driver),
            registry,
            clock=clock,
            make_link=Link.maker(self._broker),
            codec=None if self._encoded else DirectCodec.of(settings.version),
        )
        await self.agent.run(asyncio.Event())

    async def die(self, seconds: float) -> None:
        """Stop and send nothing for ``seconds``."""
        self.driver.set_navigation(available=False, reason="it has broken down")
        self._link.cut(seconds)
        await asyncio.sleep(seconds)
        self.driver.set_navigation(available=True, reason="")

    def _count_distance(self, pose: Pose) -> None:
        if self._last is not None:
            self.driven[self.loaded] += hypot(pose.x - self._last.x, pose.y - self._last.y)
        self._last = pose


class Site:
    """Order service and robots of a case; the engine and the robots can be observed."""

    def __init__(self, case: Case, clock: Clock) -> None:
        self.case = case
        self._clock = clock
        self._random = _random_for(case.seed)
        plant, places = staffed(case, self._random)
        self.plant = plant
        broker = Broker(Conditions(loss=case.disturbances.loss), _random_for(self._random.random()))
        settings = case.order_service_settings()
        self.engine = make_engine(settings, plant, VolatileStore(COMMIT_SECONDS), clock)
        self._mqtt = Link(broker)
        reader = MessageReader if case.encoded else DirectReader
        self.fleet: FleetLink = make_fleet(settings, self._mqtt, self.engine, clock, make_reader=reader)
        operations = case.operations()
        self._make_order = Transport(plant, operations)
        self._relations = _relations_of(case, plant, places)
        self.notes = [] if case.plant.vehicles else [NO_VEHICLES]
        """What the reader of the report must know of the orders and robots."""
        if self._relations != case.demand.relations:
            first = self._make_order(self._relations[0].source, self._relations[0].destination)
            self.notes += filter(None, [describe_drawn(first, operations, plant)])
        offered = operations.actions([order.request for order in case.demand.orders], case.work_seconds)
        self.offered = frozenset(each.action_type for each in offered)
        """The actions that the robots offer; operations have one of their own name, too."""
        self.robots = [
            SimulatedRobot(vehicle, place, case, broker, self._random, operations=offered)
            for vehicle, place in zip(plant.vehicles, places, strict=True)
        ]

    async def run(self, seconds: float, watch: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Serve for ``seconds`` after all robots are connected; ``watch`` observes meanwhile.

        Raises:
            TaskFailedError: a task of the order service, or a robot, has ended.
        """
        over = asyncio.Event()
        async with Supervisor() as supervisor:
            await self.engine.start(self.fleet)
            supervisor.start("mqtt", self._mqtt.run())
            supervisor.start("fleet control", self.fleet.run())
            supervisor.start("engine", self.engine.run())
            for robot in self.robots:
                supervisor.start(f"robot {robot.key}", robot.run(self._clock))
            await self._all_there()
            supervisor.start("observer", watch(), vital=False)
            supervisor.start("hosts", self._give_orders(), vital=False)
            supervisor.start("death", self._let_one_die(), vital=False)
            asyncio.get_running_loop().call_later(seconds, over.set)
            await supervisor.wait(over)

    async def _all_there(self) -> None:
        async with asyncio.timeout(READY_SECONDS):
            while any(self.fleet.view(robot.key).state is None for robot in self.robots):  # noqa: ASYNC110 - they send it
                await asyncio.sleep(LOOK)

    async def _let_one_die(self) -> None:
        """Break down the first robot that drives at one of the chosen points."""
        if self.case.disturbances.dead:
            at, seconds = self.case.disturbances.dead
            await asyncio.sleep(at)
            while not (found := [robot for robot in self.robots if self._may_die(robot)]):  # noqa: ASYNC110 - they drive
                await asyncio.sleep(LOOK)
            await found[0].die(seconds)

    def _may_die(self, robot: SimulatedRobot) -> bool:
        state, places = self.fleet.view(robot.key).state, self.case.disturbances.dead_at
        return robot.driver.is_moving and state is not None and (not places or state.last_node_id in places)

    async def _give_orders(self) -> None:
        """Create orders like hosts."""
        draw, begin = _random_for(self._random.random()), self._clock.monotonic()
        demand = self.case.demand
        if demand.backlog:
            await self._keep_waiting(demand.waiting(self._make_order, self._relations, draw))
        for order in demand.timed(self._make_order, draw):
            await asyncio.sleep(begin + order.at - self._clock.monotonic())
            self._create_order(order.request)

    async def _keep_waiting(self, requests: Iterator[TransportOrderRequest]) -> None:
        while True:
            waiting = len(self.engine.state.orders.dispatchable())
            for request in islice(requests, max(0, self.case.demand.backlog - waiting)):
                self._create_order(request)
            await asyncio.sleep(LOOK)

    def _create_order(self, request: TransportOrderRequest) -> None:
        number = self.engine.state.orders.last_number + 1
        self.engine.create(request, f"TOrder-{number:06d}")


def _random_for(seed: float) -> Random:
    return Random(seed)  # noqa: S311 - it makes examples, no keys


def staffed(case: Case, random: Random) -> tuple[PlantModel, list[Point]]:
    """Return the plant with as many vehicles as the case has robots, and their start points.

    Robots use the plant's frame; the frames of their maps in the model are ignored.
    """
    plant = case.plant
    vehicles = [_with_own_speed(vehicle, case.speed) for vehicle in plant.vehicles[: case.robots]]
    pattern = vehicles[-1] if vehicles else Vehicle(name="Robot")
    taken = {vehicle.name for vehicle in plant.vehicles}
    names = (name for number in range(1, 10**6) if (name := f"Robot-{number:02d}") not in taken)
    vehicles += [
        _with_own_speed(pattern.model_copy(update={"name": name}), case.speed)
        for name in islice(names, case.robots - len(vehicles))
    ]
    own = {key: value for key, value in plant.properties.items() if not key.startswith(keys.MAP_TRANSFORM)}
    staffed_plant = plant.model_copy(update={"vehicles": tuple(vehicles), "properties": own})
    return staffed_plant, _start_points(case, staffed_plant, random)


def _with_own_speed(vehicle: Vehicle, speed: float) -> Vehicle:
    """Return the vehicle with the robot's speed, and with the simulation's map unless the model names one.

    Properties that say how a real robot is addressed, and what its messages lack, do not concern it.
    """
    own = {key: each for key, each in vehicle.properties.items() if not key.startswith(_OF_REAL_ROBOTS)}
    more = {
        keys.VDA5050_MAP_ID: vehicle.map_id or MAP_ID,
        keys.VDA5050_VERSION: "2.1.0",
        # a name may have characters that topics, or those of some brokers, cannot have
        keys.VDA5050_SERIAL_NUMBER: re.sub(r"[/+#$.\s]", "_", vehicle.name),
    }
    speed_mm_s = round(speed * MM_PER_M)
    return vehicle.model_copy(update={"properties": {**own, **more}, "max_velocity_mm_s": speed_mm_s})


_OF_REAL_ROBOTS = (
    keys.VDA5050_MANUFACTURER,
    keys.VDA5050_INTERFACE_NAME,
    keys.VDA5050_INSTANT_ACTIONS_KEY,
    keys.VDA5050_PARAMETERS_AS_TEXT,
    keys.VDA5050_KEEPS_LAST_NODE_STATES,
    TOPIC_PREFIX,
    OPTIONAL_PARAMETERS,
)


def check(case: Case) -> None:
    """Raise ValueError if the robots have no place in the plant, or no order can be drawn there."""
    _relations_of(case, *staffed(case, _random_for(case.seed)))


def _relations_of(case: Case, plant: PlantModel, places: Sequence[Point]) -> tuple[Relation, ...]:
    """Return the relations of the demand; of a mere backlog, those that the vehicles can serve."""
    if case.demand.relations or not case.demand.backlog:
        return case.demand.relations
    found = every_relation(plant, case.operations(), [place.name for place in places])
    if not found:
        message = "no vehicle can drive from one location to another one and back"
        if not any(location.links and not location.locked for location in plant.locations):
            message = "the plant has no location that is linked to a point"
        message = f"no orders can be drawn: {message}; --orders gives orders between points"
        raise DemandError(message)
    return found


def _start_points(case: Case, plant: PlantModel, random: Random) -> list[Point]:
    """Return a start point for each vehicle, from which it reaches a station."""
    operations = case.operations()
    named = [plant.point(start) for start in case.starts]
    relations = case.demand.relations or every_relation(plant, operations)
    sources, goals = (
        {
            point
            for place in places
            for point in access_points(Destination(location_name=place, operation=NO_OPERATION), plant)
        }
        for places in ({each.source for each in relations}, {each.destination for each in relations})
    )
    parking = [point for point in plant.points if point.type is PointType.PARK_POSITION]
    free = [point for point in plant.points if point.name not in sources | goals]
    places = {each.name: each for each in (*named, *parking, *random.sample(free, len(free)), *plant.points)}
    ways, chosen = Ways(plant, operations), list[Point]()
    for vehicle in plant.vehicles:
        found = next((name for name in places if not sources or ways.is_way((name,), sources, vehicle)), None)
        if found is None or len(chosen) == len(plant.points) - 1:  # on full points, none could drive
            message = (
                f"{case.robots} robots do not fit: of {len(plant.points)} points, no other one that leads to "
                f"a station is free for vehicle {vehicle.name!r}, number {len(chosen) + 1}"
            )
            raise ValueError(message)
        chosen.append(places.pop(found))
    return chosen
