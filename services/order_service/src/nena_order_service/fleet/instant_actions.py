"""Send instant actions and track them to their end (VDA 5050 3.0, sections 6.2.1 and 6.6.9)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from nena_order_service.fleet import availability
from nena_order_service.fleet.feasibility import fitted_action, instant_action_problem
from nena_order_service.fleet.outputs import Delivery, FleetOutput, InstantActionEnded, PublishInstantActions
from nena_order_service.fleet.robot import (
    INSTANT_ACTIONS_LIMIT,
    NOT_REACHED,
    REPORTS_NOTHING,
    LinkStatus,
    Robot,
)
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.vda5050.action import (
    SHUTDOWN,
    START_HIBERNATION,
    STOP_HIBERNATION,
    Action,
    ActionParameter,
    ActionState,
    ActionStatus,
    BlockingType,
)
from nena_shared.vda5050.state import OperatingMode, State

R = ReasonCode

RETRY: Final = "retry"
CANCEL_ORDER: Final = "cancelOrder"
CLEAR_INSTANT_ACTIONS: Final = "clearInstantActions"
FACTSHEET_REQUEST: Final = "factsheetRequest"
STATE_REQUEST: Final = "stateRequest"
START_PAUSE: Final = "startPause"
LEAVES: Final = frozenset({START_HIBERNATION, SHUTDOWN})
"""Action types after which a robot takes no orders."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The end of an instant action; ``status`` is None if the robot never reported it."""

    status: ActionStatus | None
    reason: Reason
    result: str | None = None


class InstantRun:
    """Tracks one instant action (section 6.2.1); ``outcome`` is set once, when it has ended.

    ``requested`` is whether a caller outside fleet control waits for its end.
    """

    def __init__(self, action: Action, settings: FleetSettings, *, requested: bool) -> None:
        self.action = action
        self.requested = requested
        self.outcome: Outcome | None = None
        self._settings = settings
        self._delivery = Delivery(settings)
        self._first_sent_at: float | None = None
        self._seen_at: float | None = None

    @property
    def awaits_state(self) -> bool:
        """Whether the action is a stateRequest that ends with the robot's next state."""
        return self.action.action_type == STATE_REQUEST and not self.requested

    @property
    def is_cancel(self) -> bool:
        """Whether the action is a cancelOrder."""
        return self.action.action_type == CANCEL_ORDER

    def on_states(self, states: Mapping[str, ActionState], now: float) -> None:
        """Update the action from all action states that the robot reports, by actionId."""
        state = states.get(self.action.action_id)
        if state is None:
            if self._seen_at is not None:
                self.outcome = Outcome(None, Reason(R.ACTION_FORGOTTEN))
            return
        if self._seen_at is None:
            self._seen_at = now
        if state.action_status.ended:
            finished = state.action_status is ActionStatus.FINISHED
            reason = Reason(R.ACTION_DONE if finished else R.ACTION_NOT_DONE)
            self.outcome = Outcome(state.action_status, reason, state.action_result)

    def on_link(self, link: LinkStatus) -> None:
        """End a hibernation or shutdown when the connection shows it, because the last state may be lost."""
        # The last state and the connection message are published on different topics, and the robot leaves
        # right after: whichever arrives decides.
        hibernates = self.action.action_type == START_HIBERNATION and link is LinkStatus.HIBERNATING
        shut_down = self.action.action_type == SHUTDOWN and link is LinkStatus.OFFLINE
        # A robot goes OFFLINE for other reasons as well: a shutdown counts only if a state has shown it.
        if hibernates or (shut_down and self._seen_at is not None):
            self.outcome = Outcome(ActionStatus.FINISHED, Reason(R.ACTION_SHOWN_BY_LINK, link=link))

    def begin_sending(self, now: float) -> bool:
        """Count the action as sent if it is due; return whether it was, and has to be sent."""
        if self._seen_at is not None or not self._delivery.is_due(now):
            return False
        self._delivery.note_sent(now)
        if self._first_sent_at is None:
            self._first_sent_at = now
        return True

    def on_tick(self, now: float, unreadable: Reason | None = None) -> None:
        """Time out the action on a reachable robot; ``unreadable``: why its states cannot be used."""
        if self._seen_at is None and self._delivery.has_failed(now):
            # 6.5: a hibernating robot sends no states, so it reports nothing until it has woken.
            limit, since = self._settings.instant_action_limit, self._first_sent_at
            if self.action.action_type == STOP_HIBERNATION and since is not None and now - since < limit:
                return
            unseen = Reason(R.ACTION_UNSEEN, count=self._delivery.sendings)
            uncertain = unreadable and Reason(R.ACTION_UNCERTAIN, Reason(R.ROBOT, unreadable))
            self.outcome = Outcome(None, uncertain or unseen)
        elif self._seen_at is not None and now - self._seen_at > self._settings.instant_action_limit:
            limit = self._settings.instant_action_limit
            self.outcome = Outcome(None, Reason(R.ACTION_UNFINISHED, limit=limit))

    def hold(self, reason: Reason, now: float) -> None:
        """Suspend the action's timeout while it cannot be sent for ``reason``, or end it."""
        if self._seen_at is not None:
            self._seen_at = now
        # Nobody wants a pause hours after it was requested, for example.
        elif self.requested or self.awaits_state:
            self.outcome = Outcome(None, Reason(R.ACTION_UNCERTAIN, reason))
        else:
            self._delivery.restart()


