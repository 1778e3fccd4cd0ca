"""Driving: which vehicles can drive, and what their robots are sent, as traffic lets them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial

from nena_order_service.dispatching.way import Way
from nena_order_service.fleet import (
    FailureKind,
    LinkStatus,
    MissionFailed,
    NotLocatedError,
    RobotBusyError,
    RobotView,
    Standing,
)
from nena_order_service.kernel.instant_actions import state_request
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.ports import FleetControl
from nena_order_service.kernel.steps import Steps
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import MissionPlanner, MissionRecord
from nena_order_service.traffic.desk import TrafficDesk
from nena_order_service.traffic.traffic_control import Departure, Evasion, NoWay, Wish
from nena_order_service.vehicles.positions import Places
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

MAY_STILL_SPEAK = (LinkStatus.UNKNOWN, LinkStatus.ONLINE, LinkStatus.SILENT, LinkStatus.UNREADABLE)


class RestartGate:
    """Opens once, when the robots that are there have told their states, or patience is at its end.

    Robots that are known from before the restart are waited for also while the broker says nothing of them.
    Those that are away keep what they held.
    """

    def __init__(
        self,
        patience: float,
        clock: Clock,
        *,
        fleet: Callable[[], FleetControl],
        view: Callable[[FleetVehicle], RobotView],
    ) -> None:
        self._patience = patience
        self._clock = clock
        self._fleet = fleet
        self._view = view
        self._until = clock.monotonic() + patience
        self._remembered: tuple[FleetVehicle, ...] = ()
        self._open = False

    def begin(self, remembered: tuple[FleetVehicle, ...]) -> None:
        """Wait for these vehicles, from now on."""
        self._remembered = remembered
        self._until = self._clock.monotonic() + self._patience

    @property
    def is_open(self) -> bool:
        """Whether anybody may be given anything."""
        if not self._open:
            missing = self._missing()
            late = self._clock.monotonic() >= self._until and self._fleet().connected_for() >= self._patience
            self._open = late or (not missing and self._fleet().all_known())
            if self._open and missing:
                log.warning("robots that were not heard keep what they held, if anything", vehicles=missing)
        return self._open

    @property
    def reason(self) -> str:
        """Why nobody is given anything, in words; empty when the gate is open."""
        if self.is_open:
            return ""
        whom = ", ".join(self._missing()) or "each robot"
        return f"it waits after the start until {whom} has told its state"

    def _missing(self) -> list[str]:
        views = ((vehicle.name, self._view(vehicle)) for vehicle in self._remembered)
        return [name for name, view in views if view.state is None and view.link in MAY_STILL_SPEAK]


class Pauses:
    """Knows which vehicles stand with an order, until they can go on.

    A person holds it, it is tried again later, nobody knows where the vehicle is, or locks of paths close its
    way. The vehicle keeps its place meanwhile: nobody sends it away.
    """

    def __init__(
        self,
        book: OrderBook,
        planner: MissionPlanner,
        view: Callable[[FleetVehicle], RobotView],
        clock: Clock,
    ) -> None:
        self._book = book
        self._planner = planner
        self._view = view
        self._clock = clock
        self._orders: dict[str, int] = {}

    def __contains__(self, vehicle: str) -> bool:
        """Tell whether the vehicle of this name stands with an order."""
        return vehicle in self._orders

    def __iter__(self) -> Iterator[tuple[str, TransportOrder]]:
        """Yield the vehicles' names and their orders."""
        return iter([(vehicle, self._book.get(number)) for vehicle, number in self._orders.items()])

    def begin(self, vehicle: FleetVehicle, order: TransportOrder) -> None:
        """Let a vehicle stand with its order, until :meth:`end`."""
        self._orders[vehicle.name] = order.number

    def end(self, vehicle: str) -> None:
        """Let the vehicle of this name go on, or be without an order."""
        self._orders.pop(vehicle, None)

    def is_over(self, vehicle: FleetVehicle) -> bool:
        """Tell whether a vehicle can go on with its order."""
        return not self._book.get(self._orders[vehicle.name]).held and not self.why(vehicle)

    def why(self, vehicle: FleetVehicle) -> str:
        """Say why a vehicle cannot go on; empty for nothing, or where the order itself says who holds it."""
        order = self._book.get(self._orders[vehicle.name])
        status = order.status
        if status.held:
            return ""
        if status.next_try and self._clock.now() < status.next_try:
            return f"it is tried again at {status.next_try:%H:%M:%S} UTC"
        view = self._view(vehicle)
        try:
            standing = self._planner.standing(vehicle, view)
        except NotLocatedError as error:
            away = view.state is None or view.link is not LinkStatus.ONLINE
            return f"the robot {view.availability.reason}" if away else str(error)
        return self._planner.locked_out(order, vehicle, standing)


