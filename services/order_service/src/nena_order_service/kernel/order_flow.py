"""The flow of transport orders: from creation by way of their drive orders to their one end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from nena_order_service.dispatching.manager import GIVES_UP, Dispatched, Dispatching, is_operating
from nena_order_service.dispatching.way import Way, WayFinder
from nena_order_service.fleet import (
    FailureKind,
    NotLocatedError,
    RobotView,
)
from nena_order_service.kernel.failure_flow import Failure, FailureFlow
from nena_order_service.kernel.holding import Holding
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.mission_flow import MissionFlow
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.steps import Steps
from nena_order_service.orders import deadlines, transport_order
from nena_order_service.orders.automatic import automatic_name
from nena_order_service.orders.deadlines import Deadlines, OrderTimeouts
from nena_order_service.orders.dependencies import Conditions
from nena_order_service.orders.sequences import Sequences
from nena_order_service.orders.transport_order import TransportOrder, why_withdrawn
from nena_order_service.orders.validation import InvalidRequestError, check_order
from nena_order_service.orders.vda_orders import MissionPlanner
from nena_order_service.recovery import LostMissionError, Recovery
from nena_order_service.routing import NoRouteError
from nena_order_service.traffic.driving import Driving, Pauses
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import FailurePolicy, TransportOrderRequest, TransportOrderState
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel, UnknownObjectError
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)


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
        pauses: Pauses,
        policy: FailurePolicy,
        conditions: Conditions,
        sequences: Sequences,
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
        self._pauses = pauses
        self._conditions = conditions
        self._sequences = sequences
        self._registry = registry
        self._finder = finder
        self._planner = planner
        self._steps = steps
        self._clock = clock
        self._view = view
        self._deadlines = Deadlines(book.is_over)
        self._timeouts = OrderTimeouts(book.is_over)
        self._failures = FailureFlow(
            self, policy=policy, registry=registry, planner=planner, clock=clock, view=view
        )
        self.news = self._make_news()
        self.holding = Holding(
            self, book=book, missions=missions, driving=driving, pauses=pauses, registry=registry, clock=clock
        )

    def _make_news(self) -> MissionFlow:
        return MissionFlow(
            self,
            book=self._book,
            missions=self._missions,
            driving=self._driving,
            failures=self._failures,
            registry=self._registry,
            steps=self._steps,
            clock=self._clock,
        )

    def create(
        self,
        request: TransportOrderRequest,
        name: str,
        ended: Mapping[str, TransportOrderState] | None = None,
        *,
        automatic: bool = False,
    ) -> TransportOrder:
        """Make an order from a request that was checked, and dispatch it if it can be.

        ``ended`` are the final states of dependencies that are not at hand any more.
        """
        now, number = self._clock.now(), self._book.next_number()
        order = TransportOrder.created(request, number=number, name=name, now=now, automatic=automatic)
        why = self._finder.why_unroutable(request.destinations, order.resources_to_avoid)
        order = order.unroutable(why, now) if why else order.activated()
        self._sequences.append(order)
        order = order if why else self._conditions.begin(order, ended or {})
        self._book.put(order)
        if not order.state.final:
            self._deadlines.watch(order)
            self._timeouts.watch(order)
        if order.state is TransportOrderState.DISPATCHABLE and not order.held:
            # Whatever is free was looked at for all the others before.
            self._dispatch((order,))
        return order

    def create_automatic(self, request: TransportOrderRequest) -> bool:
        """Make an order for a vehicle that has nothing to do; tell whether it does it.

        An order that does not begin at once is not kept: what the vehicle needs may be another one by then.
        """
        order = self._book.get(self.create(request, automatic_name(request), automatic=True).number)
        begun = order.state is TransportOrderState.BEING_PROCESSED
        if not begun and not order.state.final:
            self.withdraw(order, "its vehicle did not begin it", immediate=True)
        return begun

    def withdraw(self, order: TransportOrder, reason: str, *, immediate: bool) -> None:
        """Withdraw an order that is not at its end; of one that is withdrawn only the way may change.

        Its robot is told to cancel where that is to be ``immediate``; else it drives on to the end of what it
        was given, and does what is to be done there.
        """
        again = order.state is TransportOrderState.WITHDRAWN
        if not again:
            order = order.withdrawn(reason, self._clock.now())
            self._book.put(order)
        record = self._missions.of_order(order)
        if order.state.final:
            return
        if record is None:
            words = f"withdrawn, and the vehicle was at nothing for it: {why_withdrawn(order.status)}"
            self.end(order.failed(words, self._clock.now()))
        elif immediate and not record.cancelled:
            self._driving.cancel(record)
        elif not immediate and not again:
            self._driving.end_early(record, partial=False)

    def end_late_ones(self) -> None:
        """Withdraw the orders whose time is over, and have their robots told to cancel."""
        now = self._clock.now()
        for number in self._timeouts.take_due(now):
            order = self._book.at_hand(number)
            if order and not order.state.final:
                log.info("order has had its time", order=order.name)
                self.withdraw(order, deadlines.reason(order, now), immediate=True)

    def give_up(self, robot: RobotKey, reason: str) -> None:
        """Let the order of a robot fail, if it has one, whatever robot and policy would do about it."""
        number = self._missions.order_number(robot)
        if number is not None:
            self.end(self._book.get(number).failed(reason, self._clock.now()))

    def no_way(self, robot: RobotKey, reason: str) -> None:
        """Take notice that a robot has no way for its order, if it has one; it waits for what is locked."""
        number = self._missions.order_number(robot)
        if number is None:
            return
        vehicle, order = self._registry.discover(robot), self._book.get(number)
        self._pauses.begin(vehicle, order)
        if self._pauses.is_over(vehicle):
            self._pauses.end(vehicle.name)
            self._failures.failed(order, Failure(FailureKind.NO_WAY, reason))
        else:
            self.tell_hindrance(vehicle)

    def robot_changed(self, vehicle: FleetVehicle) -> None:
        """Take notice that a robot has told something new."""
        if vehicle.name in self._pauses or self._dispatching.has_changed(vehicle):
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
        self._let_go(order)
        told = order.status
        by, state, reason = told.processing_vehicle, told.state.value, told.reason
        log.info("order ended", order=told.name, vehicle=by, state=state, reason=reason)

    def give_to_another(self, order: TransportOrder) -> None:
        """Let an order wait for another vehicle than the one that had it."""
        self._let_go(order)
        log.info("order waits for another vehicle", order=order.name)

    def _let_go(self, order: TransportOrder) -> None:
        self._book.put(order)
        robot = self._missions.release(order)
        if robot is not None:
            vehicle = self._registry.discover(robot)
            self._pauses.end(vehicle.name)
            self._driving.abandon(vehicle)
            self._steps.vehicle_changed(vehicle.name)
        self.dispatch_due = True

    def as_conditions_are(self, order: TransportOrder) -> TransportOrder:
        """Give an order that waits, or may be dispatched, as it is with what it waits for."""
        return self._conditions.look(order)

    @property
    def settle_due(self) -> bool:
        """Whether orders or sequences have come to their end, which may mean something for others."""
        return self._book.any_ended or self._sequences.freed

    def settle(self) -> None:
        """Do what the ends of orders mean for those that depend on them, and for their sequences."""
        self.dispatch_due |= self._conditions.settle() or self._sequences.freed
        self._sequences.freed = False

    def note_deadlines(self) -> None:
        """Let the orders be late whose deadlines have passed."""
        now = self._clock.now()
        for number in self._deadlines.passed(now):
            if order := self._book.at_hand(number):
                self._book.put(order.overdue(now))

    def dispatch(self) -> None:
        """Assign what can be assigned now, and let orders go on whose pauses are over."""
        self.dispatch_due = False
        for name, order in self._pauses:
            vehicle = self._registry.named(name)
            if vehicle and self._pauses.is_over(vehicle):
                self._drive_on(order, vehicle)
            elif vehicle:
                self.tell_hindrance(vehicle)
        self._dispatch([each for each in self._book.dispatchable() if not each.held])

    def take_up(
        self, orders: Iterable[TransportOrder], missions: Mapping[int, str], recovery: Recovery
    ) -> None:
        """Take up orders from before a restart; what the robots say decides how they go on.

        The youngest come first, so that those that wait for others are there when these fail; and last
        come those of which a robot has nothing, for robots may have got other vehicles' names since.
        """
        waiting = (TransportOrderState.ACTIVE, TransportOrderState.DISPATCHABLE)
        unsent: list[TransportOrder] = []
        for order in sorted(orders, key=lambda order: -order.number):
            self._deadlines.watch(order)
            self._timeouts.watch(order)
            if order.state in waiting:
                self._take_up_waiting(order)
            elif (document := missions.get(order.number)) is not None:
                self._take_up_sent(order, document, recovery)
            else:
                unsent.append(order)
        for order in unsent:
            self._take_up_unsent(order, recovery)

    def _take_up_sent(self, order: TransportOrder, document: str, recovery: Recovery) -> None:
        now = self._clock.now()
        try:
            vehicle = recovery.take_up_mission(order, document)
        except LostMissionError:
            words = "what had been sent to the vehicle cannot be read"
            self.end(order.adopted(now).failed(words, now))
        else:
            self._book.put(order.adopted(now, vehicle.name))

    def _take_up_unsent(self, order: TransportOrder, recovery: Recovery) -> None:
        """Let an order go on whose vehicle was not sent the next mission yet."""
        vehicle = recovery.present_vehicle(order.vehicle or "")
        order = order.adopted(self._clock.now(), vehicle.name if vehicle else None)
        if order.state is TransportOrderState.WITHDRAWN:
            words = f"withdrawn, and the vehicle was at nothing for it: {why_withdrawn(order.status)}"
            self.end(order.failed(words, self._clock.now()))
        elif vehicle is None:
            self.end(order.failed(f"there is no vehicle {order.vehicle!r} any more", self._clock.now()))
        elif self._missions.order_number(vehicle.key) is not None:
            words = f"vehicle {order.vehicle!r} is another robot now, which works on another order"
            self.end(order.failed(words, self._clock.now()))
        else:
            self._book.put(order)
            self._missions.assign(order, vehicle.key)
            self._pauses.begin(vehicle, order)

    def _take_up_waiting(self, order: TransportOrder) -> None:
        """Let an order wait on, unless the plant model has changed so that it is not possible any more."""
        try:
            left = order.status.drive_orders[max(order.status.current_drive_order_index, 0) :]
            check_order(order.status.model_copy(update={"drive_orders": left}), self._plant)
        except InvalidRequestError as error:
            self._book.put(order.failed(f"not possible in this plant any more: {error}", self._clock.now()))
        else:
            self._book.put(self._conditions.take_up(order))

    def go_on(self, order: TransportOrder, *, again: bool = False) -> None:
        """Drive to the current destination, ``again`` or for the first time, unless the order has to wait."""
        vehicle = self._registry.employed(order.vehicle)
        if vehicle is None:
            self.end(order.failed(f"there is no vehicle {order.vehicle!r} any more", self._clock.now()))
            return
        order = transport_order.begun_again(order) if again else order
        self._book.put(order)
        self._pauses.begin(vehicle, order)
        self._steps.vehicle_changed(vehicle.name)
        if self._pauses.is_over(vehicle):
            self._drive_on(order, vehicle, first=again)
        else:
            self.tell_hindrance(vehicle)

    def _drive_on(self, order: TransportOrder, vehicle: FleetVehicle, *, first: bool = False) -> None:
        """End the pause of an order whose vehicle says where it is."""
        self._pauses.end(vehicle.name)
        order = transport_order.tried(order)
        try:
            standing = self._planner.standing(vehicle, self._view(vehicle))
            way = self._planner.way(order, vehicle, standing)
        except (NotLocatedError, NoRouteError, UnknownObjectError) as error:
            words = f"vehicle {vehicle.name} cannot go on: {error}"
            self._failures.failed(order, Failure(FailureKind.NO_WAY, words))
        else:
            self._drive(order, vehicle, way, first=first)

    def _dispatch(self, orders: Sequence[TransportOrder]) -> None:
        """Assign what can be assigned of these orders, and say of the others why not."""
        dispatched, reasons = self._dispatching.dispatch(orders)
        for each in dispatched:
            if each.assignment.gives_up:
                reasons[each.assignment.order.name] = self._give_way(each)
            else:
                self._assign(each)
        now = self._clock.now()
        for order in orders:
            reason = reasons.get(order.name, order.status.reason)
            if reason != order.status.reason:
                self._book.put(order.deferred(reason, now))

    def _give_way(self, dispatched: Dispatched) -> str:
        """Let a vehicle give up a dispensable order for another one; say for what that one waits.

        It drives to the end of what it was given; but one that recharges would go on, and is told to cancel.
        """
        wanted, given_up = dispatched.assignment.order.name, dispatched.assignment.gives_up
        order = self._book.named(given_up)
        assert order, "vehicles work for orders of the book"  # noqa: S101 - for the type
        log.info("order gives way", order=given_up, vehicle=dispatched.vehicle.name, wanted=wanted)
        self.withdraw(order, f"gives way to order {wanted}", immediate=is_operating(order))
        return f"waits for vehicle {dispatched.vehicle.name!r}, which {GIVES_UP}"

    def _assign(self, dispatched: Dispatched) -> None:
        vehicle, way, why = dispatched.vehicle, dispatched.way, dispatched.assignment.why
        routes = (leg.points for leg in way.legs)
        order = dispatched.assignment.order.assigned(vehicle.name, routes, why, self._clock.now())
        log.info("order assigned", order=order.name, vehicle=vehicle.name, why=why)
        self._timeouts.watch(order)
        self._missions.assign(order, vehicle.key)
        self._sequences.bind(order, vehicle.name)
        self._drive(order, vehicle, way)

    def _drive(self, order: TransportOrder, vehicle: FleetVehicle, way: Way, *, first: bool = False) -> None:
        self._book.put(order)
        self._steps.vehicle_changed(vehicle.name)
        retriable = self._failures.retries_actions(order)
        self._driving.want(order, vehicle, way, first=first, retriable=retriable)
