"""Fleet control of many robots: messages and time go in, messages to send and events come out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from typing import Final

from nena_order_service.fleet import availability
from nena_order_service.fleet.availability import equipment_of, significant_fields
from nena_order_service.fleet.failures import RobotBusyError
from nena_order_service.fleet.feasibility import fitted_order, order_problem
from nena_order_service.fleet.instant_actions import STATE_REQUEST, InstantActionManager, without_parameters
from nena_order_service.fleet.order_execution import OrderExecution
from nena_order_service.fleet.outputs import (
    BrokerLinkChanged,
    FleetOutput,
    Outputs,
    PublishInstantActions,
    RobotChanged,
    StateIgnored,
)
from nena_order_service.fleet.robot import (
    REPORTS_NOTHING,
    Availability,
    LinkStatus,
    Robot,
    RobotView,
    VdaOrderPhase,
    header_text,
    is_idle,
)
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder, unique_id
from nena_order_service.fleet.zones import ReleaseManager
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey

R = ReasonCode

ENDED_ORDERS_KEPT: Final = 50
"""Number of ended VDA orders remembered per robot, to stop a robot that accepts one too late."""

STRAY_PAUSE: Final = 30.0
"""Seconds between attempts to stop a robot that executes a VDA order that has already ended here."""


TOLD_FROM: Final = 10.0
"""Seconds; a longer minimum interval between two orders is a reason to wait that people are told."""


def _no_deviations(_: RobotKey) -> tuple[Repair, ...]:
    return ()


class RobotControl:
    """Controls one robot. The methods yield messages to send and events: exhaust them."""

    def __init__(
        self,
        key: RobotKey,
        settings: FleetSettings,
        new_id: Callable[[], str],
        *,
        broker: bool,
        deviations: Callable[[RobotKey], tuple[Repair, ...]] = _no_deviations,
    ) -> None:
        self.robot = Robot(key, settings)
        self.unasked = False
        """Whether the robot is to be asked for its state, because it may have changed unseen."""
        self._came_online = False
        """Whether it, or our own link, has connected since its last state: what was sent may be lost."""
        self._deviations = deviations
        self._settings = settings
        self._new_id = new_id
        self._instant_actions = InstantActionManager(self.robot, settings, new_id, broker=broker)
        self._run: OrderExecution | None = None
        self._ended: deque[str] = deque(maxlen=ENDED_ORDERS_KEPT)
        self._last_order_at: float | None = None
        self._next_stray_cancel = 0.0
        self._reported: tuple[object, ...] = ()
        self._reported_link = LinkStatus.UNKNOWN
        self._changes = 0
        """Number of possible changes so far."""
        self._advance_due = False
        """Whether our own link to the broker has changed since the robot was last handled."""
        self._significant: tuple[object, ...] = ()
        """The significant fields of the last state."""
        self._left_at = -1
        """The number of changes when the last state was handled."""
        self._last_view: tuple[tuple[object, ...], RobotView] | None = None

    def on_broker(self, *, connected: bool, unread: bool) -> None:
        """Note the state of our own link; for ``unread`` see :meth:`FleetController.on_broker`."""
        self.unasked = self._came_online = connected
        self._instant_actions.broker = connected
        self._instant_actions.unread = connected and unread
        self._changes += 1
        self._advance_due = True

    def on_connection(self, message: Connection, now: float) -> Iterator[FleetOutput]:
        """Handle a connection message (section 6.5)."""
        self._came_online = message.connection_state is ConnectionState.ONLINE
        if self.robot.take_connection(message, now):
            self._instant_actions.on_reconnect()
            self.unasked = self.robot.is_reachable and (self.robot.state is None or self.robot.stale)
            if self._run and self.robot.stale:
                self._run.doubt_position()
        yield from self._instant_actions.on_link(self.robot.link_status(now))
        yield from self._send_and_report(now)

    def on_factsheet(self, message: Factsheet, now: float) -> Iterator[FleetOutput]:
        """Handle a factsheet (section 7.10)."""
        self.robot.take_factsheet(message)
        if self._run:
            self._run.outdated_fit = True
        yield from self._send_and_report(now)

    def on_malformed(self, problem: Reason | None, now: float) -> Iterator[FleetOutput]:
        """Count another message that could not be read.

        ``problem`` describes the error; None: fleet control does not need the message.
        """
        self.robot.take_malformed(problem, now)
        self._changes += 1
        yield from self._report_change(now)

    def on_other_topic(self, topic: str, expected: str, now: float) -> Iterator[FleetOutput]:
        """Note that a message came on ``topic``, which is similar to the ``expected`` one."""
        self.robot.other_topic = Reason(R.OTHER_TOPIC, topic=topic, expected=expected)
        self._changes += 1
        yield from self._report_change(now)

    def on_undeliverable(self, topic: str, now: float) -> Iterator[FleetOutput]:
        """End a VDA order that cannot be sent, because the broker ends our connection at it."""
        if self._run:
            yield from self._run.on_undeliverable(topic)
            yield from self._send_and_report(now)

    def on_unreadable_state(
        self, problem: Reason, sighting: State | None, now: float
    ) -> Iterator[FleetOutput]:
        """Handle a state that could not be read; ``sighting``: what it says about the robot itself."""
        self.robot.take_unreadable_state(problem, sighting, now)
        yield from self._send_and_report(now)

    def on_old_state(self, header: str, last: str, now: float) -> Iterator[FleetOutput]:
        """Handle a state that is ignored, because its ``header`` does not come after the ``last`` one."""
        self.robot.take_old_state(header, last, now)
        self._changes += 1
        yield StateIgnored(self.robot.key)
        yield from self._report_change(now)

    def on_substituted(self, repairs: tuple[Repair, ...]) -> None:
        """Note what the next state does not say in the standard's words."""
        if repairs != self.robot.substituted:
            self.robot.substituted = repairs
            self._changes += 1

    def on_state(self, message: State, now: float) -> Iterator[FleetOutput]:
        """Handle a state (section 6.6): instant actions first, because they may end a VDA order."""
        placed, was_unreadable = self.robot.placed, self.robot.unreadable
        if not self.robot.take_state(message, now):
            header = header_text(message.header_id, message.timestamp)
            yield from self.on_old_state(header, self.robot.last_header, now)
            return
        self.unasked = False
        if was_unreadable or self.robot.placed != placed or self._instant_actions.unread:
            self._changes += 1
        self._instant_actions.unread = False
        if not self._is_repetition(message):
            for event in self._instant_actions.on_state(message, now):
                if self._run:
                    self._run.on_event(event)
                yield event
            if self._run:
                if availability.is_lost(message, placed=self.robot.placed):
                    self._run.doubt_position()
                yield from self._run.on_state(message, now)
                # not before its state: robots publish ONLINE before they subscribe
                if self._came_online:
                    self._run.hasten()
            yield from self._send_and_report(now)
        self._came_online = False
        self._left_at = self._changes

    def _is_repetition(self, message: State) -> bool:
        """Return whether a state is like the last one in what matters, and nothing else is to be done."""
        previous, self._significant = self._significant, significant_fields(message)
        if self._significant != previous or self._changes != self._left_at or not self.is_quiet:
            return False
        # Clearing instant actions, requesting factsheets and stopping strays depend on the time, and are
        # therefore due at some state that is like the one before.
        if message.instant_action_states or self.robot.abilities is None:
            return False
        return self._run is not None or is_idle(message, self._instant_actions.ids)

    def start_order(self, vda_order: VdaOrder, now: float) -> Iterator[FleetOutput]:
        """Send a VDA order as soon as the robot can be sent one; until then the view has the wait reason.

        RobotChanged is only reported if it is not sent at once.

        Raises:
            RobotBusyError: the robot already has a VDA order; at the call, before the iterator is consumed.
        """
        run = OrderExecution(self.robot.key, vda_order, self._settings)
        outputs, sent = self._begin_order(run, now), VdaOrderPhase.SENT
        # Its vehicle is published with the start; as a change of its own, it would be once more.
        return (each for each in outputs if run.phase is not sent or not isinstance(each, RobotChanged))

    def adopt_order(
        self, vda_order: VdaOrder, now: float, *, accepted: bool, update_id: int = 0
    ) -> Iterator[FleetOutput]:
        """Adopt a VDA order from before a restart; the robot's next state decides how it continues.

        If the robot has the order, it continues, and events may be repeated. If not, it is sent the order,
        unless it had ``accepted`` it: then the robot has lost the order, and the VDA order fails.
        ``update_id`` is the last update that was sent; a robot with an older one is sent the rest.

        Raises:
            RobotBusyError: as :meth:`start_order`.
        """
        run = OrderExecution(
            self.robot.key, vda_order, self._settings, adopted=True, accepted=accepted, update_id=update_id
        )
        return self._begin_order(run, now)

    def _begin_order(self, run: OrderExecution, now: float) -> Iterator[FleetOutput]:
        # No generator: a busy robot is an error of the call, before anything is iterated.
        if self._run:
            raise RobotBusyError(self.robot.key, self._run.vda_order.order_id)
        self._run = run
        return self._send_and_report(now)

    def extend_order(self, vda_order: VdaOrder, now: float) -> Iterator[FleetOutput]:
        """Update the robot's VDA order to a newer plan: a longer base, or another horizon (section 6.1.2).

        The order update is sent once the robot has echoed the previous message; of several plans in the
        meantime, only the newest is sent. Does nothing for a VDA order that has ended.

        Raises:
            BaseChangedError: the plan does not continue from the base that the robot was sent; at the call,
                before the iterator is consumed.
        """
        run, abilities = self._run, self.robot.abilities
        if run and run.vda_order.order_id == vda_order.order_id:
            run.extend(fitted_order(vda_order, abilities))
        return self._send_and_report(now)

    def release_base(self, order_id: str, sequence_id: int | None, now: float) -> Iterator[FleetOutput]:
        """Extend the base of the robot's VDA order as planned, to the node ``sequence_id`` or its end (None).

        Sent as by :meth:`extend_order`. Does nothing for a VDA order that has ended.
        """
        if self._run and self._run.vda_order.order_id == order_id:
            self._run.release(sequence_id)
        return self._send_and_report(now)

    def cancel_order(self, now: float) -> Iterator[FleetOutput]:
        """Cancel the VDA order, if there is one, and track cancelOrder to its end (section 6.1.3)."""
        if self._run:
            yield from self._run.begin_cancel()
            yield from self._send_and_report(now)

    def send_instant_action(self, action: Action, now: float) -> Iterator[FleetOutput]:
        """Send an instant action, and track it to InstantActionEnded (section 6.2.1).

        It fails at once if the robot cannot receive or does not accept it.
        """
        yield from self._instant_actions.begin_requested(action, now)
        yield from self._send_and_report(now)

    def request_state(self, now: float) -> Iterator[FleetOutput]:
        """Request the robot's state (section 6.2.3) if messages may reach it.

        A robot that has never connected, as far as we know, is asked only once: perhaps it does not exist.
        """
        self.unasked = False
        if self._instant_actions.why_unsendable(STATE_REQUEST, now):
            return
        if self.robot.connection is None:
            yield PublishInstantActions(self.robot.key, (without_parameters(STATE_REQUEST, self._new_id()),))
        else:
            self._instant_actions.ask_for_state()
            yield from self._send_and_report(now)

    def tick(self, now: float) -> Iterator[FleetOutput]:
        """Handle timeouts; a quiet robot has none, unless it has become silent."""
        # Called for every robot several times per second: most of them drive, and end here.
        if self.is_quiet and self.robot.link_status(now) is self._reported_link:
            return
        yield from self._instant_actions.on_tick(now)
        if self._run:
            if self._cannot_receive(self._run, now):
                self._run.hold()
            yield from self._run.on_tick(self.robot.state, now, self.robot.unreadable)
        yield from self._send_and_report(now)

    def _cannot_receive(self, run: OrderExecution, now: float) -> bool:
        """Return whether the robot cannot be sent the rest of its VDA order now."""
        if run.phase in (VdaOrderPhase.WAITING, VdaOrderPhase.SENT):
            return self._why_unsendable(now) is not None
        # An order that runs is extended also where a new one would be refused: in a pause, for example.
        away = self.robot.stale or self._why_away(self.robot.link_status(now)) is not None
        return run.phase is VdaOrderPhase.RUNNING and away

    @property
    def vda_order(self) -> VdaOrder | None:
        """The VDA order that the robot has or is about to receive."""
        return self._run.vda_order if self._run else None

    @property
    def is_quiet(self) -> bool:
        """Whether nothing is due until the robot reports something new."""
        busy = self._advance_due or self._instant_actions.is_busy
        return not busy and (self._run is None or self._run.is_quiet)

    def view(self, now: float) -> RobotView:
        """Return the known state of the robot; cached until a possible change."""
        robot = self.robot
        link = robot.link_status(now)
        moment = (self._changes, link, robot.malformed, self._instant_actions.awaits_factsheet(now))
        if self._last_view is None or self._last_view[0] != moment:
            self._last_view = moment, self._make_view(now)
        elif self._last_view[1].state is not (robot.sighting or robot.state):  # an unchanged one
            deviations, state_at = self._deviations(robot.key), robot.state_at
            view = replace(self._last_view[1], state=robot.state, state_at=state_at, deviations=deviations)
            self._last_view = moment, view
        return self._last_view[1]

    def _make_view(self, now: float) -> RobotView:
        robot, run, link = self.robot, self._run, self.robot.link_status(now)
        away = self._why_away(link)
        if away is None and run:
            available = run.occupies_robot
        else:
            stopped = availability.why_not_driving(robot.state) if robot.state else None
            reason = away or self._why_unsendable(now) or stopped
            available = Availability(reason is None, self._explained(reason or Reason(R.IS_FREE)))
        return RobotView(
            key=robot.key,
            link=link,
            vehicle_state=availability.vehicle_state_of(robot.state, link, self._instant_actions.ids),
            availability=available,
            state=robot.sighting or robot.state,
            state_at=robot.state_at,
            factsheet=robot.factsheet,
            malformed=robot.malformed,
            order_id=run.vda_order.order_id if run else None,
            order_phase=run.phase if run else None,
            wait_reason=self._wait_reason(now, away),
            stale=robot.stale or self._instant_actions.unread,
            deviations=self._deviations(robot.key),
            substituted=robot.substituted,
        )

    def _send_and_report(self, now: float) -> Iterator[FleetOutput]:
        """Send due messages, drop ended actions and orders, and report changes of the robot."""
        self._changes += 1
        self._advance_due = False
        run = self._run
        if run and run.ended:
            self._forget_order(run)
        elif run:
            yield from self._send_due_order(run, now)
            if run.wants_cancel(self.robot.state) and self._instant_actions.can_cancel(now):
                run.cancel = self._instant_actions.begin_cancel(run.vda_order.order_id)
        self._stop_stray_order(now)
        if self._instant_actions.is_busy:
            yield from self._instant_actions.send_due(now)
        yield from self._report_change(now)

    def _send_due_order(self, run: OrderExecution, now: float) -> Iterator[FleetOutput]:
        """Send the VDA order or its update once it is due, not more often than the robot allows.

        A robot that cannot execute the order is sent nothing of it.
        """
        # timing.minimumOrderInterval (7.10) counts for updates as well: both are orders on the wire.
        if not run.is_due(now) or self._is_too_soon(now):
            return
        state, abilities = self.robot.state, self.robot.abilities
        if state is None or self._cannot_receive(run, now):
            run.hold()
            return
        run.fit(lambda vda_order: fitted_order(vda_order, abilities))
        first = run.phase is VdaOrderPhase.WAITING
        if first and abilities and (problem := order_problem(run.vda_order, abilities)):
            yield run.refuse(Reason(R.UNFIT, problem))
            self._forget_order(run)
            return
        self._last_order_at = now
        yield run.send(state.errors, now)

    def _is_too_soon(self, now: float) -> bool:
        since = self._last_order_at
        return since is not None and now - since < self.robot.least_order_interval

    def _forget_order(self, run: OrderExecution) -> None:
        self._ended.append(run.vda_order.order_id)
        self._run = None

    def _why_unsendable(self, now: float) -> Reason | None:
        """Return, as a predicate, why the robot must not be sent an order now; None if it may."""
        link = self.robot.link_status(now)
        sent = self._run is not None and self._run.phase is VdaOrderPhase.SENT
        if link in REPORTS_NOTHING and self.robot.is_reachable and sent:
            link = LinkStatus.ONLINE  # attempts count, so an order to a dead robot fails eventually
        reason = self._why_away(link)
        state = self.robot.state
        if reason or state is None:
            return reason or self.robot.unreadable or Reason(R.STATELESS)
        if self.robot.stale:  # it may have been restarted, and have lost or kept an order since
            return Reason(R.UNSEEN_SINCE_CONNECTION)
        if self._instant_actions.is_cancelling:
            return Reason(R.CANCEL_UNCONFIRMED)
        if self._instant_actions.is_leaving:
            return Reason(R.IS_LEAVING)
        if self._instant_actions.awaits_factsheet(now):
            return Reason(R.NO_FACTSHEET)
        occupied = availability.why_occupied(state, self._instant_actions.ids, self.robot.substituted)
        return occupied or availability.why_unfit(state, placed=self.robot.placed)

    def _why_away(self, link: LinkStatus) -> Reason | None:
        """Return, as a predicate, why the robot cannot be reached by this link; None if it can."""
        ours = self._instant_actions
        problem = self.robot.unreadable or (self.robot.other_topic if link is LinkStatus.UNKNOWN else None)
        return availability.why_away(link, problem, broker=ours.broker, unread=ours.unread)

    def _wait_reason(self, now: float, away: Reason | None) -> Reason | None:
        run = self._run
        if run is None:
            return None
        if self.robot.least_order_interval > TOLD_FROM and run.is_due(now) and self._is_too_soon(now):
            return Reason(R.ROBOT, Reason(R.ORDER_INTERVAL, limit=self.robot.least_order_interval))
        if run.phase in (VdaOrderPhase.WAITING, VdaOrderPhase.SENT):
            reason = self._why_unsendable(now)
            unseen = self.robot.unreadable or (Reason(R.ORDER_UNCONFIRMED) if run.is_resent else None)
            reason = reason or unseen
            return Reason(R.ROBOT, self._explained(reason)) if reason else None
        state = self.robot.state
        if run.phase is VdaOrderPhase.CANCELLING:
            stopped = availability.why_not_driving(state) if state else None
            return Reason(R.ROBOT, self._explained(away or stopped or Reason(R.END_UNCONFIRMED)))
        reason = away
        if state and not reason:
            reason = (
                availability.why_not_driving(state)
                or run.why_unfinished_at_end(state)
                or availability.why_unread_action(state, self.robot.substituted)
            )
        return Reason(R.ROBOT, self._explained(reason)) if reason else run.refused_update

    def _explained(self, reason: Reason) -> Reason:
        return availability.with_received(reason, self.robot.substituted)

    def _stop_stray_order(self, now: float) -> None:
        """Cancel an order that the robot executes although it has already ended here."""
        state = self.robot.sighting or self.robot.state
        if state is None or state.order_id not in self._ended or now < self._next_stray_cancel:
            return
        actions = self._instant_actions
        if actions.is_cancelling or is_idle(state, actions.ids) or not actions.can_cancel(now):
            return
        self._next_stray_cancel = now + STRAY_PAUSE
        actions.begin_cancel(state.order_id)

    def _report_change(self, now: float) -> Iterator[FleetOutput]:
        view = self.view(now)
        self._reported_link = view.link
        signature = self._reported_fields(view)
        if signature != self._reported:
            self._reported = signature
            yield RobotChanged(self.robot.key)

    def _reported_fields(self, view: RobotView) -> tuple[object, ...]:
        """Return the fields whose changes are reported: not position, speeds or fractions of the charge."""
        state, abilities = view.state, self.robot.abilities
        vda_order = view.order_id, view.order_phase, view.wait_reason
        transforms = abilities and abilities.transforms_itself
        common = (view.link, view.availability, vda_order, transforms)
        if state is None:
            return common
        power, position = state.power_supply, state.mobile_robot_position
        return (
            *common,
            position and (position.map_id, position.localized),
            state.operating_mode,
            state.last_node_id,
            state.errors,
            int(power.state_of_charge),
            power.charging,
            is_idle(state, self._instant_actions.ids),
            availability.why_not_driving(state),
            equipment_of(state),
        )