EVASION_PAUSE = 10.0
"""Seconds in which a robot that did not make room is not asked again."""


class Mobility:
    """Tells traffic of whom it may count on: by what robots say, by their places and by their orders."""

    def __init__(
        self,
        desk: TrafficDesk,
        *,
        places: Places,
        pauses: Pauses,
        missions: MissionBook,
        registry: VehicleRegistry,
        fleet: Callable[[], FleetControl],
        clock: Clock,
    ) -> None:
        self._desk = desk
        self._places = places
        self._pauses = pauses
        self._missions = missions
        self._registry = registry
        self._fleet = fleet
        self._clock = clock
        self._no_evasion_until: dict[str, float] = {}

    def evasion_failed(self, vehicle: FleetVehicle) -> None:
        """Let a vehicle not be sent away again for a while."""
        self._no_evasion_until[vehicle.name] = self._clock.monotonic() + EVASION_PAUSE

    def movable(self, name: str, *, wants: bool = False) -> bool:
        """Tell whether a vehicle at rest could drive away now; ``wants``: it is to drive for its order."""
        vehicle = self._registry.named(name)
        if vehicle is None or vehicle.obstacle or name in self._pauses:
            return False
        if self._places.obstacle(vehicle, working=wants):
            return False
        if self._desk.journey(name) or not self._places.located(vehicle):
            return False
        if self._clock.monotonic() < self._no_evasion_until.get(name, 0.0) and not wants:
            return False
        return self._view(vehicle).availability.can_take_order

    def lost(self, name: str) -> bool:
        """Tell whether nobody knows when a vehicle at rest could drive away."""
        vehicle = self._registry.named(name)
        if vehicle is None or name in self._pauses or self._view(vehicle).link is not LinkStatus.ONLINE:
            return True
        works = self._missions.order_number(vehicle.key) is not None
        return not works and not self.movable(name)

    def why_it_stays(self, vehicle: FleetVehicle) -> str:
        """Say what keeps a vehicle from beginning to drive for its order; empty for nothing."""
        view = self._view(vehicle)
        if not view.availability.can_take_order:
            return f"the robot {view.availability.reason}"
        if obstacle := self._places.obstacle(vehicle, working=True):
            return f"it {obstacle}"
        if not self._places.located(vehicle):
            return "it is not known where it is"
        why = self._desk.why_waiting(vehicle.name)
        return f"it {why}" if why else ""

    def _view(self, vehicle: FleetVehicle) -> RobotView:
        return self._fleet().view(vehicle.key)


@dataclass(frozen=True, slots=True)
class _Wanted:
    """An order of whose drive order nothing is sent yet, and what its vehicle wishes for it."""

    order: TransportOrder
    wish: Wish
    retriable: bool


