"""The kernel: every change of orders, vehicles and missions is made here, in one event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta

from pydantic import ValidationError

from nena_order_service.dispatch.dispatcher import Assignment
from nena_order_service.dispatch.way import Way, WayFinder
from nena_order_service.fleet import (
    BaseWanted,
    FleetOutput,
    InstantActionEnded,
    LinkStatus,
    Mission,
    MissionAccepted,
    MissionCancelled,
    MissionFailed,
    MissionFinished,
    NodePassed,
    NotLocatedError,
    OperationStarted,
    RobotBusyError,
    RobotChanged,
    RobotView,
)
from nena_order_service.kernel.dispatching import Candidate, Dispatching
from nena_order_service.kernel.instant_actions import PendingInstantActions, state_request
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.mission_record import MissionRecord
from nena_order_service.kernel.missions import MissionPlanner
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.ports import FleetControl
from nena_order_service.kernel.release import ReleasePolicy, as_released
from nena_order_service.kernel.steps import Steps
from nena_order_service.kernel.vehicle_status import vehicle_status
from nena_order_service.kernel.vehicles import FleetVehicle, VehicleRegistry
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.validation import InvalidRequestError, check_order
from nena_order_service.routing import NoRouteError
from nena_order_service.store.store import Store
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import (
    TransportOrderRequest,
    TransportOrderState,
)
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel, UnknownObjectError
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.own_actions import transforms_itself
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

LOOK_INTERVAL = 2.0
"""Seconds between looks at what changes without news: where robots stand, why vehicles have no order."""


class Kernel:
    """Joins orders, dispatcher, fleet control and store.

    What happens comes in as a *step*: it changes the order book and notes effects, such as a mission to send.
    The changes are committed, and only then are the effects done and the changes told. So whatever anybody
    has ever heard survives a restart.
    """

    def __init__(
        self,
        plant: PlantModel,
        *,
        store: Store,
        registry: VehicleRegistry,
        finder: WayFinder,
        planner: MissionPlanner,
        clock: Clock,
        release: ReleasePolicy | None = None,
    ) -> None:
        self.plant = plant
        self._release = release or ReleasePolicy()
        self.store = store
        self.registry = registry
        self.book = OrderBook()
        self.instant_actions = PendingInstantActions()
        self.steps = Steps(self.book, store, self._status_of)
        self.clock = clock
        self._finder = finder
        self._planner = planner
        self._fleet: FleetControl | None = None
        self._missions = MissionBook(self.book)
        self._dispatching = Dispatching(registry, self._missions, planner, self.view)
        self._dispatch_due = False
        self._asked: set[RobotKey] = set()

    @property
    def fleet(self) -> FleetControl:
        """Fleet control; there from :meth:`start` on."""
        if self._fleet is None:
            message = "start the kernel before anything is asked of it"
            raise RuntimeError(message)
        return self._fleet

    async def start(self, fleet: FleetControl) -> None:
        """Take up all that is not at its end; before the first message of a robot comes."""
        self._fleet = fleet
        found = await self.store.unfinished()
        self.book.last_number = found.last_number
        for order in found.orders:
            self.book.load(order)
        with self.step():
            for order in found.orders:
                self._take_up(order, found.missions.get(order.number))
        await self.steps.committed()
        log.info("orders taken up", unfinished=len(found.orders), last_number=found.last_number)

    async def run(self) -> None:
        """Look again and again at what changes without news, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_INTERVAL)
            self.look()

    def look(self) -> None:
        """Try again to dispatch orders that wait, and tell vehicles that stand otherwise than was told."""
        with self.step():
            self._dispatch_due = True
        with self.step():
            for vehicle in self.registry:
                if not self.steps.vehicle_as_told(self.status(vehicle)):
                    self.steps.vehicle_changed(vehicle.name)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Make changes, and what they let be dispatched; they are told and done when they are committed."""
        with self.steps.step():
            yield
            while self._dispatch_due:
                self._dispatch_due = False
                self._dispatch(self.book.dispatchable())

    def create(self, request: TransportOrderRequest, name: str) -> TransportOrder:
        """Make an order from a request that was checked, and dispatch it if it can be."""
        now = self.clock.now()
        with self.step():
            order = TransportOrder.created(request, number=self.book.next_number(), name=name, now=now)
            why = self._finder.why_unroutable(request.destinations, order.resources_to_avoid)
            order = order.unroutable(why, now) if why else order.activated().dispatchable()
            self.book.put(order)
            if not why:
                # Whatever is free was looked at for all the others before.
                self._dispatch((order,))
        order = self.book.get(order.number)
        log.info("order created", order=name, state=order.state.value)
        return order

    def withdraw(self, number: int, reason: str) -> None:
        """Withdraw an order that is not at its end; one that is withdrawn already stays as it is."""
        order = self.book.get(number)
        if order.state is TransportOrderState.WITHDRAWN:
            return
        with self.step():
            self.book.put(order.withdrawn(reason, self.clock.now()))
            if record := self._missions.of_order(order):
                self.steps.after_commit(lambda: self.fleet.cancel_mission(record.robot))

    def send_instant_action(
        self, vehicle: FleetVehicle, action: Action
    ) -> asyncio.Future[InstantActionEnded]:
        """Send an instant action; the future is done at its end."""
        end = self.instant_actions.expect(action.action_id)
        self.fleet.instant_action(vehicle.key, action)
        return end

    def view(self, vehicle: FleetVehicle) -> RobotView:
        """Give what fleet control knows of a vehicle's robot."""
        return self.fleet.view(vehicle.key)

    def status(self, vehicle: FleetVehicle) -> VehicleStatus:
        """Tell how a vehicle stands."""
        view = self.view(vehicle)
        order = self.book.visible(self._missions.order_number(vehicle.key))
        order = order if order and order.vehicle == vehicle.name else None
        age = None if view.state_at is None else timedelta(seconds=self.clock.monotonic() - view.state_at)
        return vehicle_status(
            vehicle,
            view,
            plant=self.plant,
            transport_order=order.name if order else None,
            reason=order.status.reason
            if order
            else self._dispatching.idle_reason(vehicle, orders_wait=self.book.orders_wait),
            last_state=None if age is None else self.clock.now() - age,
        )

    def _status_of(self, name: str) -> VehicleStatus | None:
        vehicle = self.registry.named(name)
        return self.status(vehicle) if vehicle else None

    def on_news(self, news: FleetOutput) -> None:
        """Take in what fleet control tells."""
        with self.step():
            match news:
                case RobotChanged(robot):
                    self._robot_changed(robot)
                    self._tell_hindrance(robot)
                case InstantActionEnded():
                    self.instant_actions.ended(news)
                case (
                    MissionAccepted()
                    | OperationStarted()
                    | MissionFinished()
                    | MissionFailed()
                    | MissionCancelled()
                ):
                    self._mission_news(news)
                    self._tell_hindrance(news.robot)
                case NodePassed() | BaseWanted():
                    self._release_more(news)
                case _:
                    pass

    def _robot_changed(self, robot: RobotKey) -> None:
        vehicle = self.registry.discover(robot)
        view = self.view(vehicle)
        if view.state and view.state.mobile_robot_position:
            vehicle = self.registry.learn_map(vehicle, view.state.mobile_robot_position.map_id)
        if view.factsheet:
            self.registry.learn_frame(vehicle, transforms_itself=transforms_itself(view.factsheet))
        self._ask_for_state(view)
        self.steps.vehicle_changed(vehicle.name)
        if self._missions.order_number(robot) is None:
            self._dispatch_due = True

    def _tell_hindrance(self, robot: RobotKey) -> None:
        """Let the order that a robot works on say what keeps the robot from going on."""
        number = self._missions.order_number(robot)
        if number is None:
            return
        order = self.book.get(number)
        told = order.hindered(self.fleet.view(robot).mission_note)
        if told is not order:
            self.book.put(told)
            self.steps.vehicle_changed(order.vehicle)

    def _ask_for_state(self, view: RobotView) -> None:
        """Ask a robot that is there and has told no state yet, so that nobody waits for its next one."""
        if view.link is not LinkStatus.ONLINE:
            self._asked.discard(view.key)
        elif view.state is None and view.key not in self._asked:
            self._asked.add(view.key)
            self.steps.after_commit(lambda: self.fleet.instant_action(view.key, state_request()))

    def _mission_news(
        self,
        news: MissionAccepted | OperationStarted | MissionFinished | MissionFailed | MissionCancelled,
    ) -> None:
        found = self._missions.find(news.mission_id)
        if found is None:
            log.warning(
                "news of a mission that nobody follows", robot=str(news.robot), mission=news.mission_id
            )
            return
        (order, record), now = found, self.clock.now()
        match news:
            case MissionAccepted():
                self._missions.put(order, record.model_copy(update={"accepted": True}))
            case OperationStarted():
                self.book.put(order.operating(record.drive_order_index, now))
            case MissionFinished():
                self._drive_order_finished(order, record)
            case MissionFailed():
                self._end(order.failed(". ".join((news.reason, *news.details)), now))
            case MissionCancelled():
                withdrawn = order.state is TransportOrderState.WITHDRAWN
                reason = "withdrawn; the vehicle has let it go" if withdrawn else "cancelled at the vehicle"
                self._end(order.failed(reason, now))
        self.steps.vehicle_changed(order.vehicle)

    def _release_more(self, news: NodePassed | BaseWanted) -> None:
        """Release more of a mission as its robot goes on."""
        found = self._missions.find(news.mission_id)
        if found is None or found[0].state is TransportOrderState.WITHDRAWN:
            return
        order, record = found
        more = (
            self._release.after_node(record, news.sequence_id)
            if isinstance(news, NodePassed)
            else self._release.when_wanted(record)
        )
        if more:
            self._missions.put(order, more)
            self.steps.after_commit(lambda: self.fleet.extend_mission(more.robot, as_released(more)))

    def _drive_order_finished(self, order: TransportOrder, record: MissionRecord) -> None:
        now = self.clock.now()
        done = order.drive_order_finished(record.drive_order_index, now)
        last = record.drive_order_index + 1 == len(order.status.drive_orders)
        if order.state is TransportOrderState.WITHDRAWN:
            self._end(done.failed("withdrawn; the vehicle had done what it had been sent", now))
        elif last:
            self._end(done.finished(now))
        else:
            self._missions.forget(order)
            self._go_on(done)

    def _go_on(self, order: TransportOrder) -> None:
        """Send the mission of the current drive order; where that is not possible, the order fails."""
        vehicle = self.registry.named(order.vehicle)
        if vehicle is None:
            self._end(order.failed(f"there is no vehicle {order.vehicle!r} any more", self.clock.now()))
            return
        try:
            candidate = Candidate(vehicle, self._planner.standing(vehicle, self.view(vehicle)))
            way = self._planner.way(order, vehicle, candidate.standing)
        except (NotLocatedError, NoRouteError, UnknownObjectError) as error:
            self._end(order.failed(f"vehicle {vehicle.name} cannot go on: {error}", self.clock.now()))
            return
        self._send(order, candidate, way)

    def _send(self, order: TransportOrder, candidate: Candidate, way: Way) -> None:
        """Send the mission of the current drive order, the first leg of ``way``."""
        vehicle = candidate.vehicle
        self.steps.vehicle_changed(vehicle.name)
        try:
            mission = self._planner.mission(order, vehicle, candidate.standing, way)
        except ValueError as error:
            self._end(order.failed(f"no VDA 5050 order can be made of it: {error}", self.clock.now()))
            return
        self.book.put(order)
        record = MissionRecord.of(vehicle.key, mission, order.status.current_drive_order_index)
        record = self._release.first(record)
        self._missions.put(order, record)
        self.steps.after_commit(lambda: self._start(order, vehicle, as_released(record)))

    def _start(self, order: TransportOrder, vehicle: FleetVehicle, mission: Mission) -> None:
        try:
            self.fleet.start_mission(vehicle.key, mission)
        except RobotBusyError as error:
            with self.step():
                self._end(self.book.get(order.number).failed(str(error), self.clock.now()))

    def _end(self, order: TransportOrder) -> None:
        """Let an order be at its end, and its vehicle be free."""
        self.book.put(order)
        self._missions.forget(order)
        log.info("order ended", order=order.name, state=order.state.value, reason=order.status.reason)
        self._dispatch_due = True

    def _dispatch(self, orders: Sequence[TransportOrder]) -> None:
        """Assign what can be assigned of these orders, and say of the others why not."""
        dispatched, reasons = self._dispatching.dispatch(orders)
        for each in dispatched:
            self._assign(each.assignment, each.candidate)
        now = self.clock.now()
        for order in orders:
            reason = reasons.get(order.name, order.status.reason)
            if reason != order.status.reason:
                self.book.put(order.deferred(reason, now))

    def _assign(self, assignment: Assignment, candidate: Candidate) -> None:
        vehicle = candidate.vehicle
        routes = (leg.points for leg in assignment.way.legs)
        order = assignment.order.assigned(vehicle.name, routes, assignment.why, self.clock.now())
        log.info("order assigned", order=order.name, vehicle=vehicle.name, why=assignment.why)
        self._send(order, candidate, assignment.way)

    def _take_up(self, order: TransportOrder, document: str | None) -> None:
        """Take up an order from before a restart; what the robots say decides how it goes on."""
        if order.state is TransportOrderState.DISPATCHABLE:
            self._take_up_waiting(order)
            return
        try:
            record = MissionRecord.model_validate_json(document or "")
        except ValidationError:
            self._end(order.failed("what had been sent to the vehicle is not in the store", self.clock.now()))
            return
        order = order.adopted(self.clock.now())
        self.book.put(order)
        self._missions.load(order, record)
        self.registry.discover(record.robot)
        self.steps.after_commit(
            lambda: self.fleet.adopt_mission(
                record.robot, as_released(record), accepted=record.accepted, update_id=record.update_id
            )
        )
        if order.state is TransportOrderState.WITHDRAWN:
            self.steps.after_commit(lambda: self.fleet.cancel_mission(record.robot))

    def _take_up_waiting(self, order: TransportOrder) -> None:
        """Let an order wait on, unless the plant model has changed so that it is not possible any more."""
        try:
            check_order(order.status, self.plant)
        except InvalidRequestError as error:
            self.book.put(order.failed(f"not possible in this plant any more: {error}", self.clock.now()))