RETAINED_WITHIN: Final = 1.0
"""Seconds after connecting within which the broker delivers the robots' retained connection messages."""


class FleetController:
    """Sends VDA orders to robots and tracks their execution by the robots' states.

    Each VDA order that is started or adopted ends with exactly one of VdaOrderFinished, VdaOrderFailed and
    VdaOrderCancelled. ``now`` is in monotonic seconds everywhere.
    """

    def __init__(
        self,
        settings: FleetSettings,
        *,
        expected: Iterable[RobotKey] = (),
        new_id: Callable[[], str] = unique_id,
        utc_now: Callable[[], datetime] = lambda: datetime.now(UTC),
        deviations: Callable[[RobotKey], tuple[Repair, ...]] = _no_deviations,
    ) -> None:
        """``expected`` robots are asked for their states at each connect, even if they have never connected.

        ``deviations`` returns the repairs of a robot's messages.
        """
        self._settings = settings
        self._new_id = new_id
        self._deviations = deviations
        self._broker = False
        self._broker_since = 0.0
        self._robots = {robot: self._new_control(robot) for robot in expected}
        self._to_ask: dict[RobotKey, None] = {}
        """Robots to ask for their states, in this order; those that have reported since are left out."""
        self._releases = ReleaseManager(settings, utc_now)

    def on_connection(self, robot: RobotKey, message: Connection, now: float) -> Outputs:
        """Handle a connection message (section 6.5)."""
        control = self.control(robot)
        outputs = tuple(control.on_connection(message, now))
        if control.unasked:
            self._to_ask[robot] = None
        return outputs

    def on_state(self, robot: RobotKey, message: State, now: float) -> Outputs:
        """Handle a state message (section 6.6); repeated and outdated ones are ignored."""
        control = self.control(robot)
        outputs = tuple(control.on_state(message, now))
        if message.zone_requests or message.edge_requests or self._releases.has_requests:
            self._releases.on_state(robot, control.robot.state or message)
            outputs += self._take_due_answers(now)
        return outputs

    def on_factsheet(self, robot: RobotKey, message: Factsheet, now: float) -> Outputs:
        """Handle a factsheet (section 7.10)."""
        return tuple(self.control(robot).on_factsheet(message, now))

    def on_broker(self, *, connected: bool, now: float, unread: bool = False) -> Outputs:
        """Note a change of our own link to the broker, which is down initially.

        The views of all robots show it at once. What follows for a robot is done by :meth:`tick`, or with the
        robot's next message. All robots are asked for their states, those with a VDA order first: what they
        reported meanwhile is lost. With ``unread`` a robot is sent nothing but stateRequest and startPause
        before its next state.
        """
        self._broker = connected
        self._broker_since = now
        for control in self._robots.values():
            control.on_broker(connected=connected, unread=unread)
        self._to_ask = dict.fromkeys(sorted(self._robots, key=lambda robot: self.vda_order(robot) is None))
        return (BrokerLinkChanged(),)

    def tick(self, now: float) -> Iterator[Outputs]:
        """Resend messages, and handle timeouts and silent robots, one after the other.

        Call this several times per second.
        """
        for control in tuple(self._robots.values()):
            yield tuple(control.tick(now))
        # Robots of which nothing is known are asked last: their retained connection messages are on the way.
        known_only = self.connected_for(now) < RETAINED_WITHIN
        for robot in tuple(self._to_ask if self._broker else ()):
            control = self._robots[robot]
            if control.unasked and known_only and control.robot.connection is None:
                continue
            del self._to_ask[robot]
            if control.unasked:
                yield tuple(control.request_state(now))
        if self._releases.has_requests:
            yield self._take_due_answers(now)

    def control(self, robot: RobotKey) -> RobotControl:
        """Return the control of a robot, which is registered if it is new."""
        control = self._robots.get(robot)
        if control is None:
            control = self._robots[robot] = self._new_control(robot)
        return control

    def view(self, robot: RobotKey, now: float) -> RobotView:
        """Return the known state of a robot; LinkStatus.UNKNOWN if it never reported."""
        control = self._robots.get(robot)
        return (control or self._new_control(robot)).view(now)

    def vda_order(self, robot: RobotKey) -> VdaOrder | None:
        """Return the VDA order that a robot has or is about to receive; None if there is none."""
        control = self._robots.get(robot)
        return control.vda_order if control else None

    def connected_for(self, now: float) -> float:
        """Return how long the link to the broker has been up, seconds; 0 while it is down."""
        return now - self._broker_since if self._broker else 0.0

    def all_known(self, now: float) -> bool:
        """Return whether every robot that is connected, according to the broker, has reported its state."""
        if self.connected_for(now) < RETAINED_WITHIN:  # retained connection messages may still arrive
            return False
        robots = (control.robot for control in self._robots.values())
        return all(robot.state or robot.sighting or not robot.is_reachable for robot in robots)

    def knows(self, robot: RobotKey) -> bool:
        """Return whether this robot is expected, or has sent a message."""
        return robot in self._robots

    def has_room_for(self, robot: RobotKey) -> bool:
        """Return whether this robot is known, or another one may be added (``robots_limit``)."""
        return robot in self._robots or len(self._robots) < self._settings.robots_limit

    def _take_due_answers(self, now: float) -> Outputs:
        """Return the due answers to the robots' requests (section 6.9); none while the link is down."""
        if not self._broker:
            return ()
        return tuple(
            self._releases.take_due_answers(
                now,
                all_known=self.all_known(now),
                reachable=lambda robot: self._robots[robot].robot.is_reachable,
            )
        )

    def _new_control(self, robot: RobotKey) -> RobotControl:
        return RobotControl(
            robot, self._settings, self._new_id, broker=self._broker, deviations=self._deviations
        )