class Driving:
    """Joins traffic and fleet control.

    An order's vehicle wishes for the way of its drive order. Once it departs, its mission is sent with a base
    of what is allocated, ``ahead`` nodes before it at the most (*preventive*; 0: all that can be had,
    *assertive*), and the rest as horizon; order updates let the base grow. A mission whose first step cannot
    be allocated yet is not sent yet. What is done inside of a step is committed before anything is sent.
    """

    def __init__(
        self,
        desk: TrafficDesk,
        *,
        ahead: int,
        missions: MissionBook,
        places: Places,
        pauses: Pauses,
        planner: MissionPlanner,
        registry: VehicleRegistry,
        steps: Steps,
        gate: RestartGate,
        fleet: Callable[[], FleetControl],
        clock: Clock,
        on_stuck: Callable[[RobotKey, str], None],
        on_busy: Callable[[MissionFailed], None],
    ) -> None:
        self.due = False
        """Whether anybody may be able to go on now."""
        self._desk = desk
        self._ahead = ahead
        self._missions = missions
        self._places = places
        self._pauses = pauses
        self._planner = planner
        self._registry = registry
        self._steps = steps
        self._gate = gate
        self._fleet = fleet
        self._clock = clock
        self._mobility = Mobility(
            desk, places=places, pauses=pauses, missions=missions, registry=registry, fleet=fleet, clock=clock
        )
        self._on_stuck = on_stuck
        self._on_busy = on_busy
        self._orders: dict[str, _Wanted] = {}
        """Orders of whose drive orders nothing is sent yet, by vehicle."""
        self._unsent: dict[str, MissionRecord] = {}
        """Missions of which nothing is allocated yet, by vehicle."""
        self._told: dict[str, str] = {}

    def want(
        self,
        order: TransportOrder,
        vehicle: FleetVehicle,
        way: Way,
        *,
        first: bool = False,
        retriable: bool = False,
    ) -> None:
        """Let a vehicle do the current drive order, which is the first leg of ``way``, as soon as it can.

        It is ``first`` in the row where it had its turn before. Its actions are ``retriable`` where they may
        be tried again at the robot.
        """
        self._places.see(vehicle)
        wish = self._planner.wish(order, vehicle, way.legs[0])
        self._orders[vehicle.name] = _Wanted(order, wish, retriable)
        self._desk.wish(wish, first=first)
        self.due = True

    def abandon(self, vehicle: FleetVehicle) -> None:
        """Let a vehicle want nothing for its order any more; what was sent to it is not this one's affair."""
        self._orders.pop(vehicle.name, None)
        self._desk.drop(vehicle.name)
        if self._unsent.pop(vehicle.name, None):
            self._desk.revoke(vehicle.name)

    def cancel(self, record: MissionRecord) -> None:
        """Have a robot told to cancel its mission."""
        self._shorten(record)
        granted = record.way[: record.allocated]  # all that a restart is to hold for it
        self._missions.put(record.model_copy(update={"cancelled": True, "way": granted}))
        self._steps.after_commit(lambda: self._fleet().cancel_mission(record.robot))

    def instruct(self, record: MissionRecord, action: Action) -> None:
        """Have a robot told to do something at once about its mission."""
        self._steps.after_commit(lambda: self._fleet().instant_action(record.robot, action))

    def end_early(self, record: MissionRecord, *, partial: bool) -> None:
        """Let a mission end where its base does; ``partial`` where its order is to go on from there."""
        self._shorten(record)
        shorter = record.ending_early(partial=partial)
        if shorter is not record:
            self.send_on(shorter)

    def reconsider(self, misfits: Callable[[MissionRecord], bool]) -> None:
        """Let those wish anew of whose missions nothing is sent yet, where these do not fit any more."""
        for name in [each for each, record in self._unsent.items() if misfits(record)]:
            self._wish_anew(name)

    def resume(self, vehicle: FleetVehicle, record: MissionRecord) -> None:
        """Take up a mission from before a restart: its robot holds all that it was given."""
        self._desk.resume(vehicle.name, record.way, record.allocated)

    def passed(self, mission_id: str, sequence_id: int) -> None:
        """Take notice that a robot has passed a node: what is behind it is free."""
        record = self._missions.find(mission_id)
        if record and (vehicle := self._under_way(record)):
            self.due |= self._desk.arrived(vehicle.name, sequence_id // 2)

    def base_wanted(self, mission_id: str) -> None:
        """Give a robot that comes near the end of its base more of it at once, where that can be had."""
        record = self._missions.find(mission_id)
        if record and self._gate.is_open and (vehicle := self._under_way(record)):
            self._go_on(vehicle, self._ahead and self._desk.ahead(vehicle.name) + self._ahead)

    def ahead_of(self, record: MissionRecord) -> tuple[str, ...]:
        """Name the path and the point that come next for a robot; nothing where it is at the end."""
        vehicle = self._under_way(record)
        journey = self._desk.journey(vehicle.name) if vehicle else None
        return record.ahead(journey.reached) if journey else ()

    def finished(self, record: MissionRecord) -> None:
        """Let a robot rest at the end of its mission."""
        self._missions.end(record)
        vehicle = self._registry.discover(record.robot)
        if self._desk.journey(vehicle.name):
            self._desk.finished(vehicle.name)
            self._places.note(vehicle)
            self._rest(vehicle)

    def broken_off(self, record: MissionRecord, news: object) -> None:
        """Let a robot whose mission has ended early keep what it holds until it is seen standing.

        What it said before counts only if it was known to have the mission.
        """
        self._missions.end(record)
        vehicle = self._registry.discover(record.robot)
        if record.evasion:
            self._mobility.evasion_failed(vehicle)
        if self._desk.journey(vehicle.name):
            self._break_off(vehicle, doubt=isinstance(news, MissionFailed) and not record.accepted)

    def take_out(self, vehicle: FleetVehicle) -> None:
        """Forget all that a vehicle wants and does."""
        self._orders.pop(vehicle.name, None)
        self._unsent.pop(vehicle.name, None)
        self._desk.drop(vehicle.name)
        self.due = True

    def robot_changed(self, vehicle: FleetVehicle) -> None:
        """Take notice that a robot has told something new; that of one on its way is told apart."""
        if not self._desk.journey(vehicle.name):
            self.due = True

    def let_drive(self) -> Iterator[FleetVehicle]:
        """Let everybody go on who can; gives the vehicles of which something is to be told."""
        self.due = False
        if self._gate.is_open:
            for name in self._desk.under_way:
                self._go_on(self._vehicle(name))
            self._reconsider()
            movable, lost = cache(self._movable), cache(self._mobility.lost)
            for granted in self._desk.decide(
                lambda name: not self._desk.journey(name) and movable(name), lost
            ):
                self._begin(granted)
            self._replan()
        for name in self._desk.active | self._told.keys():
            vehicle = self._vehicle(name)
            why = self.note(vehicle) if name in self._orders else self._desk.why_waiting(name)
            if why != self._told.pop(name, ""):
                yield vehicle
            if why:
                self._told[name] = why

    def _reconsider(self) -> None:
        """Let those wish anew who were granted ways on which somebody has come to rest since."""
        for name in filter(self._desk.is_blocked, tuple(self._unsent)):
            self._wish_anew(name)

    def _wish_anew(self, name: str) -> None:
        """Take back a way of which nothing was sent."""
        del self._unsent[name]
        self._desk.revoke(name)
        if name in self._orders:
            self._desk.wish(self._orders[name].wish, first=True)
        self.due = True

    def _replan(self) -> None:
        """Let missions end where their bases do whose ways lead over robots that will not make room.

        Then these robots are at rest, too: the order's one wishes anew, and goes around or changes places.
        """
        for name in tuple(self._desk.stuck(self._movable, self._mobility.lost)):
            record = self._missions.of_robot(self._vehicle(name).key)
            if record and not record.cancelled and not record.all_released:
                log.info("vehicle goes another way", vehicle=name, reason=self._desk.why_waiting(name))
                self.end_early(record, partial=True)

    def note(self, vehicle: FleetVehicle) -> str:
        """Say what keeps a vehicle from doing its order; empty for nothing."""
        record = self._missions.of_robot(vehicle.key)
        if record and record.evasion:
            return "it makes room for others first"
        if reason := self._gate.reason:
            return reason
        if vehicle.name in self._pauses:
            return self._pauses.why(vehicle)
        if vehicle.name in self._orders:
            return self._mobility.why_it_stays(vehicle)
        why = self._desk.why_waiting(vehicle.name)
        return f"it {why}" if why else ""

    def obstacle(self, vehicle: FleetVehicle) -> str:
        """Say, as a predicate, why a vehicle takes no order because of what it does; empty if it does."""
        if self._desk.journey(vehicle.name):
            return "makes room for others"
        return self.obstacle_at(vehicle)

    def obstacle_at(self, vehicle: FleetVehicle) -> str:
        """Say, as a predicate, why a vehicle takes no order because of its place; empty if it does."""
        return self._places.obstacle(vehicle)

    def _vehicle(self, name: str) -> FleetVehicle:
        vehicle = self._registry.named(name)
        assert vehicle, "vehicles never leave the registry"  # noqa: S101 - for the type
        return vehicle

    def _view(self, vehicle: FleetVehicle) -> RobotView:
        return self._fleet().view(vehicle.key)

    def _movable(self, name: str) -> bool:
        return self._mobility.movable(name, wants=name in self._orders)

    def _begin(self, granted: Departure | Evasion | NoWay) -> None:
        vehicle = self._vehicle(granted.vehicle)
        if isinstance(granted, NoWay):
            self._orders.pop(vehicle.name, None)
            self._on_stuck(vehicle.key, str(granted.error))
            return
        try:
            standing = self._planner.standing(vehicle, self._view(vehicle))
        except NotLocatedError:
            standing = None
        if standing is None or not self._stands_as_known(vehicle, standing):
            self._desk.revoke(vehicle.name)
            self._rest(vehicle)
            if isinstance(granted, Departure):
                self._desk.wish(granted.wish, first=True)
            self.due = False  # not again before something is heard or looked at
            return
        try:
            self._unsent[vehicle.name] = self._record(granted, vehicle, standing)
        except ValueError as error:
            self._desk.revoke(vehicle.name)
            self._on_stuck(vehicle.key, f"no VDA 5050 order can be made of it: {error}")
            return
        self._go_on(vehicle)

    def _stands_as_known(self, vehicle: FleetVehicle, standing: Standing) -> bool:
        return self._desk.stands(vehicle.name, standing.point, on_point=standing.on_point)

    def _record(
        self, granted: Departure | Evasion, vehicle: FleetVehicle, standing: Standing
    ) -> MissionRecord:
        if isinstance(granted, Evasion):
            mission = self._planner.evasion(vehicle, standing, granted.route)
            log.info("vehicle makes room", vehicle=vehicle.name, goal=granted.route.destination)
            return MissionRecord.of(vehicle.key, mission, None, granted.way)
        wanted = self._orders[vehicle.name]
        mission = self._planner.mission(
            wanted.order, vehicle, standing, granted.route, retriable=wanted.retriable
        )
        return MissionRecord.of(vehicle.key, mission, wanted.order.index, granted.way)

    def _go_on(self, vehicle: FleetVehicle, ahead: int | None = None) -> None:
        """Allocate what can be had, and send what is new."""
        name = vehicle.name
        more = self._desk.allocate(name, self._ahead if ahead is None else ahead)
        journey = self._desk.journey(name)
        assert journey, "asked for by the caller"  # noqa: S101 - for the type
        unsent = self._unsent.get(name)
        if unsent and (journey.allocated or not journey.way):
            del self._unsent[name]
            record = unsent.released(journey)
            if not record.evasion:
                del self._orders[name]
            self._missions.put(record)
            self._steps.vehicle_changed(name)
            self._steps.after_commit(partial(self._start, record))
        elif more and (known := self._missions.of_robot(vehicle.key)):
            self.send_on(known.released(journey).updated())

    def send_on(self, record: MissionRecord) -> None:
        """Have a robot told what is new about its mission."""
        self._missions.put(record)
        self._steps.after_commit(lambda: self._fleet().extend_mission(record.robot, record.as_released()))

    def _shorten(self, record: MissionRecord) -> None:
        if vehicle := self._under_way(record):
            self._desk.shorten(vehicle.name)
            self.due = True

    def _start(self, record: MissionRecord) -> None:
        try:
            self._fleet().start_mission(record.robot, record.as_released())
        except RobotBusyError as error:
            name = record.mission.mission_id
            self._on_busy(MissionFailed(record.robot, name, str(error), kind=FailureKind.REFUSED))

    def _under_way(self, record: MissionRecord) -> FleetVehicle | None:
        vehicle = self._registry.of(record.robot)
        return vehicle if vehicle and self._desk.journey(vehicle.name) else None

    def _break_off(self, vehicle: FleetVehicle, *, doubt: bool = False) -> None:
        self._desk.break_off(vehicle.name)
        self._places.note(vehicle)
        self._rest(vehicle, doubt=doubt)

    def _rest(self, vehicle: FleetVehicle, *, doubt: bool = False) -> None:
        self._places.forget_sighting(vehicle, doubt=doubt)
        if doubt:
            self._steps.after_commit(lambda: self._fleet().instant_action(vehicle.key, state_request()))
        self._places.see(vehicle)
        self.due = True
