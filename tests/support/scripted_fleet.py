"""Fleet control whose robots are controlled by the test, and a store that is always done."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from nena_order_service.engine.context import Context, EngineSettings, FleetControl
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.state import FleetState
from nena_order_service.fleet.failures import FailureKind, RobotBusyError
from nena_order_service.fleet.outputs import (
    ActionRetriable,
    BaseWanted,
    InstantActionEnded,
    NodePassed,
    OperationStarted,
    RobotChanged,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.robot import Availability, LinkStatus, RobotView
from nena_order_service.fleet.vda_order import OperationMap, VdaOrder, released_to, with_kept_base
from nena_order_service.orders.vda_orders import OrderPlanner
from nena_order_service.routing.router import RouteFinder, Router
from nena_order_service.store.database import Changes, Unfinished
from nena_order_service.store.store import Store
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import FailurePolicy, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.fleet_examples import state


def key(name: str) -> RobotKey:
    """Return the robot of the vehicle called ``name``."""
    return RobotKey("NeNa", name)


class MemoryStore(Store):
    """Keeps what a restart restores; while it is ``held``, commits do not complete."""

    def __init__(self) -> None:
        self.held = False
        self.commits = 0
        self._answers = set()
        self._loss = ""
        self.found = Unfinished((), {}, 0)
        self._waiting: list[Callable[[], None]] = []
        self._orders: dict[int, object] = {}
        self._order_of: dict[str, int] = {}
        self._relocations: dict[str, str] = {}
        self.kept: dict[tuple[str, str], str] = {}
        """Documents by kind and name."""

    def commit(self, changes: Changes, then: Callable[[], None]) -> None:
        self.commits += 1
        orders = {order.number: order for order in self.found.orders}
        orders.update({number: change.order for number, change in changes.orders.items()})
        sequences = {each.number: each for each in self.found.sequences} | changes.sequences
        for each, document in changes.documents.items():
            self.kept.pop(each, None)
            if document is not None:
                self.kept[each] = document
        drives = dict(self.found.drives)
        for robot, drive in changes.drives.items():
            drives.pop(self._order_of.pop(robot, -1), None)
            self._relocations.pop(robot, None)
            if drive and drive.order_number is not None:
                self._order_of[robot] = drive.order_number
                drives[drive.order_number] = drive.document()
            elif drive:
                self._relocations[robot] = drive.document()
        self.found = Unfinished(
            tuple(order for order in orders.values() if not order.state.final),
            drives,
            max(orders, default=0),
            tuple(self._relocations.values()),
            {**self.found.vehicles, **{robot: each() for robot, each in changes.vehicles.items()}},
            sequences=tuple(each for each in sequences.values() if not each.status.finished),
            last_sequence=max(sequences, default=0),
        )
        self._waiting.append(then)
        if not self.held:
            self.release()

    def release(self) -> None:
        """Complete all waiting commits."""
        self.held = False
        while self._waiting:
            self._waiting.pop(0)()

    def release_one(self) -> None:
        """Complete the oldest waiting commit, and hold the rest."""
        self._waiting.pop(0)()

    async def read_unfinished(self) -> Unfinished:
        return self.found

    async def documents(self, kind: str) -> dict[str, str]:
        return {name: document for (of, name), document in self.kept.items() if of == kind}


class ForgetfulStore(MemoryStore):
    """Is done with each commit at once, whatever else there is, and keeps nothing."""

    def commit(self, changes: Changes, then: Callable[[], None]) -> None:
        del changes
        then()


@dataclass
class ScriptedFleet:
    """Robots that are online at a point and accept a VDA order; the test emits their events."""

    at: dict[str, str]
    """Where each robot stands, by the vehicle's name."""
    mute: set[str] = field(default_factory=set)
    """Robots that have told no state."""
    unheard: set[str] = field(default_factory=set)
    """Robots of which nothing is known, not even whether they are connected."""
    unreadable: set[str] = field(default_factory=set)
    """Robots whose last states say where they are, but are unreadable otherwise."""
    stale: set[str] = field(default_factory=set)
    """Robots whose states are from before they connected."""
    fields: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What else the states of robots say."""
    factsheets: dict[str, Factsheet] = field(default_factory=dict)
    out_of_order: set[str] = field(default_factory=set)
    """Robots that take no orders."""
    unknown: bool = False
    """Whether the broker has not told yet which robots there are."""
    connected: float = 1e9
    """Seconds for which the broker is there."""
    notes: dict[str, str] = field(default_factory=dict)
    """What each robot's VDA order waits for."""
    engine: Engine | None = None
    missions: dict[RobotKey, VdaOrder] = field(default_factory=dict)
    sent: list[tuple[str, VdaOrder]] = field(default_factory=list)
    adopted: list[tuple[str, str, bool]] = field(default_factory=list)
    extended: list[tuple[str, VdaOrder]] = field(default_factory=list)
    updates: dict[str, int] = field(default_factory=dict)
    """The update that each VDA order was adopted with."""
    cancelled: list[str] = field(default_factory=list)
    actions: list[tuple[str, str]] = field(default_factory=list)
    instants: list[Action] = field(default_factory=list)
    """The instant actions that robots were sent."""

    def start_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        if robot in self.missions:
            raise RobotBusyError(robot, self.missions[robot].order_id)
        self.missions[robot] = vda_order
        self.sent.append((robot.serial_number, vda_order))

    def extend_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        with_kept_base(self.missions[robot], vda_order)
        self.missions[robot] = vda_order
        self.extended.append((robot.serial_number, vda_order))

    def release_base(self, robot: RobotKey, order_id: str, sequence_id: int | None) -> None:
        plan = self.missions[robot]
        assert plan.order_id == order_id
        last = plan.last_sequence_id if sequence_id is None else sequence_id
        self.extend_vda_order(robot, released_to(plan, last))

    def pass_node(self, name: str, index: int) -> None:
        """Report that a robot has passed the ``index``-th node of its VDA order."""
        vda_order = self.missions[key(name)]
        node = vda_order.nodes[index]
        self._tell(NodePassed(key(name), vda_order.order_id, node.node_id, node.sequence_id))

    def want_base(self, name: str) -> None:
        """Report that a robot needs more base."""
        self._tell(BaseWanted(key(name), self.missions[key(name)].order_id))

    def adopt_vda_order(
        self, robot: RobotKey, vda_order: VdaOrder, *, accepted: bool, update_id: int = 0
    ) -> None:
        self.missions[robot] = vda_order
        self.updates[robot.serial_number] = update_id
        self.adopted.append((robot.serial_number, vda_order.order_id, accepted))

    def cancel_vda_order(self, robot: RobotKey) -> None:
        self.cancelled.append(robot.serial_number)

    def instant_action(self, robot: RobotKey, action: Action) -> None:
        self.actions.append((robot.serial_number, action.action_type))
        self.instants.append(action)

    def all_known(self) -> bool:
        return not self.unknown

    def connected_for(self) -> float:
        return self.connected

    def view(self, robot: RobotKey) -> RobotView:
        here = robot.serial_number in self.at
        busy = robot in self.missions
        free = here and not busy and robot.serial_number not in self.out_of_order
        told = here and robot.serial_number not in self.mute
        note = self.notes.get(robot.serial_number)
        return RobotView(
            key=robot,
            link=self._link(robot.serial_number),
            vehicle_state=_vehicle_state(free=free, busy=here and busy),
            availability=Availability(free, self._reason(robot.serial_number, free=free, busy=busy)),
            state=self._state(robot) if told else None,
            state_at=self.engine.clock.monotonic() + 0.001 if here and self.engine else None,
            factsheet=self.factsheets.get(robot.serial_number),
            order_id=None,
            order_phase=None,
            wait_reason=Reason.of(note) if busy and note else None,
            malformed=0,
            stale=robot.serial_number in self.stale,
        )

    def _reason(self, name: str, *, free: bool, busy: bool) -> Reason:
        if name in self.at and name in self.mute | self.stale:
            return Reason(ReasonCode.STATELESS)
        return Reason.of("is free" if free else "is busy" if busy else "is offline")

    def _link(self, name: str) -> LinkStatus:
        if name in self.at:
            return LinkStatus.UNREADABLE if name in self.unreadable else LinkStatus.ONLINE
        return LinkStatus.UNKNOWN if name in self.unheard else LinkStatus.OFFLINE

    def _state(self, robot: RobotKey) -> State:
        name = robot.serial_number
        return state(robot=robot, last_node_id=self.at[name], **self.fields.get(name, {}))

    def appear(self, name: str, point: str) -> None:
        """Connect a robot at a point."""
        self.at[name] = point
        self._tell(RobotChanged(key(name)))

    def hinder(self, name: str, note: str) -> None:
        """Report that a robot cannot continue, or with an empty note that it can again."""
        self.notes[name] = note
        self._tell(RobotChanged(key(name)))

    def accept(self, name: str) -> None:
        """Report that a robot has echoed its VDA order."""
        self._tell(VdaOrderAccepted(key(name), self.missions[key(name)].order_id))

    def finish(self, name: str, *, at: str | None = None) -> bool:
        """Finish a robot's VDA order, by default at its end.

        The robot drives to the end of its base; return False if the order goes on behind it.
        """
        robot = key(name)
        while not (base := self.missions[robot].nodes)[-1].released:
            reached = [node.released for node in base].index(False) - 1
            self.at[name] = base[reached].node_id
            self.pass_node(name, reached)
            if self.missions[robot].nodes == base:
                return False
        vda_order = self.missions.pop(robot)
        self.at[name] = at or vda_order.nodes[-1].node_id
        self._tell(VdaOrderFinished(key(name), vda_order.order_id))
        self._tell(RobotChanged(key(name)))
        return True

    def fail(
        self, name: str, reason: str = "wheel lost", kind: FailureKind = FailureKind.DRIVE, *, at: str = ""
    ) -> None:
        """Fail a robot's VDA order; by default the robot stays where it is."""
        vda_order = self.missions.pop(key(name))
        self.at[name] = at or self.at[name]
        self._tell(VdaOrderFailed(key(name), vda_order.order_id, Reason.of(reason), ("FATAL wheel",), kind))
        self._tell(RobotChanged(key(name)))

    def fail_operation(self, name: str) -> None:
        """Fail a robot's operation at the end of its VDA order."""
        self.operate(name)
        self.fail(
            name, "the action has failed", FailureKind.ACTION, at=self.missions[key(name)].nodes[-1].node_id
        )

    def operate(self, name: str) -> None:
        """Start a robot's operation at the end of its VDA order."""
        vda_order = self.missions[key(name)]
        self.pass_node(name, len(vda_order.nodes) - 1)
        self._tell(OperationStarted(key(name), vda_order.order_id))

    def wait_for_retry(self, name: str) -> None:
        """Fail an action of a robot's VDA order that may be retried."""
        vda_order = self.missions[key(name)]
        failed = vda_order.actions[0].action_id
        self._tell(ActionRetriable(key(name), vda_order.order_id, failed, Reason.of("the action has failed")))

    def answer_instant(self, name: str, status: ActionStatus) -> None:
        """End the last instant action that was sent to a robot."""
        self._tell(InstantActionEnded(key(name), self.instants[-1], status, Reason.of("done")))

    def confirm_cancel(self, name: str) -> None:
        """Confirm the cancellation of a robot's VDA order."""
        vda_order = self.missions.pop(key(name))
        self._tell(VdaOrderCancelled(key(name), vda_order.order_id))
        self._tell(RobotChanged(key(name)))

    def _tell(self, news: object) -> None:
        assert self.engine is not None
        self.engine.on_events(news)  # type: ignore[arg-type] # one of the news above


