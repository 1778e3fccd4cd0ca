"""One instant action on its way to a robot and to its end there (VDA 5050 3.0 sections 6.2.1 and 6.6.9)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from nena_order_service.fleet.delivery import Delivery
from nena_order_service.fleet.reported import ActionState
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.vda5050.action import Action, ActionParameter, ActionStatus, BlockingType

RETRY: Final = "retry"
CANCEL_ORDER: Final = "cancelOrder"
CLEAR_INSTANT_ACTIONS: Final = "clearInstantActions"
FACTSHEET_REQUEST: Final = "factsheetRequest"


@dataclass(frozen=True, slots=True)
class Outcome:
    """How an instant action ended; ``status`` is None where the robot never told its end."""

    status: ActionStatus | None
    reason: str
    result: str | None = None


class InstantRun:
    """Follows one instant action; ``outcome`` is set once, when it has ended.

    ``requested`` tells whether somebody outside of fleet control waits for its end.
    """

    def __init__(self, action: Action, settings: FleetSettings, *, requested: bool) -> None:
        self.action = action
        self.requested = requested
        self.outcome: Outcome | None = None
        self._settings = settings
        self._delivery = Delivery(settings)
        self._seen_at: float | None = None

    @property
    def cancels(self) -> bool:
        """Whether the action ends the robot's order."""
        return self.action.action_type == CANCEL_ORDER

    def on_states(self, states: Mapping[str, ActionState], now: float) -> None:
        """Look for the action among all those that the robot reports."""
        state = states.get(self.action.action_id)
        if state is None:
            if self._seen_at is not None:
                self.outcome = Outcome(None, "the robot no longer reports it; it may have started anew")
            return
        if self._seen_at is None:
            self._seen_at = now
        if state.action_status.ended:
            reason = "done" if state.action_status is ActionStatus.FINISHED else "the robot could not do it"
            self.outcome = Outcome(state.action_status, reason, state.action_result)

    def wants_sending(self, now: float) -> bool:
        """Tell whether the action is to be sent now; the caller then does so."""
        if self._seen_at is not None or not self._delivery.due(now):
            return False
        self._delivery.sent(now)
        return True

    def on_tick(self, now: float) -> None:
        """Give up what takes too long at a robot that can be reached."""
        if self._seen_at is None and self._delivery.failed(now):
            reason = f"sent {self._delivery.sendings} times, but the robot never reported it"
            self.outcome = Outcome(None, reason)
        elif self._seen_at is not None and now - self._seen_at > self._settings.instant_action_limit:
            limit = f"{self._settings.instant_action_limit:g}"
            self.outcome = Outcome(None, f"the robot has not ended it within {limit} s")

    def hold(self, reason: str, now: float) -> None:
        """Let no time pass for the action while it cannot be sent, for ``reason``.

        One that somebody has asked for and that the robot may never have got ends instead: nobody wants a
        pause that comes hours later.
        """
        if self._seen_at is not None:
            self._seen_at = now
        elif self.requested:
            self.outcome = Outcome(None, f"{reason}; whether it got the action is not known")
        else:
            self._delivery.hold()


def cancel_order(action_id: str, order_id: str | None = None) -> Action:
    """Make the action that ends the robot's order, named ``order_id`` where it may be (section 6.1.3)."""
    parameters = () if order_id is None else (ActionParameter(key="orderId", value=order_id),)
    return Action(
        action_type=CANCEL_ORDER,
        action_id=action_id,
        blocking_type=BlockingType.HARD,
        action_parameters=parameters,
    )


def retry_or_skip(action_id: str, failed: str, *, retry: bool) -> Action:
    """Make the action that begins a RETRIABLE one anew, or lets it be FAILED (section 6.2.3)."""
    return Action(
        action_type=RETRY if retry else "skipRetry",
        action_id=action_id,
        blocking_type=BlockingType.NONE,
        action_parameters=(ActionParameter(key="actionId", value=failed),),
    )


def clear_instant_actions(action_id: str) -> Action:
    """Make the action that takes ended instant actions out of the robot's state (section 6.2.3)."""
    return Action(action_type=CLEAR_INSTANT_ACTIONS, action_id=action_id, blocking_type=BlockingType.NONE)


def factsheet_request(action_id: str) -> Action:
    """Make the action that asks the robot for its factsheet (section 6.2.3)."""
    return Action(action_type=FACTSHEET_REQUEST, action_id=action_id, blocking_type=BlockingType.NONE)
