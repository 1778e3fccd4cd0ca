"""The life cycle of transport orders: created, assigned, driven, failed, held, withdrawn, ended.

From top to bottom: requests of hosts, dispatching, the drive to each destination, events of the robots,
failures, the end of an order, and recovery. Everything here runs in the engine's units of work.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import timedelta

from nena_order_service.engine.conditions import Conditions, Sequences
from nena_order_service.engine.context import Context
from nena_order_service.engine.dispatching import GIVES_UP, Dispatched, Dispatching
from nena_order_service.engine.driving import Driving, Pauses, Stuck
from nena_order_service.engine.failing_vehicles import FailingVehicles
from nena_order_service.engine.failure_policy import FailureAssessment, with_passed_over
from nena_order_service.engine.peripherals import Peripherals
from nena_order_service.engine.recovery import Recovery
from nena_order_service.fleet import outputs
from nena_order_service.fleet.failures import FailureKind, OrderFailure, with_details
from nena_order_service.fleet.instant_actions import retry_or_skip
from nena_order_service.fleet.position import NotLocatedError
from nena_order_service.fleet.robot import RobotView
from nena_order_service.fleet.vda_order import unique_id
from nena_order_service.orders import deadlines
from nena_order_service.orders.automatic import automatic_name
from nena_order_service.orders.deadlines import DueTimes
from nena_order_service.orders.drive import Drive, DriveState
from nena_order_service.orders.transport_order import EventCode, TransportOrder, why_withdrawn
from nena_order_service.orders.validation import InvalidRequestError, check_order
from nena_order_service.peripherals.jobs import PeripheralJob
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.routing.router import RoutePlan
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode, explained, reason_of
from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    FailureMeasure,
    Hold,
    OrderOutcome,
    TransportOrderRequest,
    TransportOrderState,
)
from nena_shared.log import get_logger
from nena_shared.plant import UnknownObjectError
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

S = TransportOrderState
R = ReasonCode

BEGUN_MEANWHILE = Reason(R.STOPPED_OPERATING)
POLICY = "failure policy"
"""The holder (``by``) of an order that its failure policy has put on hold."""

REASONS_PER_CHECK = 100
"""Maximum number of wait reasons that change between two checks, those of the most urgent orders first. Each
one is stored and published, and those of a long queue may change with each state of a robot."""

OrderEvent = (
    outputs.VdaOrderAccepted
    | outputs.OperationStarted
    | outputs.VdaOrderFinished
    | outputs.VdaOrderFailed
    | outputs.VdaOrderCancelled
)
"""Events of a VDA 5050 order at its robot."""


class LifeCycle:
    """Changes transport orders, and requests the drives of their vehicles."""

    def __init__(
        self,
        context: Context,
        driving: Driving,
        dispatching: Dispatching,
        sequences: Sequences,
        pauses: Pauses,
        *,
        peripherals: Peripherals,
    ) -> None:
        self._context = context
        self._state = context.state
        self._orders = context.state.orders
        self._drives = context.state.drives
        self._clock = context.clock
        self._registry = context.registry
        self._driving = driving
        self._dispatching = dispatching
        self._sequences = sequences
        self._pauses = pauses
        self._peripherals = peripherals
        self.conditions = Conditions(context, sequences)
        self._failures = FailureAssessment(context, dispatching.fit)
        self._failing_vehicles = FailingVehicles(context)
        self._deadlines = DueTimes(self._orders.is_over)
        self._timeouts = DueTimes(self._orders.is_over)
        self._reasons_left = REASONS_PER_CHECK
        self._answers: dict[str, tuple[str, Reason]] = {}
        """VDA 5050 orderIds and failure texts, by the IDs of the instant actions sent for them."""

    # Requests of hosts

    def create_order(
        self,
        request: TransportOrderRequest,
        name: str,
        ended: Mapping[str, OrderOutcome] | None = None,
        *,
        automatic: bool = False,
        by: str | None = None,
    ) -> TransportOrder:
        """Create an order from a validated request, and dispatch it if possible.

        ``ended`` has the final states of dependencies that are no longer in memory; ``by``: who requested it.
        """
        now, number = self._clock.now(), self._orders.next_number()
        order = TransportOrder.created(request, number=number, name=name, now=now, automatic=automatic, by=by)
        why = self._context.finder.why_unroutable(request.destinations, order.resources_to_avoid)
        order = order.unroutable(why, now) if why else order.activated()
        self._sequences.append_order(order)
        order = order if why else self.conditions.check_new_order(order, ended or {})
        self._orders.put(order)
        if not order.state.final:
            self._watch_times(order)
        self._state.dispatch_due |= order.state is S.DISPATCHABLE
        return order

    def create_automatic_order(self, request: TransportOrderRequest) -> bool:
        """Create an order for an idle vehicle; return whether the vehicle has started it.

        An order that does not start at once is withdrawn, because the vehicle may need another one later.
        """
        order = self.create_order(request, automatic_name(request), automatic=True)
        if order.state is S.DISPATCHABLE:
            self._assign_waiting((order,))
        order = self._orders.get(order.number)
        begun = order.state is S.BEING_PROCESSED
        if not begun and not order.state.final:
            self.withdraw_order(order, Reason(R.NOT_STARTED), immediate=True)
        return begun

    def change_order(self, order: TransportOrder, changes: Mapping[str, object]) -> None:
        """Change an order that no vehicle has, by field name, and dispatch it again."""
        order = order.altered(changes, self._clock.now())
        self._orders.put(order)
        self._watch_times(order)
        self._state.dispatch_due = True
        log.info("order changed", order=order.name, fields=sorted(changes))

    def withdraw_order(self, order: TransportOrder, reason: Reason | str, *, immediate: bool) -> None:
        """Withdraw an order that has not ended (openTCS: withdrawal).

        With ``immediate`` its robot is sent cancelOrder (VDA 5050 3.0, section 6.1.3); otherwise it drives to
        the end of its base and executes the actions there. Withdrawing an order again can only make it
        immediate.
        """
        again = order.state is S.WITHDRAWN
        if not again:
            order = order.withdrawn(reason, self._clock.now())
            self._orders.put(order)
        drive = self._drives.of_order(order)
        if order.state.final:
            return
        if drive is None:
            self._end_withdrawn_unsent(order)
        elif immediate and not drive.cancelled:
            self._driving.cancel_drive(drive)
        elif not immediate and not again:
            # VDA 5050 can only cancel at once; an update that takes the horizon away ends it with its base.
            self._driving.end_early(drive, partial=False)

    def hold_order(self, order: TransportOrder, by: str, reason: str, *, immediate: bool) -> None:
        """Hold an order until it is resumed; it keeps its vehicle.

        With ``immediate`` the robot is sent cancelOrder, otherwise it drives to the end of its base. It
        finishes an operation that has begun in either case. Holding an order again keeps the first holder,
        and can only make the stop immediate.
        """
        now = self._clock.now()
        if not order.held:
            order = order.on_hold(Hold(by=by, since=now, **explained(reason)), now)
            self._orders.put(order)
            log.info("order held", order=order.name, by=by, reason=reason)
        self._state.dispatch_due = True
        if order.state is not S.BEING_PROCESSED:
            return
        vehicle, drive = self._registry.named(order.vehicle), self._drives.of_order(order)
        assert vehicle, "the vehicle of an order is in the registry"  # noqa: S101 - for the type
        if drive is None:
            self._driving.drop_drive(vehicle)
            self._pauses.begin(vehicle, order)
        elif order.is_operating:
            pass  # a load that is half handed over is worse than a late stop
        elif immediate and not drive.cancelled:
            self._driving.cancel_drive(drive)
        elif not immediate:
            self._driving.end_early(drive, partial=True)

    def resume_order(self, order: TransportOrder, by: str, reason: str) -> None:
        """Resume a held order from the position of its vehicle; do nothing if it is not held."""
        if order.held:
            self._orders.put(self.conditions.update_state(order.resumed(by, reason, self._clock.now())))
            log.info("order resumed", order=order.name, by=by, reason=reason)
            self._state.dispatch_due = True

    # Time

    def check_times(self) -> None:
        """Mark orders as late after their deadlines, and withdraw those that have timed out.

        Also allow further wait reasons to change.
        """
        now = self._clock.now()
        self._reasons_left = REASONS_PER_CHECK
        for number in self._deadlines.take(now - timedelta.resolution):  # until the deadline, inclusive
            if order := self._orders.find(number):
                self._orders.put(order.overdue(now))
        for number in self._timeouts.take(now):
            order = self._orders.find(number)
            if order and not order.state.final:
                log.info("order timed out", order=order.name)
                # 0025: a timeout is a withdrawal, and not a second way to end an order.
                self.withdraw_order(order, deadlines.reason(order, now), immediate=True)

    def _watch_times(self, order: TransportOrder) -> None:
        self._deadlines.watch(order.number, deadlines.deadline_of(order))
        self._timeouts.watch(order.number, deadlines.timeout_of(order))

    # Dispatching

    def dispatch_orders(self) -> None:
        """Assign waiting orders, and continue orders whose pauses are over."""
        self._state.dispatch_due = False
        for name, order in self._pauses:
            vehicle = self._registry.named(name)
            if vehicle and self._pauses.is_over(vehicle):
                self._resume_driving(order, vehicle)
            elif vehicle:
                self.update_reason(vehicle)
        self._assign_waiting([order for order in self._orders.dispatchable() if not order.held])

    def _assign_waiting(self, orders: Sequence[TransportOrder]) -> None:
        """Assign as many of these orders as possible, and update the wait reasons of the others."""
        dispatched, reasons = self._dispatching.decide(orders)
        for decision in dispatched:
            wanted, given_up = decision.assignment.order.name, decision.assignment.gives_up
            if not given_up:
                self._assign_order(decision)
                continue
            # A dispensable order gives way (openTCS). Its vehicle drives to the end of its base and is free
            # there; one that is recharging would stay for long, so it is sent cancelOrder.
            dispensable, vehicle = self._orders.named(given_up), decision.vehicle.name
            assert dispensable, "vehicles work on known orders"  # noqa: S101 - for the type
            log.info("order gives way", order=given_up, vehicle=vehicle, wanted=wanted)
            why = Reason(R.GIVES_WAY, order=wanted)
            self.withdraw_order(dispensable, why, immediate=dispensable.is_operating)
            reasons[wanted] = Reason(R.WAITS_FOR_VEHICLE, GIVES_UP, vehicle=vehicle)
        now = self._clock.now()
        for order in orders:
            reason = reasons.get(order.name)
            if reason is None or reason.is_sent_as(order.status.coded_reason):
                continue
            if order.status.history[-1].event_code != EventCode.DISPATCHING_DEFERRED:
                self._orders.put(order.deferred(reason, now))  # its first reason is never late
            elif self._reasons_left:
                self._reasons_left -= 1
                self._orders.put(order.deferred(reason, now))

    def _assign_order(self, dispatched: Dispatched) -> None:
        vehicle, way, why = dispatched.vehicle, dispatched.way, dispatched.assignment.why
        standing = self._context.planner.standing(vehicle, self._context.view(vehicle))
        if not standing.on_point:
            metres = round(standing.distance_m, 1)
            why = Reason(R.JOINS_TRACK, why, metres=metres, point=standing.point)
        routes = (leg.points for leg in way.legs)
        order = dispatched.assignment.order.assigned(vehicle.name, routes, why, self._clock.now())
        log.info("order assigned", order=order.name, vehicle=vehicle.name, why=str(why))
        self._watch_times(order)
        self._drives.assign(order, vehicle.key)
        self._sequences.bind_vehicle(order, vehicle.name)
        self._request_drive(order, vehicle, way)

    # The drive to each destination

    def _continue_order(self, order: TransportOrder, *, again: bool = False) -> None:
        """Drive to the current destination, ``again`` or for the first time, unless the order must wait."""
        vehicle = self._registry.employed(order.vehicle)
        if vehicle is None:
            self._end_order(order.failed(_vehicle_gone(order), self._clock.now()))
            return
        order = order.restarted() if again else order
        self._orders.put(order)
        self._pauses.begin(vehicle, order)
        self._state.vehicle_changed(vehicle.name)
        if self._pauses.is_over(vehicle):
            self._resume_driving(order, vehicle, first=again)
        else:
            self.update_reason(vehicle)

    def _resume_driving(self, order: TransportOrder, vehicle: FleetVehicle, *, first: bool = False) -> None:
        """End the pause of an order and drive to its current destination; fail it without a route.

        Without a destination that is left, the order is finished.
        """
        self._pauses.end(vehicle.name)
        if order.current.state is DriveOrderState.FINISHED:
            self._end_order(order.finished(self._clock.now()))
            return
        order, planner = order.tried(), self._context.planner
        try:
            standing = planner.standing(vehicle, self._context.view(vehicle))
            way = planner.way(order, vehicle, standing)
        except (NotLocatedError, NoRouteError, UnknownObjectError) as error:
            why = Reason(R.CANNOT_CONTINUE, reason_of(error), vehicle=vehicle.name)
            self._fail_order(order, OrderFailure(FailureKind.NO_WAY, why))
        else:
            self._request_drive(order, vehicle, way, first=first)

    def _request_drive(
        self, order: TransportOrder, vehicle: FleetVehicle, way: RoutePlan, *, first: bool = False
    ) -> None:
        self._orders.put(order)
        self._state.vehicle_changed(vehicle.name)
        retriable = self._failures.retries_actions(order)
        self._driving.request_route(order, vehicle, way, first=first, retriable=retriable)

    def on_stuck_vehicle(self, stuck: Stuck) -> None:
        """Fail the order of a vehicle without a route, or pause it until paths are unlocked."""
        vehicle, order = stuck.vehicle, self._state.order_of(stuck.vehicle.key)
        if order is None:
            return
        self._pauses.begin(vehicle, order)
        if self._pauses.is_over(vehicle):
            self._pauses.end(vehicle.name)
            self._fail_order(order, OrderFailure(FailureKind.NO_WAY, stuck.reason))
        else:
            self.update_reason(vehicle)

    def update_reason(self, vehicle: FleetVehicle, view: RobotView | None = None) -> None:
        """Update the wait reason of a vehicle's order; ``view``: what is known about its robot now."""
        order = self._state.order_of(vehicle.key)
        if order is None:
            return
        view = view or self._context.view(vehicle)
        changed = order.with_wait_reason(view.wait_reason or self._driving.wait_reason(vehicle))
        if changed is not order:
            self._orders.put(changed)
            self._state.vehicle_changed(order.vehicle)

    # Events of robots

    def robot_changed(self, vehicle: FleetVehicle, view: RobotView) -> None:
        """Handle a new state of a robot."""
        if vehicle.name in self._pauses or self._dispatching.is_due_for(vehicle):
            self._state.dispatch_due = True
        self.update_reason(vehicle, view)

    def on_order_event(self, event: OrderEvent) -> None:
        """Handle an event of a VDA 5050 order."""
        drive = self._drives.with_id(event.robot, event.order_id)
        if drive is None:
            log.warning("event for an unknown VDA 5050 order", robot=str(event.robot), order=event.order_id)
            return
        ahead = self._driving.ahead_of(drive)  # before the drive ends: it knows what was left of its route
        if isinstance(event, outputs.VdaOrderAccepted):
            self._drives.put(drive.changed(state=DriveState.ACCEPTED))
        elif isinstance(event, outputs.VdaOrderFinished):
            self._driving.finish_drive(drive)
        elif isinstance(event, outputs.VdaOrderFailed | outputs.VdaOrderCancelled):
            self._driving.break_off(drive, event)
        vehicle = self._registry.discover(drive.robot)
        self._state.vehicle_changed(vehicle.name)
        if not drive.relocation:
            self._on_drive_order(drive, event, ahead)
            return
        if isinstance(event, outputs.VdaOrderFinished):
            self._failing_vehicles.on_finished_drive(vehicle)
        if isinstance(event, outputs.VdaOrderFailed):
            log.warning("vehicle did not make room", vehicle=vehicle.name, reason=str(event.reason))
        if isinstance(event, outputs.VdaOrderFinished | outputs.VdaOrderFailed | outputs.VdaOrderCancelled):
            self._state.dispatch_due = True

    def _on_drive_order(self, drive: Drive, event: OrderEvent, ahead: tuple[str, ...]) -> None:
        order = self._state.order_of(drive.robot)
        assert order, "a robot with a drive order works on its transport order"  # noqa: S101 - for the type
        assert drive.drive_order_index is not None, "only relocations have none"  # noqa: S101 - for the type
        match event:
            case outputs.VdaOrderAccepted():
                pass
            case outputs.OperationStarted():
                if not drive.partial:  # otherwise it is a required action at a premature end
                    self._orders.put(order.operating(drive.drive_order_index, self._clock.now()))
            case outputs.VdaOrderFinished():
                self._drive_order_finished(order, drive)
            case outputs.VdaOrderFailed():
                words = with_details(event.reason, event.details)
                self._drive_order_failed(order, OrderFailure(event.kind, words, ahead))
            case outputs.VdaOrderCancelled():
                self._drive_order_cancelled(order, drive)

    def _drive_order_finished(self, order: TransportOrder, drive: Drive) -> None:
        now, index = self._clock.now(), order.status.current_drive_order_index
        # openTCS: a withdrawn order ends as FAILED, even if its vehicle has done all of it.
        if order.state is S.WITHDRAWN:
            self._end_order(order.failed(_end_of_withdrawn(order, Reason(R.BASE_FINISHED)), now))
            return
        job = self._peripherals.failed_job_behind(drive)
        failure = _failure_of(job) if job else None
        if drive.partial:  # otherwise the robot has finished everything, in spite of a cancel
            failure = drive.given_up or failure
        # A drive that ended early has only finished the actions at the end of its base, not its operation.
        order = order if drive.partial else order.drive_order_finished(index, now)
        vehicle = self._registry.discover(drive.robot)
        if not drive.partial and len(drive.vda_order.nodes) > 1:
            self._failing_vehicles.on_finished_drive(vehicle, order.status.drive_orders[index].destination)
        last = order.current.state is DriveOrderState.FINISHED
        if failure and (last or not order.held):
            self._fail_order(order, failure)
        # 0052: a required job after the last movement belongs to the order, which waits for its end.
        elif last and not failure and not self._peripherals.jobs_behind(vehicle):
            self._end_order(order.finished(now))
        else:
            order = order.failed_while_held(failure.words) if failure else order
            self._continue_order(order, again=drive.partial)

    def _drive_order_failed(self, order: TransportOrder, failure: OrderFailure) -> None:
        if order.state is S.WITHDRAWN:
            self._end_order(order.failed(_end_of_withdrawn(order, failure.words), self._clock.now()))
        elif order.held:
            self._continue_order(order.failed_while_held(failure.words), again=True)
        else:
            self._fail_order(order, failure)

    def _drive_order_cancelled(self, order: TransportOrder, drive: Drive) -> None:
        """End a withdrawn order; pause a held one, or continue it if it was resumed meanwhile."""
        if order.state is S.WITHDRAWN:
            self._end_order(order.failed(_end_of_withdrawn(order, Reason(R.RELEASED)), self._clock.now()))
        elif drive.given_up and not order.held:
            self._fail_order(order, drive.given_up)
        elif order.is_operating and not drive.given_up:
            # The operation began before cancelOrder reached the robot: how far it got is unknown.
            self._drive_order_failed(order, OrderFailure(FailureKind.UNCLEAR, BEGUN_MEANWHILE))
        else:
            self._continue_order(order, again=True)

    # Failures

    def _fail_order(self, order: TransportOrder, failure: OrderFailure) -> None:
        """Take the next measure of the failure policy for an order that has failed at its vehicle."""
        vehicle = self._registry.employed(order.vehicle)
        if vehicle is None:
            why = Reason(R.ALL, _vehicle_gone(order), failure.words)
            self._end_order(order.failed(why, self._clock.now()))
            return
        if order.current.state is DriveOrderState.FINISHED:  # nothing is left to try again
            self._end_order(order.failed(failure.words, self._clock.now()))
            return
        decision = self._failures.decide(order, failure)
        step, words, now = decision.step, failure.words, self._clock.now()
        next_try = now + timedelta(seconds=step.after) if step.after else None
        log.info("measure taken", order=order.name, measure=step.do, kind=failure.kind, reason=str(words))
        if step.do in (FailureMeasure.OTHER_VEHICLE, FailureMeasure.FAIL):
            self._failing_vehicles.on_failed_order(vehicle, order.current.destination, failure)
        match step.do:
            case FailureMeasure.RETRY:
                order = order.retried(decision.taken, words, now=now, next_try=next_try)
                self._continue_order(order, again=True)
            case FailureMeasure.REPLAN:
                avoided = self._failures.detour_of(order, failure.ahead)
                order = order.replanned(decision.taken, words, now=now, avoided=avoided, next_try=next_try)
                self._continue_order(order, again=True)
            case FailureMeasure.OTHER_VEHICLE:
                self._release_vehicle(order.reassigned(decision.taken, words, now))
                log.info("order waits for another vehicle", order=order.name)
            case FailureMeasure.SKIP:
                self._skip_destination(order.skipped(words, now))
            case FailureMeasure.HOLD:
                hold = Hold(by=POLICY, since=now, **explained(with_passed_over(words, decision)))
                self._continue_order(order.on_hold(hold, now), again=True)
            case FailureMeasure.FAIL:
                self._end_order(order.failed(with_passed_over(words, decision), now))

    def _skip_destination(self, order: TransportOrder) -> None:
        if order.current.state is DriveOrderState.TRAVELLING:
            self._continue_order(order)
        else:
            self._end_order(order.finished(self._clock.now()))

    def on_failed_peripheral(self, job: PeripheralJob) -> None:
        """Fail the drive of a vehicle that needs a failed job; its robot stops at the end of its base."""
        order = self._orders.named(job.status.related_transport_order or "")
        if order is None:
            self._driving.drop_relocation(job.order_id)
            return
        vehicle = self._registry.named(order.vehicle)
        if order.state is not S.BEING_PROCESSED or vehicle is None:
            return
        # openTCS withdraws the order; here its failure policy decides.
        failure, drive = _failure_of(job), self._drives.of_order(order)
        if order.held and order.current.state is not DriveOrderState.FINISHED:
            if job.after_movement:
                self._orders.put(order.failed_while_held(failure.words))
        elif drive is None:
            self._driving.drop_drive(vehicle)
            self._fail_order(order, failure)
        elif not drive.cancelled and not drive.all_released:
            self._driving.end_early(self._mark_given_up(drive, failure), partial=True)

    def _mark_given_up(self, drive: Drive, failure: OrderFailure) -> Drive:
        """Note for which failure a VDA 5050 order ends early."""
        drive = drive.changed(given_up=failure)
        self._drives.put(drive)
        return drive

    # Retriable actions (VDA 5050 3.0, sections 6.2.3 and 6.6.9)

    def on_retriable_action(self, event: outputs.ActionRetriable) -> None:
        """Send ``retry`` or ``skipRetry`` to a robot that waits with a RETRIABLE action (section 6.6.9).

        ``retry`` if the failure policy retries at once, otherwise ``skipRetry``: the VDA 5050 order then
        fails, as with robots without retries, and the policy continues.
        """
        drive, order = self._drives.with_id(event.robot, event.order_id), self._state.order_of(event.robot)
        if drive is None or drive.cancelled or drive.relocation or order is None:
            return
        words = with_details(event.reason, event.details)
        action = retry_or_skip(unique_id(), event.action_id, retry=self._retries_action(order, words))
        self._answers[action.action_id] = event.order_id, words
        log.info("action has failed", vda_order=event.order_id, answer=action.action_type, reason=str(words))
        # 0008: only once the try is in the store, so that a restart counts it.
        self._state.after_commit(lambda: self._context.fleet.instant_action(event.robot, action))

    def _retries_action(self, order: TransportOrder, words: Reason) -> bool:
        if order.held or order.state is not S.BEING_PROCESSED:
            return False
        decision = self._failures.decide(order, OrderFailure(FailureKind.ACTION, words))
        if decision.step.do is not FailureMeasure.RETRY or decision.step.after:
            return False
        self._orders.put(order.retried(decision.taken, words, now=self._clock.now()))
        return True

    def on_instant_action(self, event: outputs.InstantActionEnded) -> None:
        """Cancel the VDA 5050 order of a robot that did not execute ``retry`` or ``skipRetry``."""
        if (answered := self._answers.pop(event.action.action_id, None)) is None:
            return
        order_id, words = answered
        drive = self._drives.with_id(event.robot, order_id)
        if drive and not drive.cancelled and event.status is not ActionStatus.FINISHED:
            log.warning(
                "robot rejected the answer about its failed action",
                vda_order=order_id,
                reason=str(event.reason),
            )
            rejected = event.status is ActionStatus.FAILED  # otherwise it may be retrying right now
            kind = FailureKind.ACTION if rejected else FailureKind.UNCLEAR
            self._driving.cancel_drive(self._mark_given_up(drive, OrderFailure(kind, words)))

    # The end

    def fail_order_of(self, robot: RobotKey, reason: Reason) -> None:
        """Fail the order of a robot, if it has one, whatever its robot reports and its policy says."""
        if order := self._state.order_of(robot):
            self._end_order(order.failed(reason, self._clock.now()))

    def _end_withdrawn_unsent(self, order: TransportOrder) -> None:
        why = Reason(R.WITHDRAWN_UNSENT, why_withdrawn(order.status))
        self._end_order(order.failed(why, self._clock.now()))

    def _end_order(self, order: TransportOrder) -> None:
        """Store an order's final state, and release its vehicle."""
        self._release_vehicle(order)
        status = order.status
        by, state, reason = status.processing_vehicle, status.state.value, status.reason
        log.info("order ended", order=status.name, vehicle=by, state=state, reason=reason)

    def _release_vehicle(self, order: TransportOrder) -> None:
        """Release an order from its vehicle."""
        self._orders.put(order)
        robot = self._drives.release(order)
        if robot is not None:
            vehicle = self._registry.discover(robot)
            self._pauses.end(vehicle.name)
            self._driving.drop_drive(vehicle)
            self._state.vehicle_changed(vehicle.name)
        self._state.dispatch_due = True

    # After a restart

    def restore_orders(
        self, orders: Iterable[TransportOrder], documents: Mapping[int, str], recovery: Recovery
    ) -> None:
        """Restore orders after a restart; their robots' states decide how they continue.

        The newest orders are handled first, so that dependent orders exist when others fail. Orders without a
        VDA 5050 order are handled last, because vehicles may have been renamed since.
        """
        self._failing_vehicles.restore()
        now, unsent = self._clock.now(), list[TransportOrder]()
        for order in sorted(orders, key=lambda order: -order.number):
            self._watch_times(order)
            if order.state in (S.ACTIVE, S.DISPATCHABLE):
                try:
                    check_order(order.status, self._context.plant)
                except InvalidRequestError as error:  # the plant model has changed meanwhile
                    self._orders.put(order.failed(Reason(R.NOT_POSSIBLE, reason_of(error)), now))
                else:
                    self._orders.put(self.conditions.register_order(order))
            elif (document := documents.get(order.number)) is None:
                unsent.append(order)
            elif vehicle := recovery.restore_order(order, document):
                self._orders.put(order.adopted(now, vehicle.name))
            else:
                self._end_order(order.adopted(now).failed(Reason(R.VDA_ORDER_UNREADABLE), now))
        for order in unsent:
            self._continue_unsent(order, recovery)

    def _continue_unsent(self, order: TransportOrder, recovery: Recovery) -> None:
        """Continue an order whose next VDA 5050 order was not sent yet."""
        vehicle = recovery.present_vehicle(order.vehicle or "")
        order = order.adopted(self._clock.now(), vehicle.name if vehicle else None)
        if order.state is S.WITHDRAWN:
            self._end_withdrawn_unsent(order)
        elif vehicle is None:
            self._end_order(order.failed(_vehicle_gone(order), self._clock.now()))
        elif self._drives.order_number(vehicle.key) is not None:
            why = Reason(R.VEHICLE_REPLACED, vehicle=vehicle.name)
            self._end_order(order.failed(why, self._clock.now()))
        else:
            self._orders.put(order)
            self._drives.assign(order, vehicle.key)
            self._pauses.begin(vehicle, order)


def _failure_of(job: PeripheralJob) -> OrderFailure:
    """Return what a failed job means for the order that needs it."""
    status = job.status
    why = Reason(
        R.PERIPHERAL_FAILED_BY,
        Reason.of(status.reason, status.coded_reason),
        location=status.location,
        operation=status.operation,
    )
    return OrderFailure(FailureKind.DRIVE, why, (status.path,) if status.path else (), by_device=True)


def _vehicle_gone(order: TransportOrder) -> Reason:
    """Return that the vehicle of an order no longer exists."""
    return Reason(R.VEHICLE_GONE, vehicle=order.vehicle or "")


def _end_of_withdrawn(order: TransportOrder, end: Reason) -> Reason:
    """Return why an order was withdrawn, and how its vehicle has ended it."""
    return Reason(R.WITHDRAWN, why_withdrawn(order.status), end)
