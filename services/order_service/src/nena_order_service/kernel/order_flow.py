"""The flow of transport orders: from creation by way of their drive orders to their one end."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nena_order_service.dispatch.way import Way, WayFinder
from nena_order_service.fleet import (
    MissionAccepted,
    MissionCancelled,
    MissionFailed,
    MissionFinished,
    NotLocatedError,
    OperationStarted,
    RobotView,
)
from nena_order_service.kernel.deadlines import Deadlines
from nena_order_service.kernel.dispatching import Candidate, Dispatching
from nena_order_service.kernel.driving import Driving
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.mission_record import MissionRecord
from nena_order_service.kernel.missions import MissionPlanner
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.places import Places
from nena_order_service.kernel.recovery import LostMissionError, Recovery
from nena_order_service.kernel.steps import Steps
from nena_order_service.kernel.vehicles import FleetVehicle, VehicleRegistry
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.validation import InvalidRequestError, check_order
from nena_order_service.routing import NoRouteError
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import TransportOrderRequest, TransportOrderState
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel, UnknownObjectError
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

MissionNews = MissionAccepted | OperationStarted | MissionFinished | MissionFailed | MissionCancelled


class OrderFlow:
    """Changes orders, inside of the kernel's steps, and has their vehicles driven."""

    def __init__(
        self,
        plant: PlantModel,
        *,
        book: OrderBook,
        missions: MissionBook,
        dispatching: Dispatching,
        driving: Driving,
        places: Places,
        registry: VehicleRegistry,
        finder: WayFinder,
        planner: MissionPlanner,
        steps: Steps,
        clock: Clock,
        view: Callable[[FleetVehicle], RobotView],
    ) -> None:
        self.dispatch_due = False
        """Whether a vehicle or an order may have become free."""
        self._plant = plant
        self._book = book
        self._missions = missions
        self._dispatching = dispatching
        self._driving = driving
        self._places = places
        self._registry = registry
        self._finder = finder
        self._planner = planner
        self._steps = steps
        self._clock = clock
        self._view = view
        self._deadlines = Deadlines()
        self._unplaced: dict[str, int] = {}
        """Orders that go on when their vehicles have said where they are, by vehicle."""

    def create(self, request: TransportOrderRequest, name: str) -> TransportOrder:
        """Make an order from a request that was checked, and dispatch it if it can be."""
        now = self._clock.now()
        order = TransportOrder.created(request, number=self._book.next_number(), name=name, now=now)
        why = self._finder.why_unroutable(request.destinations, order.resources_to_avoid)
        order = order.unroutable(why, now) if why else order.activated().dispatchable()
        self._book.put(order)
        self._deadlines.watch(order)
        if not why:
            # Whatever is free was looked at for all the others before.
            self._dispatch((order,))
        return order

    def withdraw(self, order: TransportOrder, reason: str, *, immediate: bool) -> None:
        """Withdraw an order that is not at its end; one that is withdrawn already stays as it is.

        Its robot is told to cancel where that is to be ``immediate``; else it drives on to the end of what it
        was given, and does what is to be done there.
        """
        if order.state is TransportOrderState.WITHDRAWN:
            return
        order = order.withdrawn(reason, self._clock.now())
        self._book.put(order)
        record = self._missions.of_order(order)
        if order.state.final:
            return
        if record is None:
            self.end(order.failed("withdrawn before the vehicle was sent anything", self._clock.now()))
            return
        if immediate:
            self._driving.cancel(record)
        else:
            self._driving.end_early(record, partial=False)

    def give_up(self, robot: RobotKey, reason: str) -> None:
        """Let the order of a robot fail, if it has one, whatever the robot does about it."""
        number = self._missions.order_number(robot)
        if number is not None:
            self.end(self._book.get(number).failed(reason, self._clock.now()))

    def on_mission(self, news: MissionNews) -> None:
        """Take in what has become of a mission."""
        record = self._missions.find(news.mission_id)
        if record is None:
            log.warning(
                "news of a mission that nobody follows", robot=str(news.robot), mission=news.mission_id
            )
            return
        if isinstance(news, MissionAccepted):
            self._missions.put(record.model_copy(update={"accepted": True}))
        elif isinstance(news, MissionFinished):
            self._driving.finished(record)
        elif isinstance(news, MissionFailed | MissionCancelled):
            self._driving.broken_off(record, news)
        vehicle = self._registry.discover(record.robot)
        self._steps.vehicle_changed(vehicle.name)
        if record.evasion:
            self._evasion(vehicle, news)
        else:
            self._mission(record, news)

    def robot_changed(self, vehicle: FleetVehicle) -> None:
        """Take notice that a robot has told something new."""
        free = self._missions.order_number(vehicle.key) is None
        if free or vehicle.name in self._unplaced:
            self.dispatch_due = True
        self.tell_hindrance(vehicle)

    def tell_hindrance(self, vehicle: FleetVehicle) -> None:
        """Let the order that a vehicle works on say what keeps the vehicle from going on."""
        number = self._missions.order_number(vehicle.key)
        if number is None:
            return
        order = self._book.get(number)
        told = order.hindered(self._view(vehicle).mission_note or self._driving.note(vehicle))
        if told is not order:
            self._book.put(told)
            self._steps.vehicle_changed(order.vehicle)

    def end(self, order: TransportOrder) -> None:
        """Let an order be at its end, and its vehicle be free."""
        self._book.put(order)
        robot = self._missions.release(order)
        if robot is not None:
            vehicle = self._registry.discover(robot)
            self._unplaced.pop(vehicle.name, None)
            self._driving.abandon(vehicle)
            self._steps.vehicle_changed(vehicle.name)
        log.info("order ended", order=order.name, state=order.state.value, reason=order.status.reason)
        self.dispatch_due = True

    def note_deadlines(self) -> None:
        """Let the orders be late whose deadlines have passed."""
        now = self._clock.now()
        for number in self._deadlines.passed(now):
            if order := self._book.at_hand(number):
                self._book.put(order.overdue(now))

    def dispatch(self) -> None:
        """Assign what can be assigned now, and let orders go on whose vehicles have said where they are."""
        self.dispatch_due = False
        for name, number in tuple(self._unplaced.items()):
            vehicle = self._registry.named(name)
            if vehicle and self._view(vehicle).state:
                del self._unplaced[name]
                self._go_on(self._book.get(number), again=None)
        self._dispatch(self._book.dispatchable())

    def take_up(self, order: TransportOrder, document: str | None, recovery: Recovery) -> None:
        """Take up an order from before a restart; what the robots say decides how it goes on."""
        self._deadlines.watch(order)
        if order.state is TransportOrderState.DISPATCHABLE:
            self._take_up_waiting(order)
            return
        order = order.adopted(self._clock.now())
        self._book.put(order)
        if document is None:
            self._take_up_unsent(order)
            return
        try:
            recovery.take_up_mission(order, document)
        except LostMissionError:
            self.end(order.failed("what had been sent to the vehicle cannot be read", self._clock.now()))

    def _take_up_unsent(self, order: TransportOrder) -> None:
        """Let an order go on whose vehicle was not sent the next mission yet."""
        vehicle = self._registry.named(order.vehicle)
        if order.state is TransportOrderState.WITHDRAWN:
            self.end(order.failed("withdrawn before the vehicle was sent anything", self._clock.now()))
        elif vehicle is None:
            self.end(order.failed(f"there is no vehicle {order.vehicle!r} any more", self._clock.now()))
        else:
            self._missions.assign(order, vehicle.key)
            self._unplaced[vehicle.name] = order.number

    def _take_up_waiting(self, order: TransportOrder) -> None:
        """Let an order wait on, unless the plant model has changed so that it is not possible any more."""
        try:
            check_order(order.status, self._plant)
        except InvalidRequestError as error:
            self._book.put(order.failed(f"not possible in this plant any more: {error}", self._clock.now()))

    def _evasion(self, vehicle: FleetVehicle, news: MissionNews) -> None:
        if isinstance(news, MissionFailed):
            log.warning("vehicle did not make room", vehicle=vehicle.name, reason=news.reason)
        if isinstance(news, MissionFinished | MissionFailed | MissionCancelled):
            self.dispatch_due = True

    def _mission(self, record: MissionRecord, news: MissionNews) -> None:
        number = self._missions.order_number(record.robot)
        assert number is not None, "who has an order's mission works for the order"  # noqa: S101 - for the type
        assert record.drive_order_index is not None, "evasions have none"  # noqa: S101 - for the type
        order, now = self._book.get(number), self._clock.now()
        match news:
            case MissionAccepted():
                pass
            case OperationStarted():
                self._book.put(order.operating(record.drive_order_index, now))
            case MissionFinished():
                self._mission_finished(order, record)
            case MissionFailed():
                self.end(order.failed(". ".join((news.reason, *news.details)), now))
            case MissionCancelled():
                withdrawn = order.state is TransportOrderState.WITHDRAWN
                reason = "withdrawn; the vehicle has let it go" if withdrawn else "cancelled at the vehicle"
                self.end(order.failed(reason, now))

    def _mission_finished(self, order: TransportOrder, record: MissionRecord) -> None:
        now, index = self._clock.now(), order.status.current_drive_order_index
        if order.state is TransportOrderState.WITHDRAWN:
            self.end(order.failed("withdrawn; the vehicle had done what it had been sent", now))
        elif record.partial:
            self._go_on(order, again=True)
        elif index + 1 == len(order.status.drive_orders):
            self.end(order.drive_order_finished(index, now).finished(now))
        else:
            self._go_on(order.drive_order_finished(index, now))

    def _go_on(self, order: TransportOrder, *, again: bool | None = False) -> None:
        """Drive to the current destination; where that is not possible, the order fails.

        It is tried ``again``, or for the first time; None: as it was to be before a restart.
        """
        vehicle = self._registry.named(order.vehicle)
        if vehicle is None:
            self.end(order.failed(f"there is no vehicle {order.vehicle!r} any more", self._clock.now()))
            return
        try:
            standing = self._planner.standing(vehicle, self._view(vehicle))
            way = self._planner.way(order, vehicle, standing)
        except (NotLocatedError, NoRouteError, UnknownObjectError) as error:
            self.end(order.failed(f"vehicle {vehicle.name} cannot go on: {error}", self._clock.now()))
            return
        if again is not None:
            self._places.count_tries(vehicle, self._places.tries(vehicle) + 1 if again else 0)
        self._drive(order, vehicle, way, first=bool(again))

    def _dispatch(self, orders: Sequence[TransportOrder]) -> None:
        """Assign what can be assigned of these orders, and say of the others why not."""
        dispatched, reasons = self._dispatching.dispatch(orders)
        now = self._clock.now()
        for each in dispatched:
            self._assign(each.assignment.order, each.candidate, each.assignment.way, each.assignment.why)
        for order in orders:
            reason = reasons.get(order.name, order.status.reason)
            if reason != order.status.reason:
                self._book.put(order.deferred(reason, now))

    def _assign(self, order: TransportOrder, candidate: Candidate, way: Way, why: str) -> None:
        vehicle = candidate.vehicle
        routes = (leg.points for leg in way.legs)
        order = order.assigned(vehicle.name, routes, why, self._clock.now())
        log.info("order assigned", order=order.name, vehicle=vehicle.name, why=why)
        self._missions.assign(order, vehicle.key)
        self._places.count_tries(vehicle, 0)
        self._drive(order, vehicle, way)

    def _drive(self, order: TransportOrder, vehicle: FleetVehicle, way: Way, *, first: bool = False) -> None:
        self._book.put(order)
        self._steps.vehicle_changed(vehicle.name)
        self._driving.want(order, vehicle, way, first=first)