class EngineFleet(FleetControl, Protocol):
    """Fleet control that passes its events to an engine."""

    engine: Engine | None


def make_state(*vehicles: Vehicle) -> FleetState:
    """Make a state with these vehicles, and without orders."""
    plant = PlantModel(name="empty", vehicles=vehicles)
    return FleetState(VehicleRegistry(plant, default_map_id="", adopt_unknown=False))


def make_context(
    plant: PlantModel,
    *,
    clock: ManualClock | None = None,
    settings: EngineSettings | None = None,
    on_failure: FailurePolicy = (),
    locks: Mapping[str, bool] | None = None,
) -> Context:
    """Make what flows work with, over ``plant``; no robot is connected."""
    settings = settings or EngineSettings(default_map_id="map")
    finder = RouteFinder(plant, Router(plant), without_host_locks=Router(plant))
    finder.set_locks(locks or {})
    planner = OrderPlanner(
        plant,
        finder,
        OperationMap(),
        speed_limits=settings.speed_limits,
        peripherals=settings.peripherals.enabled,
    )
    registry = VehicleRegistry(plant, default_map_id=settings.default_map_id, adopt_unknown=False)
    return Context(planner, registry, settings, clock or ManualClock(), on_failure=on_failure)


async def make_engine(
    plant: PlantModel,
    store: MemoryStore,
    fleet: EngineFleet,
    *,
    release_ahead: int = 0,
    clock: ManualClock | None = None,
    settings: EngineSettings | None = None,
    on_failure: FailurePolicy = (),
    locks: Mapping[str, bool] | None = None,
) -> Engine:
    """Start an engine, as after a restart, over ``store`` and ``fleet``."""
    settings = settings or EngineSettings(
        release_ahead=release_ahead, release_seconds=0.0, default_map_id="map"
    )
    context = make_context(plant, clock=clock, settings=settings, on_failure=on_failure, locks=locks)
    engine = Engine(context, store)
    fleet.engine = engine
    await engine.load_stops()
    await engine.start(fleet)
    return engine