def retry_or_skip(action_id: str, failed: str, *, retry: bool) -> Action:
    """Return the action that retries a RETRIABLE action or sets it to FAILED (section 6.2.3)."""
    return Action(
        action_type=RETRY if retry else "skipRetry",
        action_id=action_id,
        blocking_type=BlockingType.NONE,
        action_parameters=(ActionParameter(key="actionId", value=failed),),
    )


def without_parameters(action_type: str, action_id: str) -> Action:
    """Return an instant action that has no parameters and stops nothing, such as stateRequest."""
    return Action(action_type=action_type, action_id=action_id, blocking_type=BlockingType.NONE)


INSTANT_IDS_KEPT: Final = 200
"""Number of remembered instant action IDs, so that their states are not mistaken for the order's."""

ALWAYS_ALLOWED: Final = frozenset({STATE_REQUEST, FACTSHEET_REQUEST})
"""Instant actions allowed in all operating modes except INTERVENED, which allows only cancelOrder."""

SENT_UNREAD: Final = frozenset({STATE_REQUEST, START_PAUSE})
"""Instant actions that are sent to a robot that has not reported yet: whatever it does, they move nothing."""

CLEARING_PAUSE: Final = 30.0
"""Seconds between attempts to clear a robot's ended instant actions."""

LEAVING_WITHIN: Final = 30.0
"""Seconds within which a robot changes its connection after it has reported hibernation or shutdown."""

FACTSHEET_TIMEOUT: Final = 2.0
"""Maximum time that orders wait for a requested factsheet, seconds."""


