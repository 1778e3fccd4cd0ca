"""The execution of one VDA 5050 order by its robot: sent, resent, echoed, driven, cancelled, ended."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from nena_order_service.fleet import failures
from nena_order_service.fleet.failures import ErrorIdentity, FailureKind
from nena_order_service.fleet.instant_actions import RETRY, InstantRun
from nena_order_service.fleet.outputs import (
    ActionRetriable,
    BaseWanted,
    Delivery,
    FleetOutput,
    InstantActionEnded,
    NodePassed,
    OperationStarted,
    PublishOrder,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.robot import Availability, VdaOrderPhase
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder, held_by, released_to, update_of, with_kept_base
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import property_keys as keys
from nena_shared.vda5050.action import ActionState, ActionStatus
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.topics import RobotKey

R = ReasonCode


@dataclass(slots=True)
class PendingUpdate:
    """An order update that no state has echoed yet; ``plan`` is the whole VDA order after it."""

    plan: VdaOrder
    message: VdaOrder
    """The message: the part of the plan from the decision point, the last node of the base."""
    update_id: int
    delivery: Delivery
    errors_before: frozenset[ErrorIdentity] = frozenset()

    def refusals(self, errors: Iterable[ErrorEntry]) -> tuple[ErrorEntry, ...]:
        """Return the errors with which the robot refuses the update (section 6.1.4)."""
        return tuple(
            error
            for error in errors
            if failures.identity_of(error) not in self.errors_before
            and not failures.is_of_another_action(error, self.plan)
            and failures.refuses_update(error, self.plan.order_id, self.update_id)
        )

    def is_refused(self, refusals: Iterable[ErrorEntry], now: float) -> bool:
        """Return whether any of the refusals counts; see :meth:`Delivery.is_refused`."""
        named = any(
            failures.is_named(error, self.plan) or failures.values_named_by(error, "orderUpdateId")
            for error in refusals
        )
        return self.delivery.is_refused(now, named=named)


STATES_NAMED: Final = 3
"""Maximum number of nodes named in a reason."""

NOT_BEGUN: Final = frozenset({ActionStatus.WAITING, ActionStatus.FAILED})
"""States of actions that may never have begun: waiting ones fail when their order is cancelled."""


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a VDA order, read from a state that echoes it."""

    passed: int
    """The sequenceId of the last node that has been traversed; -1: none."""
    operating: bool
    """Whether an action at the last node has begun."""
    idle: bool
    """Whether the robot has nothing left to do."""
    at_end: bool
    """Whether the robot has reached the last node."""
    failed: tuple[ActionState, ...]
    """The actions that have failed."""
    retriable: tuple[ActionState, ...]
    """The actions that have failed and may be retried."""
    unreported: frozenset[str]
    """IDs of actions that are missing from the state."""

    @property
    def is_done(self) -> bool:
        """Whether everything has been done successfully."""
        return self.idle and self.at_end and not self.failed and not self.unreported


def read_progress(state: State, vda_order: VdaOrder) -> Progress:
    """Read the progress from a state that echoes the VDA order (section 6.6.2)."""
    ids, final = vda_order.action_ids, vda_order.final_action_ids
    # 6.6.2: an edge's action ends with the edge, and robots report such an end as FAILED as well. Those of
    # edges that the robot has left are no failures.
    left_behind: set[str] = set()
    if vda_order.edges_with_actions:
        ahead = {edge.sequence_id for edge in state.edge_states}
        left_behind = {
            action.action_id
            for edge in vda_order.edges_with_actions
            if edge.sequence_id not in ahead
            for action in edge.actions
        }
    own = [action for action in state.action_states if action.action_id in ids] if ids else []
    left = bool(state.node_states or state.edge_states)
    # Some robots reset lastNodeSequenceId late when they accept an order: what nodeStates lists is ahead.
    passed = state.last_node_sequence_id
    if state.node_states:
        passed = min(passed, state.node_states[0].sequence_id - 1)
    return Progress(
        passed=passed,
        operating=any(action.action_id in final and action.action_status not in NOT_BEGUN for action in own),
        idle=not left and all(action.action_status.ended for action in own),
        at_end=passed == vda_order.last_sequence_id and state.last_node_id == vda_order.nodes[-1].node_id,
        failed=tuple(
            action
            for action in own
            if action.action_status is ActionStatus.FAILED and action.action_id not in left_behind
        ),
        retriable=tuple(action for action in own if action.action_status is ActionStatus.RETRIABLE),
        unreported=ids.difference(action.action_id for action in own) if len(own) < len(ids) else frozenset(),
    )