async def engine_at(
    plant: PlantModel,
    places: Mapping[str, str],
    store: MemoryStore | None = None,
    *,
    fields: Mapping[str, dict[str, Any]] | None = None,
    release_ahead: int = 0,
    clock: ManualClock | None = None,
    settings: EngineSettings | None = None,
) -> tuple[Engine, ScriptedFleet]:
    """Start an engine with robots that have appeared at these points; ``fields`` go into their states."""
    fleet = ScriptedFleet(dict(places), fields=dict(fields or {}))
    engine = await make_engine(
        plant, store or MemoryStore(), fleet, release_ahead=release_ahead, clock=clock, settings=settings
    )
    for name, at in places.items():
        fleet.appear(name, at)
    return engine, fleet


async def engine_with(
    plant: PlantModel, store: MemoryStore | None = None, *, release_ahead: int = 0, **places: str
) -> tuple[Engine, ScriptedFleet]:
    """Start an engine with robots at these points: ``engine_with(PLANT, V1="A")``."""
    return await engine_at(plant, places, store, release_ahead=release_ahead)


def later(engine: Engine, seconds: float) -> None:
    """Advance the time of an engine made by :func:`make_engine`."""
    assert isinstance(engine.clock, ManualClock)
    engine.clock.advance(seconds)
    engine.run_checks()


def sent(fleet: ScriptedFleet) -> list[tuple[str, str]]:
    """Return the robots and ids of all VDA orders that were sent."""
    return [(robot, vda_order.order_id) for robot, vda_order in fleet.sent]


def reason_of(engine: Engine, name: str = "V1") -> str:
    """Return the reason in the status of a vehicle, which has to be there."""
    vehicle = engine.registry.named(name)
    assert vehicle
    return engine.reporter.vehicle_status(vehicle).reason


def status_of(engine: Engine, name: str = "T") -> TransportOrderStatus:
    """Return the status of an order, which must exist."""
    order = engine.state.orders.visible_named(name)
    assert order
    return order.status


def _vehicle_state(*, free: bool, busy: bool) -> VehicleState:
    if free:
        return VehicleState.IDLE
    return VehicleState.EXECUTING if busy else VehicleState.UNKNOWN
