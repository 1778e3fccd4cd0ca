"""Actions beside the order (sections 6.2.1 and 7.4): each is judged for itself, and none runs twice."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from nena_edge_agent.protocol.action_flow import OwnAction
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.declaration import (
    CANCEL_ORDER,
    CLEAR_INSTANT_ACTIONS,
    DELETE_ZONE_SET,
    ENABLE_ZONE_SET,
    FACTSHEET_REQUEST,
    INITIALIZE_POSITION,
    RETRY,
    SKIP_RETRY,
    START_PAUSE,
    STATE_REQUEST,
    STOP_PAUSE,
    TRIGGER,
)
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import SendFactsheet, StartAction
from nena_edge_agent.protocol.instant_refusal import refuse
from nena_edge_agent.protocol.order_cancel import OrderCancel
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.pause import Pause
from nena_edge_agent.protocol.position_setting import PositionSetting
from nena_edge_agent.protocol.retry import Retry
from nena_edge_agent.protocol.trigger import Trigger
from nena_edge_agent.protocol.zone_keeping import ZoneKeeping
from nena_shared.vda5050.action import Action, ActionStatus, InstantActions
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope

MESSAGE_LIMIT = 100
"""Actions that one message may hold; none of a longer one is begun."""
STATES_KEPT = 200
"""States of instant actions shown at most; beyond it the oldest ended ones go, then none more is begun."""
HARMLESS = frozenset({STATE_REQUEST, FACTSHEET_REQUEST})
"""Taken in every operating mode."""
IDS_KNOWN = 1000
"""Ids of instant actions that are recognised when they come again."""


def under_way(parts: RobotParts) -> int:
    """Count the instant actions that have not ended."""
    return sum(not record.status.ended for record in parts.instants)


class InstantActionFlow:
    """Takes in instant actions and hands each to what does it."""

    def __init__(
        self,
        parts: RobotParts,
        *,
        cancel: OrderCancel,
        pause: Pause,
        position: PositionSetting,
        retry: Retry,
        trigger: Trigger,
        zones: ZoneKeeping,
    ) -> None:
        self._parts = parts
        self.on_nodes: dict[str, OwnAction] = {
            CLEAR_INSTANT_ACTIONS: self._clear,
            ENABLE_ZONE_SET: zones.enable,
        }
        """Those that the order may name as well."""
        self._own: dict[str, Callable[[Action], None]] = {
            CANCEL_ORDER: cancel.request,
            START_PAUSE: pause.start,
            STOP_PAUSE: pause.stop,
            INITIALIZE_POSITION: position.request,
            STATE_REQUEST: self._finish,
            FACTSHEET_REQUEST: self._send_factsheet,
            CLEAR_INSTANT_ACTIONS: partial(self._end, self._clear),
            ENABLE_ZONE_SET: partial(self._end, zones.enable),
            DELETE_ZONE_SET: partial(self._end, zones.delete),
            RETRY: retry.retry,
            SKIP_RETRY: retry.skip,
            TRIGGER: trigger.request,
        }

    def take(self, message: InstantActions) -> None:
        """Begin or refuse each action; one that came before is passed over."""
        if len(message.actions) > MESSAGE_LIMIT:
            self._show_excess(message)
            return
        for action in message.actions:
            if action.action_id in self._parts.known_instant_ids:
                continue
            self._remember(action)
            problem = self._problem(action)
            if problem:
                self._refuse(action, problem, message)
            else:
                self._begin(action)

    def _problem(self, action: Action) -> str | None:
        if action.action_id in self._parts.actions:
            return "the actionId is used by an action of the order"
        if problem := self._mode_problem(action):
            return problem
        declaration = self._parts.capabilities.actions.get(action.action_type)
        if declaration is None:
            return f"the robot knows no action '{action.action_type}'"
        if action.action_type not in self._own and under_way(self._parts) > STATES_KEPT:
            return f"{STATES_KEPT} instant actions are under way already"
        if declaration.needs_idle and (problem := self._order_problem()):
            return problem
        loaded = bool(self._parts.loads)
        return declaration.problem(action, ActionScope.INSTANT) or declaration.load_problem(loaded=loaded)

    def _order_problem(self) -> str | None:
        """Say which order keeps the robot from an action that none may be active for."""
        parts = self._parts
        if parts.idle and not parts.clearing and not parts.goal.moving:
            return None
        return f"order '{parts.progress.order_id}' is active; wait for its end or cancel it"

    def _mode_problem(self, action: Action) -> str | None:
        """Say if fleet control may not ask for this while a person has the robot (section 6.6.6)."""
        mode = self._parts.coming_mode
        if mode.fleet_controls or action.action_type in HARMLESS:
            return None
        if mode.takes_orders and action.action_type == CANCEL_ORDER:
            return None
        return f"the robot is in mode {mode}"

    def _begin(self, action: Action) -> None:
        parts = self._parts
        parts.errors.end(Until.INSTANT_ACTION_ACCEPTED)
        own = self._own.get(action.action_type)
        if own:
            own(action)
        else:
            parts.instants.change(action.action_id, ActionStatus.INITIALIZING)
            parts.effects.append(StartAction(action, parts.loads))

    def _refuse(self, action: Action, problem: str, message: InstantActions) -> None:
        hint = "the factsheet lists the robot's actions"
        refuse(self._parts, action, problem, hint=hint, header_id=message.header_id)

    def _show_excess(self, message: InstantActions) -> None:
        entry = error(
            ErrorType.INSUFFICIENT_MEMORY,
            f"the message has {len(message.actions)} instant actions, the robot takes {MESSAGE_LIMIT}",
            hint="send them in parts",
            topic="instantActions",
            header_id=message.header_id,
        )
        self._parts.errors.show(entry, Until.INSTANT_ACTION_ACCEPTED)

    def _remember(self, action: Action) -> None:
        parts = self._parts
        parts.known_instant_ids[action.action_id] = None
        while len(parts.known_instant_ids) > IDS_KNOWN:
            del parts.known_instant_ids[next(iter(parts.known_instant_ids))]
        if action.action_id not in parts.actions:
            parts.instants.add([ActionRecord(action, ActionScope.INSTANT)])
        surplus = len(list(parts.instants)) - STATES_KEPT
        if surplus > 0:
            ended = [record for record in parts.instants if record.status.ended][:surplus]
            parts.instants.remove(lambda record: record in ended)

    def _finish(self, action: Action) -> None:
        self._parts.instants.change(action.action_id, ActionStatus.FINISHED)

    def _end(self, do: OwnAction, action: Action) -> None:
        self._parts.instants.change(action.action_id, *do(action))

    def _clear(self, _: Action) -> tuple[ActionStatus, str | None]:
        """Forget what has ended; the clearing itself is shown until the next one."""
        self._parts.instants.remove(lambda record: record.status.ended)
        return ActionStatus.FINISHED, None

    def _send_factsheet(self, action: Action) -> None:
        self._parts.effects.append(SendFactsheet())
        self._finish(action)
