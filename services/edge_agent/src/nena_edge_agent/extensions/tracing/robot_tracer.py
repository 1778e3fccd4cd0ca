"""Spans of a robot's orders, goals and actions, from the events and effects of the protocol core."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime

from nena_edge_agent.driver.port import Arrived, DriveFailed, GoalTable, Halted
from nena_edge_agent.protocol import events
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.clock import Clock
from nena_shared.extensions.tracing import (
    EVENTS_LIMIT,
    AttributeValue,
    Export,
    Span,
    SpanEvent,
    cut,
    new_span_id,
    order_name_of,
    trace_id_of,
    vda_order_span_id,
)
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.topics import RobotKey

INTERRUPTED = "interrupted"
"""The outcome of spans that are open at the end of the program."""


@dataclass(slots=True)
class _OpenSpan:
    """Work that has not ended."""

    name: str
    begin: datetime
    attributes: dict[str, AttributeValue]
    span_id: int = field(default_factory=new_span_id)
    events: list[SpanEvent] = field(default_factory=list)

    def add_event(self, name: str, time: datetime, **attributes: AttributeValue) -> None:
        """Add an event, unless there are too many."""
        if len(self.events) < EVENTS_LIMIT:
            prefixed = {f"vda5050.{key}": value for key, value in attributes.items()}
            self.events.append(SpanEvent(name, time, prefixed))


@dataclass(slots=True)
class _OpenOrder:
    """The order that the robot executes, and its goals and actions that have not ended."""

    order_id: str
    update_id: int
    trace_id: int
    parent_id: int | None
    span: _OpenSpan
    goal: _OpenSpan | None = None
    generation: int = 0
    known_goals: frozenset[str] = frozenset()
    """Goals that navigation had before this one."""
    actions: dict[str, _OpenSpan] = field(default_factory=dict)
    ended_actions: set[str] = field(default_factory=set)
    revision: int = -1
    """Revision of the action states at the last event."""


class RobotTracer:
    """Follows one robot, and exports a span for each piece of work that has ended.

    Orders of NeNa's order service belong to the trace of their transport order. Other fleet controls send no
    ``nenaEpoch``; each of their orders is a trace of its own.
    """

    def __init__(self, robot: RobotKey, clock: Clock, export: Export) -> None:
        self._robot = robot
        self._clock = clock
        self._export = export
        self._order: _OpenOrder | None = None
        self._last_order_id: str | None = None

    def handle_event(self, event: events.Event, effects: Iterable[events.Effect], robot: RobotState) -> None:
        """Handle an event, its effects, and the robot's state after it."""
        order, order_id = self._order, robot.progress.order_id
        received = isinstance(event, events.OrderReceived)
        if order and order.order_id != order_id:
            self._end_order(order, "replaced")
            order = None
        # An order of one node without actions is over with its own event.
        if order is None and order_id and (not robot.idle or (received and order_id != self._last_order_id)):
            order = self._begin_order(event, robot)
        self._last_order_id = order_id
        if order is None:
            return
        self._note_update(order, robot)
        self._note_goal(order, event)
        for effect in effects:
            if isinstance(effect, events.Drive):
                self._begin_goal(order, effect, robot)
        if order.revision != robot.actions.revision:
            order.revision = robot.actions.revision
            for record in robot.actions:
                self._note_action(order, record)
        if robot.idle:
            self._end_order(order, "cancelled" if robot.progress.cleared else "finished")

    def close(self) -> None:
        """Export what has not ended; after a restart, the rest of it is another span."""
        if self._order:
            self._end_order(self._order, INTERRUPTED)

    def _begin_order(self, event: events.Event, robot: RobotState) -> _OpenOrder:
        progress, last = robot.progress, robot.history.last_header
        is_new = isinstance(event, events.OrderReceived)
        epoch = event.order.nena_epoch if isinstance(event, events.OrderReceived) else last and last.epoch
        span = _OpenSpan("robot order", self._clock.now(), {"nena.restored": not is_new})
        order = self._order = _OpenOrder(
            progress.order_id,
            progress.order_update_id,
            # 0060: `order-1` and `order-2` of another fleet control are two orders, not two drives of one.
            trace_id_of(progress.order_id if epoch is None else order_name_of(progress.order_id)),
            None if epoch is None else vda_order_span_id(progress.order_id),
            span,
        )
        # Actions that ended in an earlier run have their spans from it.
        if not is_new:
            order.ended_actions.update(
                action.action.action_id for action in robot.actions if action.status.ended
            )
        return order

    def _note_update(self, order: _OpenOrder, robot: RobotState) -> None:
        update_id = robot.progress.order_update_id
        if update_id != order.update_id:
            order.update_id = update_id
            order.span.add_event("vda5050.orderUpdateAccepted", self._clock.now(), order_update_id=update_id)

    def _begin_goal(self, order: _OpenOrder, effect: events.Drive, robot: RobotState) -> None:
        self._end_goal(order, "replaced")
        node, goal = robot.progress.next_node, effect.goal
        order.goal = _OpenSpan(
            "goal",
            self._clock.now(),
            {
                "vda5050.node_id": node.node_id if node else "",
                "vda5050.map_id": goal.pose.map_id,
                "nena.goal.x": goal.pose.x,
                "nena.goal.y": goal.pose.y,
                "nena.goal.theta": goal.pose.theta,
            },
        )
        order.generation = goal.generation
        order.known_goals = frozenset(robot.reports.goals.own)

    def _note_goal(self, order: _OpenOrder, event: events.Event) -> None:
        match event:
            case Arrived(generation) if generation == order.generation:
                self._end_goal(order, "arrived")
            case DriveFailed(generation, failure, description) if generation == order.generation:
                self._end_goal(order, failure.value, error=cut(description))
            case Halted():
                self._end_goal(order, "halted")
            case GoalTable() if order.goal and (accepted := set(event.own) - order.known_goals):
                order.known_goals = frozenset(event.own) | order.known_goals
                for goal_id in sorted(accepted):
                    order.goal.add_event("nav2.goalAccepted", self._clock.now(), goal_id=goal_id)
            case _:
                pass

    def _note_action(self, order: _OpenOrder, record: ActionRecord) -> None:
        action = record.action
        if action.action_id in order.ended_actions:
            return
        if (record.active or record.status.ended) and action.action_id not in order.actions:
            order.actions[action.action_id] = _OpenSpan(
                f"action {cut(action.action_type)}",
                self._clock.now(),
                {"vda5050.action_id": action.action_id, "vda5050.action_type": cut(action.action_type)},
            )
        if record.status.ended:
            order.ended_actions.add(action.action_id)
            open_span = order.actions.pop(action.action_id)
            failed = record.status is ActionStatus.FAILED
            error = cut(record.result or "no reason given") if failed else ""
            self._end_span(order, open_span, record.status.value, error=error)

    def _end_goal(self, order: _OpenOrder, outcome: str, *, error: str = "") -> None:
        if order.goal:
            self._end_span(order, order.goal, outcome, error=error)
            order.goal = None

    def _end_order(self, order: _OpenOrder, outcome: str) -> None:
        self._end_goal(order, outcome)
        for action in order.actions.values():
            self._end_span(order, action, outcome)
        self._end_span(order, order.span, outcome)
        self._order = None

    def _end_span(self, order: _OpenOrder, ended: _OpenSpan, outcome: str, *, error: str = "") -> None:
        whose = {
            "vda5050.order_id": order.order_id,
            "vda5050.manufacturer": self._robot.manufacturer,
            "vda5050.serial_number": self._robot.serial_number,
            "nena.outcome": outcome,
        }
        self._export(
            Span(
                name=ended.name,
                trace_id=order.trace_id,
                span_id=ended.span_id,
                parent_id=order.parent_id if ended is order.span else order.span.span_id,
                begin=ended.begin,
                end=self._clock.now(),
                attributes={**whose, **ended.attributes},
                events=tuple(ended.events),
                error=error,
            )
        )