class OrderExecution:
    """Tracks one VDA order; once ``ended`` is true, its end has been reported and no more events follow.

    An ``adopted`` order may have been sent before; ``accepted`` is whether the robot is known to have it.
    ``vda_order`` is what the robot has according to its states, or is to receive first, with all updates up
    to ``update_id``. One update is active at a time; meanwhile only the newest plan is kept. The owner
    creates and sends ``cancel`` once :meth:`wants_cancel` returns True.
    """

    def __init__(
        self,
        robot: RobotKey,
        vda_order: VdaOrder,
        settings: FleetSettings,
        *,
        adopted: bool = False,
        accepted: bool = False,
        update_id: int = 0,
    ) -> None:
        self.vda_order = vda_order
        self.update_id = update_id
        self.occupies_robot = Availability(
            can_take_order=False, reason=Reason(R.WORKS_ON_VDA_ORDER, order=vda_order.order_id)
        )
        """The availability of its robot."""
        self._pending: PendingUpdate | None = None
        self._plan: VdaOrder | None = None
        self._base_wanted = False
        self.phase = VdaOrderPhase.WAITING
        self.cancel: InstantRun | None = None
        self.ended = False
        self._robot = robot
        self._settings = settings
        self._delivery = Delivery(settings)
        self._adopted = adopted
        self.outdated_fit = False
        """Whether the robot has sent a factsheet since the order was fitted."""
        self._accepted = accepted
        self._reported = -2
        """SequenceId of the last node that was reported as passed; -1: none; -2: not accepted yet."""
        self._operating = False
        self._failure: VdaOrderFailed | None = None
        self._errors_before: frozenset[ErrorIdentity] = frozenset()
        self._position_doubted = False
        """Whether the robot was not localised or reconnected since the order was last sent."""
        self._excused_sending = 0
        """Number of the sending whose refusals are excused, because the robot was not localised; 0: none."""
        self._excused: frozenset[ErrorIdentity] = frozenset()
        """Excused refusals: the order is resent once the robot is localised."""
        self._standing_since: float | None = None
        self._retriable: frozenset[object] = frozenset()
        """IDs of the actions that were reported as retriable."""
        self.refused_update: Reason | None = None
        """Why the robot does not take the update that is pending; it executes its order meanwhile."""
        self._manual_mode: OperatingMode | None = None
        """The mode to which somebody has switched the robot, in which it takes no orders."""

    def is_due(self, now: float) -> bool:
        """Return whether the order, or an update of it, is due to be sent or resent."""
        if self.phase in (VdaOrderPhase.WAITING, VdaOrderPhase.SENT):
            return self._delivery.is_due(now)
        if self.phase is not VdaOrderPhase.RUNNING or self.ended:
            return False
        return self._pending.delivery.is_due(now) if self._pending else self._plan is not None

    def extend(self, plan: VdaOrder) -> None:
        """Change the order to ``plan`` (section 6.1.2).

        Raises:
            BaseChangedError: the base of ``plan`` does not continue the current base.
        """
        self._follow_plan(with_kept_base(self._newest_plan, plan))

    def release(self, sequence_id: int | None) -> None:
        """Extend the base of the order to the node ``sequence_id``; None: to its end."""
        plan = self._newest_plan
        self._follow_plan(released_to(plan, plan.last_sequence_id if sequence_id is None else sequence_id))

    @property
    def _newest_plan(self) -> VdaOrder:
        return self._plan or (self._pending.plan if self._pending else self.vda_order)

    def _follow_plan(self, plan: VdaOrder) -> None:
        if self.phase is VdaOrderPhase.WAITING and not self._adopted:
            self.vda_order = plan  # nothing was sent yet
        else:
            self._plan = plan

    def fit(self, fit: Callable[[VdaOrder], VdaOrder]) -> None:
        """Fit the VDA order to the factsheet before it is sent; it is resent unchanged."""
        # An adopted one is fitted again before each update: its plan comes from the store, as it was built.
        if self.phase is VdaOrderPhase.WAITING or (self._adopted and self.phase is VdaOrderPhase.RUNNING):
            self.vda_order = fit(self.vda_order)
            self._plan = self._plan and fit(self._plan)
        elif self.outdated_fit and self._plan:
            self._plan = with_kept_base(self.vda_order, fit(self._plan))

    @property
    def is_quiet(self) -> bool:
        """Whether nothing is due until the robot reports something new, because it executes its order."""
        waits = self._pending or self._plan or self._standing_since is not None
        return self.phase is VdaOrderPhase.RUNNING and not waits

    @property
    def is_resent(self) -> bool:
        """Whether the order was resent, because the robot has not confirmed it in time."""
        return self.phase is VdaOrderPhase.SENT and self._delivery.sendings > 1

    def send(self, errors: Iterable[ErrorEntry], now: float) -> PublishOrder:
        """Send the order (section 6.1.1) or its update; the robot reports these errors already."""
        identities = frozenset(map(failures.identity_of, errors))
        if self.phase is VdaOrderPhase.RUNNING:
            # 6.1.2: one update at a time, from the base that the robot has echoed.
            if self._pending is None and self._plan is not None:
                plan, self._plan = self._plan, None
                message, update_id = update_of(self.vda_order, plan), self.update_id + 1
                self._pending = PendingUpdate(plan, message, update_id, Delivery(self._settings), identities)
            assert self._pending, "sent when is_due says so"  # noqa: S101 - for the type
            self._pending.delivery.note_sent(now)
            return PublishOrder(self._robot, self._pending.message, self._pending.update_id)
        if self.phase is VdaOrderPhase.WAITING:
            self.phase = VdaOrderPhase.SENT
            self._errors_before = identities
        self._position_doubted = False
        self._delivery.note_sent(now)
        return PublishOrder(self._robot, self.vda_order)

    def doubt_position(self) -> None:
        """Excuse the next refusal, because the robot may not have been localised."""
        self._position_doubted = True

    def refuse(self, reason: Reason) -> FleetOutput:
        """Fail the order before anything is sent."""
        return self._end_order(self._failure_of(FailureKind.UNFIT, reason))

    def hold(self) -> None:
        """Suspend the delivery's timeout, because the robot cannot be sent anything now."""
        self._delivery.restart()
        if self._pending:
            self._pending.delivery.restart()

    def hasten(self) -> None:
        """Resend soon what no state has echoed: the robot has connected since, perhaps without it."""
        self._delivery.hasten()
        if self._pending:
            self._pending.delivery.hasten()

    def begin_cancel(self) -> Iterator[FleetOutput]:
        """Begin to cancel the VDA order (section 6.1.3); end it at once if it was never sent."""
        if self.phase is VdaOrderPhase.WAITING and not self._adopted:
            yield from self._end_early()
        else:
            self.phase = VdaOrderPhase.CANCELLING

    def wants_cancel(self, state: State | None) -> bool:
        """Return whether cancelOrder must be sent (section 6.1.3)."""
        waiting = self.phase is VdaOrderPhase.CANCELLING and self.cancel is None
        return waiting and state is not None and self._may_be_at_robot(state)

    def on_event(self, event: FleetOutput) -> None:
        """Handle the end of a ``retry``: if it is RETRIABLE again, it has failed again (section 6.2.3)."""
        if isinstance(event, InstantActionEnded) and event.action.action_type == RETRY:
            self._retriable -= {event.action.parameter("actionId")}

    def on_state(self, state: State, now: float) -> Iterator[FleetOutput]:
        """Update the execution from a new state of the robot (section 6.6)."""
        self._take_echo(state)
        if not state.operating_mode.takes_orders:
            self._manual_mode = state.operating_mode
        elif self._is_known_in(state):
            self._manual_mode = None
        if self._is_known_in(state):
            yield from self._follow_progress(state, now)
        elif self._accepted and self.phase is not VdaOrderPhase.CANCELLING:
            known, kind = self.update_id, FailureKind.LOST
            reason = Reason(R.LOST_TO_OTHER, order=state.order_id) if state.order_id else Reason(R.LOST)
            if state.order_id == self.vda_order.order_id and state.order_update_id > known:
                # Somebody else has extended it: what the robot still drives is not known here.
                reason = Reason(R.UNKNOWN_UPDATE, update=state.order_update_id, known=known)
                kind = FailureKind.UNCLEAR
            yield self._end_order(self._failure_of(kind, reason))
        elif self.phase is VdaOrderPhase.SENT:
            yield from self._look_for_refusal(state, now)
        if self.phase is VdaOrderPhase.CANCELLING and not self.ended:
            yield from self._settle_cancellation(state)

    def on_tick(
        self, state: State | None, now: float, unreadable: Reason | None = None
    ) -> Iterator[FleetOutput]:
        """Handle timeouts; ``unreadable``: why the robot's states cannot be used."""
        if self.phase is VdaOrderPhase.SENT and self._delivery.has_failed(now):
            times = self._settings.sendings
            reason = Reason(R.NEVER_ACCEPTED, count=times)
            if state and state.order_id:
                reason = Reason(R.DETAILS, reason, Reason(R.REPORTS_ORDER, order=state.order_id))
            failure = self._failure_of(FailureKind.NOT_TAKEN, reason)
            if unreadable:
                reason = Reason(R.ACCEPTANCE_UNREADABLE, unreadable, count=times)
                failure = self._failure_of(FailureKind.UNCLEAR, reason)
            yield self._end_order(failure)
        elif self._pending and self.phase is VdaOrderPhase.RUNNING and self._pending.delivery.has_failed(now):
            times = self._settings.sendings
            reason = self.refused_update or Reason(R.UPDATE_NEVER_ACCEPTED, count=times)
            # A refused update leaves the order as it is (6.1.4): the robot drives to the end of its base.
            if (
                not self.refused_update
                or state is None
                or not any(node.released for node in state.node_states)
            ):
                self._cancel_for(self._failure_of(FailureKind.DRIVE, reason))
        elif state is None:
            return
        elif self.phase is VdaOrderPhase.RUNNING:
            self._look_for_standstill(state, now)
        elif self.phase is VdaOrderPhase.CANCELLING:
            yield from self._settle_cancellation(state)

    def on_undeliverable(self, topic: str) -> Iterator[FleetOutput]:
        """Fail the order, or cancel it if an update of it cannot be sent: the broker refuses the message."""
        reason = Reason(R.UNDELIVERABLE, topic=topic)
        if self.phase is VdaOrderPhase.SENT:
            yield self._end_order(self._failure_of(FailureKind.NOT_TAKEN, reason))
        elif self._pending and self.phase is VdaOrderPhase.RUNNING:
            self._cancel_for(self._failure_of(FailureKind.DRIVE, reason))

    def why_unfinished_at_end(self, state: State) -> Reason | None:
        """Return, as a predicate, why the order of a robot at its last node is not finished, or None."""
        # 6.6.8: both lists are empty at the end. Some robots keep the last node, see the property named
        # below.
        last = self.vda_order.nodes[-1]
        at_end = (state.last_node_id, state.last_node_sequence_id) == (last.node_id, last.sequence_id)
        if not at_end or state.driving or not self._is_known_in(state):
            return None
        names = [node.node_id for node in state.node_states] or [edge.edge_id for edge in state.edge_states]
        field = "nodeStates" if state.node_states else "edgeStates"
        listed = ", ".join(f"'{name}'" for name in names[:STATES_NAMED])
        if not names:
            return None
        return Reason(
            R.KEEPS_STATES,
            node=last.node_id,
            names=listed,
            field=field,
            key=keys.VDA5050_KEEPS_LAST_NODE_STATES,
        )

    def _take_echo(self, state: State) -> None:
        """Handle the echo of the pending update or, after a restart, of an older one (section 6.1.2)."""
        # The restart may have been between the commit of an update and its sending: then the robot has less
        # than the store says, and the rest is sent as an update again.
        if state.order_id != self.vda_order.order_id:
            return
        pending = self._pending
        if pending and state.order_update_id == pending.update_id:
            self.vda_order, self.update_id, self._pending = pending.plan, pending.update_id, None
            self.refused_update = None
        elif self._adopted and self._reported < -1 and state.order_update_id < self.update_id:
            self._plan = self._plan or self.vda_order
            self.vda_order, self.update_id = held_by(state, self.vda_order), state.order_update_id

    def _is_known_in(self, state: State) -> bool:
        """Return whether the robot has this VDA order, with exactly this update (section 6.1.2)."""
        return state.order_id == self.vda_order.order_id and state.order_update_id == self.update_id

    def _follow_progress(self, state: State, now: float) -> Iterator[FleetOutput]:
        """Yield events for the progress of the VDA order in a state that echoes it."""
        name, progress = self.vda_order.order_id, read_progress(state, self.vda_order)
        self._retriable &= {action.action_id for action in progress.retriable}
        if self._reported < -1:
            self._accepted, self._reported = True, -1
            if self.phase is not VdaOrderPhase.CANCELLING:
                self.phase = VdaOrderPhase.RUNNING
            yield VdaOrderAccepted(self._robot, name)
        if progress.passed > self._reported:
            for node in self.vda_order.nodes:
                if self._reported < node.sequence_id <= progress.passed:
                    yield NodePassed(self._robot, name, node.node_id, node.sequence_id)
            self._reported = progress.passed
        if progress.operating and not self._operating:
            self._operating = True
            yield OperationStarted(self._robot, name)
        # 6.6.3: newBaseRequest stays true until the robot has more base. It is reported once, and only if
        # there is a horizon to release.
        wanted = bool(state.new_base_request) and not self.vda_order.nodes[-1].released
        if wanted and not self._base_wanted:
            yield BaseWanted(self._robot, name)
        self._base_wanted = wanted
        if progress.is_done:
            yield self._end_order(VdaOrderFinished(self._robot, name))
        elif self.phase is VdaOrderPhase.RUNNING:
            yield from self._detect_failure(state, progress, now)

    def _detect_failure(self, state: State, progress: Progress, now: float) -> Iterator[FleetOutput]:
        """Detect failures of a running VDA order."""
        self._look_for_refused_update(state, now)
        failure = self._failed_actions(state, progress.failed)
        if progress.idle and failure:
            yield self._end_order(failure)
        elif progress.idle and not (progress.at_end and progress.unreported):
            # 6.6.8: without nodes, edges and running actions a robot has no order any more.
            reason, end = Reason(R.ABANDONED), self.vda_order.nodes[-1]
            if not progress.at_end:
                at = Reason(
                    R.REPORTS_LAST_NODE,
                    node=state.last_node_id,
                    number=state.last_node_sequence_id,
                    end=end.node_id,
                    last=end.sequence_id,
                )
                reason = Reason(R.DETAILS, reason, at)
            yield self._end_order(self._failure_of(FailureKind.DRIVE, reason, _describe(state.errors)))
        elif failure:
            self._cancel_for(failure)
        elif progress.retriable:
            yield from self._report_retriable(state, progress.retriable)
        elif errors := failures.stopping_errors(state.errors, self.vda_order, self._errors_before):
            of_action = any(failures.values_named_by(error, "actionId") for error in errors)
            kind = FailureKind.ACTION if of_action else FailureKind.DRIVE
            self._cancel_for(self._failure_of(kind, Reason(R.ROBOT_FAILED), _describe(errors)))
        else:
            self._look_for_standstill(state, now)

    def _look_for_refused_update(self, state: State, now: float) -> None:
        """Note why the robot refuses the pending update; it is sent again, or a newer plan instead of it."""
        refused = self._pending.refusals(state.errors) if self._pending else ()
        if not self._pending or not refused or not self._pending.is_refused(refused, now):
            return
        self.refused_update = failures.with_details(Reason(R.REFUSES_UPDATE), _describe(refused))
        if self._plan:
            plan, self._plan = self._plan, None
            message, update_id = update_of(self.vda_order, plan), self._pending.update_id + 1
            # the number of attempts counts on, so that they end
            self._pending = PendingUpdate(plan, message, update_id, self._pending.delivery)

    def _report_retriable(self, state: State, actions: tuple[ActionState, ...]) -> Iterator[FleetOutput]:
        """Report each failure of a retriable action once (section 6.6.9)."""
        reported, self._retriable = self._retriable, frozenset(action.action_id for action in actions)
        for action in actions:
            failure = self._failed_actions(state, (action,))
            if failure and action.action_id not in reported:
                name = self.vda_order.order_id
                yield ActionRetriable(self._robot, name, action.action_id, failure.reason, failure.details)

    def _failed_actions(self, state: State, failed: tuple[ActionState, ...]) -> VdaOrderFailed | None:
        if not failed:
            return None
        first = failed[0]
        own = (action.action_result for action in failed)
        reported = (
            failures.describe_error(error)
            for action in failed
            for error in state.errors
            if action.action_id in failures.values_named_by(error, "actionId")
        )
        name = next(
            action.action_type for action in self.vda_order.actions if action.action_id == first.action_id
        )
        # 6.6.7: actions of an order that is cleared early become FAILED without having begun.
        at_end = read_progress(state, self.vda_order).at_end
        kind = FailureKind.ACTION if at_end else FailureKind.DRIVE
        return self._failure_of(kind, Reason(R.ACTION_FAILED, action=name), (*filter(None, own), *reported))

    def _look_for_standstill(self, state: State, now: float) -> None:
        """Cancel the VDA order of a robot that has stood still for too long and cannot finish it."""
        failure = self._standstill_failure(state)
        if failure is None:
            self._standing_since = None
        elif self._standing_since is None:
            self._standing_since = now
        elif now - self._standing_since >= self._settings.standstill_patience:
            self._cancel_for(failure)

    def _standstill_failure(self, state: State) -> VdaOrderFailed | None:
        if state.driving or not self._is_known_in(state):
            return None
        if failures.unexplained_stops(state.errors, self.vda_order, self._errors_before):
            reason = Reason(R.STOPPED_WITH_ERROR)
            return self._failure_of(FailureKind.DRIVE, reason, _describe(state.errors))
        if self.vda_order.actions and not state.node_states:
            unreported = read_progress(state, self.vda_order).unreported
            reason = Reason(R.ACTIONS_UNREPORTED)
            return (
                self._failure_of(FailureKind.UNCLEAR, reason, _describe(state.errors)) if unreported else None
            )
        return None

    def _cancel_for(self, failure: VdaOrderFailed) -> None:
        self._failure = failure
        self.phase = VdaOrderPhase.CANCELLING

    def _look_for_refusal(self, state: State, now: float) -> Iterator[FleetOutput]:
        # A robot that is not localised refuses every order. Once it is, the order is sent again instead of
        # failing; a second refusal of the same sending counts.
        self._excused &= frozenset(map(failures.identity_of, state.errors))
        refusals = failures.refusals(state.errors, self.vda_order, self._errors_before)
        errors = [error for error in refusals if failures.identity_of(error) not in self._excused]
        if errors and self._position_doubted and self._excused_sending in (0, self._delivery.in_all):
            self._excused_sending = self._delivery.in_all
            self._excused |= frozenset(map(failures.identity_of, errors))
            self.hold()
            return
        named = any(failures.is_named(error, self.vda_order) for error in errors)
        if errors and self._delivery.is_refused(now, named=named):
            yield self._end_order(self._failure_of(FailureKind.REFUSED, Reason(R.REFUSED), _describe(errors)))

    def _settle_cancellation(self, state: State) -> Iterator[FleetOutput]:
        """End the VDA order once the robot has confirmed cancelOrder, or does not have the order."""
        active = self._is_active_at_robot(state)
        if self.cancel is None:
            if not self._may_be_at_robot(state):
                yield from self._end_early()
            return
        outcome = self.cancel.outcome
        if outcome is None:
            return
        # Without an answer, the order or a resent copy of it may still reach the robot, though no state shows
        # it.
        may_arrive = outcome.status is None and (not self._accepted or self._delivery.in_all > 1)
        if outcome.status is ActionStatus.FINISHED or not (active or may_arrive):
            yield from self._end_early()
        else:
            why = self._failure.reason if self._failure else Reason(R.CANCELLED)
            reason = Reason(R.CANCEL_REFUSED, why, outcome.reason)
            yield self._end_order(self._failure_of(FailureKind.UNCLEAR, reason, _describe(state.errors)))

    def _may_be_at_robot(self, state: State) -> bool:
        sent_unseen = (self._delivery.in_all or self._adopted) and not self._accepted
        return sent_unseen or self._is_active_at_robot(state)

    def _is_active_at_robot(self, state: State) -> bool:
        return self._is_known_in(state) and not read_progress(state, self.vda_order).idle

    def _end_early(self) -> Iterator[FleetOutput]:
        if self._failure:
            yield self._end_order(self._failure)
        else:
            yield self._end_order(VdaOrderCancelled(self._robot, self.vda_order.order_id))

    def _failure_of(self, kind: FailureKind, reason: Reason, details: tuple[str, ...] = ()) -> VdaOrderFailed:
        # What else fails then, such as actions, is a consequence (6.6.7).
        if self._manual_mode and self._accepted and kind is not FailureKind.UNCLEAR:
            reason = Reason(R.ABANDONED_IN_MODE, mode=self._manual_mode)
        return VdaOrderFailed(self._robot, self.vda_order.order_id, reason, details, kind)

    def _end_order(self, output: FleetOutput) -> FleetOutput:
        self.ended = True
        return output


def _describe(errors: Iterable[ErrorEntry]) -> tuple[str, ...]:
    return tuple(map(failures.describe_error, errors))