class InstantActionManager:
    """Sends instant actions to one robot and tracks each to its end (section 6.2.1).

    ``broker`` is whether our own link is up. ``unread``: only :data:`SENT_UNREAD` is sent before the robot's
    next state, see :meth:`FleetController.on_broker`.
    """

    def __init__(
        self, robot: Robot, settings: FleetSettings, new_id: Callable[[], str], *, broker: bool
    ) -> None:
        self.broker = broker
        self.unread = False
        self.ids: deque[str] = deque(maxlen=INSTANT_IDS_KEPT)
        """IDs of the last instant actions, including ended ones."""
        self._robot = robot
        self._settings = settings
        self._new_id = new_id
        self._runs: dict[str, InstantRun] = {}
        self._next_clearing = 0.0
        self._factsheet_request: InstantRun | None = None
        self._factsheet_asked_at = 0.0
        self._going: set[str] = set()
        """IDs of unfinished :data:`LEAVES` actions on this connection, including those of other senders."""
        self._left_at: float | None = None
        """When the robot reported hibernation or shutdown, until its connection shows it; else None."""

    @property
    def is_busy(self) -> bool:
        """Whether any instant action is active."""
        return bool(self._runs) or self._left_at is not None

    @property
    def is_leaving(self) -> bool:
        """Whether the robot is about to hibernate or to shut down."""
        return (
            bool(self._going)
            or self._left_at is not None
            or (bool(self._runs) and any(run.action.action_type in LEAVES for run in self._runs.values()))
        )

    @property
    def is_cancelling(self) -> bool:
        """Whether a cancelOrder is active."""
        return bool(self._runs) and any(run.is_cancel for run in self._runs.values())

    def why_unsendable(self, action_type: str, now: float) -> Reason | None:
        """Return, as a predicate, why the robot must not be sent such an action now; None if it may."""
        link = self._robot.link_status(now)
        if link in REPORTS_NOTHING and self._robot.is_reachable:
            link = LinkStatus.ONLINE  # it may still listen: resends end at their limit, not here
        unread = self.unread
        if action_type == STOP_HIBERNATION:  # a hibernating robot reports no state
            unread = False
            link = LinkStatus.ONLINE if link is LinkStatus.HIBERNATING else link
        elif action_type in SENT_UNREAD:
            unread = False
            link = link if link in NOT_REACHED else LinkStatus.ONLINE
        away = availability.why_away(link, self._robot.unreadable, broker=self.broker, unread=unread)
        state = self._robot.state
        if away or state is None or state.operating_mode.fleet_controls:
            return away
        if state.operating_mode is OperatingMode.INTERVENED:
            return None if action_type == CANCEL_ORDER else Reason(R.INTERVENED)
        if action_type in ALWAYS_ALLOWED:
            return None
        return Reason(R.MODE_WITHOUT_ACTIONS, mode=state.operating_mode)

    def begin_requested(self, action: Action, now: float) -> Iterator[FleetOutput]:
        """Begin a requested instant action, unless the robot certainly would not receive or accept it."""
        if self._robot.abilities:
            action = fitted_action(action, self._robot.abilities)
        refusal = self._why_refused(action, now)
        if refusal:
            failed = ActionStatus.FAILED
            yield InstantActionEnded(self._robot.key, action, failed, Reason(R.ACTION_NOT_SENT, refusal))
        else:
            self._begin_run(action, requested=True)

    def begin_cancel(self, order_id: str) -> InstantRun:
        """Begin a cancelOrder (section 6.1.3)."""
        # The parameter orderId came with 3.0; a 2.x robot may refuse what it does not know.
        rules = self._robot.rules
        has_order_id = rules is not None and rules.cancel_names_order
        action = Action(
            action_type=CANCEL_ORDER,
            action_id=self._new_id(),
            blocking_type=BlockingType.HARD,
            action_parameters=(ActionParameter(key="orderId", value=order_id),) if has_order_id else (),
        )
        return self._begin_run(action, requested=False)

    def can_cancel(self, now: float) -> bool:
        """Return whether cancelOrder may be sent now."""
        return self.why_unsendable(CANCEL_ORDER, now) is None

    def ask_for_state(self) -> None:
        """Request the robot's state until it reports; does nothing while it is being asked."""
        if not any(run.awaits_state for run in self._runs.values()):
            self._begin_run(without_parameters(STATE_REQUEST, self._new_id()), requested=False)

    def on_reconnect(self) -> None:
        """Handle a new connection: request the factsheet again, and forget that the robot was leaving."""
        self._factsheet_request = None
        self._going.clear()
        self._left_at = None

    def on_link(self, link: LinkStatus) -> Iterator[FleetOutput]:
        """End the actions whose effect is visible in the robot's connection."""
        for run in self._runs.values():
            run.on_link(link)
        yield from self._drop_ended()

    def awaits_factsheet(self, now: float) -> bool:
        """Return whether the robot's factsheet was just requested and may still arrive."""
        if self._robot.abilities or not self._factsheet_request:
            return False
        end = self._factsheet_request.outcome
        has_failed = end is not None and end.status is not ActionStatus.FINISHED
        return not has_failed and now - self._factsheet_asked_at < FACTSHEET_TIMEOUT

    def on_state(self, state: State, now: float) -> Iterator[FleetOutput]:
        """Update all actions from a new state; request a missing factsheet, and clear ended actions."""
        if self._runs:
            reported: dict[str, ActionState] = {
                action.action_id: action for action in (*state.action_states, *state.instant_action_states)
            }
            self._runs = {name: run for name, run in self._runs.items() if not run.awaits_state}
            for run in self._runs.values():
                run.on_states(reported, now)
        if self._runs or self._going or state.instant_action_states:
            self._note_leaving(state, now)
            yield from self._drop_ended()
        # 7.10: factsheets are retained, but brokers lose them, and some robots publish theirs only on
        # request. Once per connection is enough: who does not answer has none.
        if self._robot.abilities is None and self._factsheet_request is None:
            action = without_parameters(FACTSHEET_REQUEST, self._new_id())
            self._factsheet_request, self._factsheet_asked_at = self._begin_run(action, requested=False), now
        if state.instant_action_states:
            self._clear_ended(state, now)

    def on_tick(self, now: float) -> Iterator[FleetOutput]:
        """Time out instant actions."""
        if self._left_at is not None and now - self._left_at >= LEAVING_WITHIN:
            self._left_at = None
        for run in self._runs.values():
            reason = self.why_unsendable(run.action.action_type, now)
            if reason is None:
                run.on_tick(now, self._robot.unreadable)
            else:
                run.hold(Reason(R.ROBOT, reason), now)
        yield from self._drop_ended()

    def send_due(self, now: float) -> Iterator[FleetOutput]:
        """Send due actions, with at most as many per message as the factsheet allows."""
        due = tuple(
            run.action
            for run in self._runs.values()
            if not self.why_unsendable(run.action.action_type, now) and run.begin_sending(now)
        )
        at_once = self._robot.most_instant_actions
        for first in range(0, len(due), at_once):
            yield PublishInstantActions(self._robot.key, due[first : first + at_once])

    def _why_refused(self, action: Action, now: float) -> Reason | None:
        if len(self._runs) >= INSTANT_ACTIONS_LIMIT:
            return Reason(R.ACTIONS_TOO_MANY, count=INSTANT_ACTIONS_LIMIT)
        if action.action_id in self.ids:
            return Reason(R.ACTION_ID_USED, action=action.action_id)
        abilities = self._robot.abilities
        problem = instant_action_problem(action, abilities) if abilities else None
        if problem:
            return Reason(R.ACTION_UNFIT, problem)
        reason = self.why_unsendable(action.action_type, now)
        return Reason(R.ROBOT, reason) if reason else None

    def _begin_run(self, action: Action, *, requested: bool) -> InstantRun:
        run = InstantRun(action, self._settings, requested=requested)
        self._runs[action.action_id] = run
        if action.action_type in LEAVES:
            self._going.add(action.action_id)
        self.ids.append(action.action_id)
        return run

    def _note_leaving(self, state: State, now: float) -> None:
        """Update whether the robot is about to hibernate or shut down, no matter who requested it."""
        # Only an action that was seen unfinished counts as finished now: one that has already ended in the
        # first state of a connection is an old one, and the robot is back.
        reported = (*state.action_states, *state.instant_action_states)
        finished = {action.action_id for action in reported if action.action_status is ActionStatus.FINISHED}
        if self._going & finished:
            self._left_at = now
        self._going = {
            action.action_id
            for action in state.instant_action_states
            if action.action_type in LEAVES and not action.action_status.ended
        } | {
            name
            for name, run in self._runs.items()
            if run.action.action_type in LEAVES and run.outcome is None
        }

    def _clear_ended(self, state: State, now: float) -> None:
        """Send clearInstantActions, if the robot offers it, before ended instant actions pile up."""
        # 6.6.9: since 3.0 they stay in the state until they are cleared, and every state grows with them.
        ended = sum(1 for action in state.instant_action_states if action.action_status.ended)
        if ended < self._robot.clears_instant_actions_from or now < self._next_clearing:
            return
        rules, abilities = self._robot.rules, self._robot.abilities
        if not rules or not rules.instant_states_until_cleared:
            return
        if not abilities or not abilities.declared_actions(CLEAR_INSTANT_ACTIONS):
            return
        action = without_parameters(CLEAR_INSTANT_ACTIONS, self._new_id())
        if self._why_refused(action, now) is None:
            self._next_clearing = now + CLEARING_PAUSE
            self._begin_run(action, requested=False)

    def _drop_ended(self) -> Iterator[FleetOutput]:
        for run in [run for run in self._runs.values() if run.outcome]:
            del self._runs[run.action.action_id]
            self._going.discard(run.action.action_id)
            finished = run.outcome is not None and run.outcome.status is ActionStatus.FINISHED
            if finished and run.action.action_type == STOP_HIBERNATION:
                self._left_at = None
            if run.requested and run.outcome:
                ended = run.outcome
                yield InstantActionEnded(
                    self._robot.key, run.action, ended.status, ended.reason, ended.result
                )
