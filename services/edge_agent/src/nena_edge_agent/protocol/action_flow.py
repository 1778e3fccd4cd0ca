"""The life of the order's actions: queued, begun, held, ended (sections 6.2.2 and 6.6.9)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nena_edge_agent.protocol.action_states import ActionRecord, ActionStates, loads_after
from nena_edge_agent.protocol.declaration import PREDEFINED, WAIT_FOR_TRIGGER, ActionDeclaration
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import ActionReport, CancelAction, PauseAction, ResumeAction, StartAction
from nena_edge_agent.protocol.parts import RobotParts
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Edge

OwnAction = Callable[[Action], tuple[ActionStatus, str | None]]
"""Does an action, or begins it; gives its status from now on, and a result."""


class ActionFlow:
    """Starts what may run, and takes in what the plug-ins report."""

    def __init__(self, parts: RobotParts) -> None:
        self._parts = parts
        self.own: dict[str, OwnAction] = {}
        """What the core does itself on nodes, by action type."""
        self._left: set[str] = set()
        """Actions that a restart has ended in a pause; they begin anew when it is over."""

    def enqueue(self, actions: Sequence[Action]) -> None:
        """Queue the actions of a node that is reached or an edge that is entered, and start what may run."""
        self._parts.queue.append(actions)
        self.schedule()

    def schedule(self) -> None:
        """Start every queued action whose turn it is."""
        parts = self._parts
        while not parts.held and not parts.clearing and (waiting := self._startable()):
            for action_id in waiting:  # one that ends at once may be what others have waited for
                parts.actions.change(action_id, ActionStatus.INITIALIZING)
                self._start(action_id)

    def report(self, report: ActionReport) -> None:
        """Take in what a plug-in says about an action of the order or an instant one."""
        parts = self._parts
        states = parts.actions if report.action_id in parts.actions else parts.instants
        status = ActionStatus.RETRIABLE if self._may_be_retried(report) else report.status
        if not states.change(report.action_id, status, report.result):
            return
        record = states.get(report.action_id)
        if report.loads is not None:
            parts.loads = report.loads
        elif record and report.status is ActionStatus.FINISHED:
            parts.loads = loads_after(record.action, self._declaration(record), parts.loads)
        parts.charging = parts.charging if report.charging is None else report.charging
        parts.maps = parts.maps if report.maps is None else report.maps
        if report.error:
            parts.errors.show(report.error, Until.INSTANT_ACTION_ACCEPTED)
        if record and status.ended:
            parts.queue.remove(report.action_id)
        if record and states is parts.actions:
            self._keep_held(record)
        if record and report.status is ActionStatus.FAILED and states is parts.instants:
            parts.errors.show(_instant_failure(record), Until.INSTANT_ACTION_ACCEPTED)
        elif record and report.status is ActionStatus.FAILED and not parts.clearing:
            parts.errors.show(self.failure(record), Until.ORDER_OVER)

    def begin_anew(self, record: ActionRecord) -> None:
        """Begin an action once more that may be retried; its failure is no longer shown."""
        self._parts.errors.take_back(self.failure(record))
        self._parts.actions.change(record.action.action_id, ActionStatus.INITIALIZING, "")
        self._start(record.action.action_id)

    def end(self, record: ActionRecord, status: ActionStatus, result: str | None) -> None:
        """End an action of the order that no plug-in will end."""
        self._parts.actions.change(record.action.action_id, status, result)
        self._parts.queue.remove(record.action.action_id)

    def _startable(self) -> list[str]:
        records = [self._parts.actions.get(each) for each in self._parts.queue.runnable()]
        return [each.action.action_id for each in records if each and each.status is ActionStatus.WAITING]

    def _may_be_retried(self, report: ActionReport) -> bool:
        """Tell whether a failure is one that fleet control may have tried again (section 6.6.9)."""
        parts = self._parts
        record = parts.actions.get(report.action_id)
        return (
            report.status is ActionStatus.FAILED
            and record is not None
            and record.status is ActionStatus.RUNNING
            and bool(record.action.retriable)
            and not parts.clearing
            and ActionStatus.RETRIABLE in parts.capabilities.rules.standard.action_statuses
        )

    def _keep_held(self, record: ActionRecord) -> None:
        """Hold what began to run in a pause, and let go on what was held only when the pause was over."""
        held, action_id = self._parts.held, record.action.action_id
        if held and record.status is ActionStatus.RUNNING and self._declares(record, "pause_allowed"):
            self._parts.effects.append(PauseAction(action_id))
        elif not held and record.status is ActionStatus.PAUSED:
            self._parts.effects.append(ResumeAction(action_id))

    def end_with_edge(self, edge: Edge) -> None:
        """End what belongs to ``edge``, which the robot has left.

        What cannot be interrupted goes on beside the order, to its own end.
        """
        for action in edge.actions:
            record = self._parts.actions.get(action.action_id)
            if record and not record.status.ended:
                self._end_edge_action(record)

    def pause(self) -> None:
        """Hold every running action that can be held."""
        for record in self._parts.actions:
            if record.status is ActionStatus.RUNNING and self._declares(record, "pause_allowed"):
                self._parts.effects.append(PauseAction(record.action.action_id))

    def resume(self) -> None:
        """Let held actions go on."""
        left, self._left = self._left, set()
        for record in self._parts.actions:
            action_id = record.action.action_id
            if record.status is ActionStatus.PAUSED and action_id in left:
                self._parts.actions.change(action_id, ActionStatus.INITIALIZING)
                self._start(action_id)
            elif record.status is ActionStatus.PAUSED:
                self._parts.effects.append(ResumeAction(action_id))

    def give_up(self) -> None:
        """Fail what waits, and stop what runs where it can be stopped (section 6.1.3)."""
        parts = self._parts
        for record in list(parts.actions):
            action_id = record.action.action_id
            if record.status in (ActionStatus.WAITING, ActionStatus.RETRIABLE) or _is_waiting(record):
                self.end(record, ActionStatus.FAILED, "the order was cancelled")
            elif record.active and (action_id in self._left or self._declares(record, "cancel_allowed")):
                parts.effects.append(CancelAction(action_id))

    def take_up_again(self) -> None:
        """After a restart of the agent: begin anew what may be begun anew, fail what may not."""
        for states in (self._parts.actions, self._parts.instants):
            for record in [each for each in states if each.active]:
                if record.status is ActionStatus.RETRIABLE:
                    self._parts.errors.show(self.failure(record), Until.ORDER_OVER)
                elif record.action.action_type not in PREDEFINED:  # the core's own go on by themselves
                    self._take_up(states, record)

    def _take_up(self, states: ActionStates, record: ActionRecord) -> None:
        action_id = record.action.action_id
        if self._is_left(record):
            self._left.add(action_id)
            self._parts.actions.change(action_id, ActionStatus.PAUSED)
        elif self._declares(record, "restartable") and not self._parts.clearing:
            states.begin_anew(action_id)
            self._start(action_id)
        else:
            result = "the agent was interrupted while the action ran"
            self.report(ActionReport(action_id, ActionStatus.FAILED, result))

    def _is_left(self, record: ActionRecord) -> bool:
        """Tell whether the action may begin anew, but only once the robot is held no more."""
        parts = self._parts
        waits = parts.held and not parts.clearing and record.scope is not ActionScope.INSTANT
        return waits and self._declares(record, "restartable") and self._declares(record, "pause_allowed")

    def _start(self, action_id: str) -> None:
        parts = self._parts
        record = parts.actions.get(action_id) or parts.instants.get(action_id)
        if record and record.scope is not ActionScope.INSTANT and record.action.action_type in self.own:
            status, result = self.own[record.action.action_type](record.action)
            self.report(ActionReport(action_id, status, result))
        elif record and (problem := self._load_problem(record)):
            self.report(ActionReport(action_id, ActionStatus.FAILED, problem))
        elif record:
            parts.effects.append(StartAction(record.action, parts.loads))

    def _load_problem(self, record: ActionRecord) -> str | None:
        """Look at the load once more: an action before this one may have failed."""
        declaration = self._declaration(record)
        return declaration.load_problem(loaded=bool(self._parts.loads)) if declaration else None

    def _end_edge_action(self, record: ActionRecord) -> None:
        parts, action_id = self._parts, record.action.action_id
        if record.status is ActionStatus.RETRIABLE:
            self.end(record, ActionStatus.FAILED, record.result)
            parts.errors.show(self.failure(record), Until.ORDER_OVER)  # it can be tried again no more
            return
        if record.active and not self._declares(record, "cancel_allowed"):
            return
        if record.active:
            parts.effects.append(CancelAction(action_id))
        good = record.active and self._declares(record, "open_ended")
        status = ActionStatus.FINISHED if good else ActionStatus.FAILED
        self.report(ActionReport(action_id, status, None if good else "the edge ended before the action"))

    def _declares(self, record: ActionRecord, trait: str) -> bool:
        return bool(getattr(self._declaration(record), trait, False))

    def _declaration(self, record: ActionRecord) -> ActionDeclaration | None:
        return self._parts.capabilities.actions.get(record.action.action_type)

    def failure(self, record: ActionRecord) -> ErrorEntry:
        """Make the failure a warning: the robot goes on, what becomes of the order is not its to say."""
        retriable = record.status is ActionStatus.RETRIABLE
        entry = error(
            ErrorType.ACTION_FAILED,
            f"action '{record.action.action_type}' failed: {record.result or 'no reason given'}",
            hint="send retry or skipRetry"
            if retriable
            else "the order goes on; cancel it, or send the action again in another order",
            action_id=record.action.action_id,
            order_id=self._parts.progress.order_id or None,
        )
        return entry.model_copy(update={"error_level": ErrorLevel.WARNING})


def _instant_failure(record: ActionRecord) -> ErrorEntry:
    """Make the failure of an instant action a warning; no order has to do with it."""
    entry = error(
        ErrorType.ACTION_FAILED,
        f"action '{record.action.action_type}' failed: {record.result or 'no reason given'}",
        hint="remove the cause, and send it again under another actionId",
        action_id=record.action.action_id,
    )
    return entry.model_copy(update={"error_level": ErrorLevel.WARNING})


def _is_waiting(record: ActionRecord) -> bool:
    """Tell whether the action does nothing but wait for a trigger: the core does that itself."""
    return record.action.action_type == WAIT_FOR_TRIGGER
