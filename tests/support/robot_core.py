"""Orders for tests, and a bench that drives a robot core by hand."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, TypeVar

from pydantic import JsonValue

from nena_edge_agent.driver.port import (
    Arrived,
    DriveGoal,
    Halted,
    NavigationReport,
    Pose,
    PoseReport,
)
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.declaration import (
    POWER_ACTIONS,
    PREDEFINED,
    ActionDeclaration,
    Parameter,
    supported_actions,
)
from nena_edge_agent.protocol.events import (
    ActionReport,
    Drive,
    Effect,
    Event,
    InstantActionsReceived,
    OrderReceived,
    Started,
)
from nena_edge_agent.protocol.memory import Memory
from nena_edge_agent.protocol.robot import RobotCore
from nena_shared.vda5050.action import (
    Action,
    ActionParameter,
    ActionState,
    ActionStatus,
    BlockingType,
    InstantActions,
)
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.order import AllowedDeviationXY, Edge, Node, NodePosition, Order
from nena_shared.vda5050.state import State

HEADER: dict[str, Any] = {
    "header_id": 7,
    "timestamp": datetime(2026, 1, 1, tzinfo=UTC),
    "version": "2.1.0",
    "manufacturer": "ACME",
    "serial_number": "0001",
}
MAP = "hall"
EVERYWHERE = (ActionScope.NODE, ActionScope.EDGE, ActionScope.INSTANT)

WORK = ActionDeclaration("work", EVERYWHERE, pause_allowed=True, cancel_allowed=True, restartable=True)
PRESS = ActionDeclaration("press", EVERYWHERE)
"""Can be neither paused nor cancelled, and not restarted."""
LAMP = ActionDeclaration("lamp", EVERYWHERE, cancel_allowed=True, open_ended=True)
LIFT = ActionDeclaration("lift", (ActionScope.NODE,), parameters=(Parameter("height", ValueDataType.NUMBER),))
ACTIONS = {**PREDEFINED, **{each.action_type: each for each in (WORK, PRESS, LAMP, LIFT)}}
CAPABILITIES = Capabilities(map_id=MAP, actions=ACTIONS)

E = TypeVar("E")


def action(
    action_id: str,
    blocking: str = "NONE",
    action_type: str = "work",
    *,
    retriable: bool | None = None,
    **parameters: JsonValue,
) -> Action:
    return Action(
        action_type=action_type,
        action_id=action_id,
        blocking_type=BlockingType(blocking),
        retriable=retriable,
        action_parameters=tuple(ActionParameter(key=key, value=value) for key, value in parameters.items()),
    )


def hard(action_id: str, action_type: str, **parameters: Any) -> Action:
    """Make an action with blocking type HARD."""
    return action(action_id, "HARD", action_type, **parameters)


def position(
    x: float, y: float = 0.0, *, theta: float | None = None, radius: float | None = None
) -> NodePosition:
    return NodePosition(
        x=x,
        y=y,
        theta=theta,
        map_id=MAP,
        allowed_deviation_xy=None if radius is None else AllowedDeviationXY(a=radius, b=radius),
    )


def order(
    *node_ids: str,
    order_id: str = "o1",
    update: int = 0,
    first: int = 0,
    released: int | None = None,
    node_actions: Mapping[str, Sequence[Action]] | None = None,
    edge_actions: Mapping[str, Sequence[Action]] | None = None,
    positions: Mapping[str, NodePosition | None] | None = None,
    edge_fields: Mapping[str, Any] | None = None,
) -> Order:
    """Make an order along ``node_ids``; node "n3" is at x = 30 m, y = 0 by default, see ``positions``.

    The first ``released`` nodes are the base; edges are called ``n1-n2``.
    """
    base = len(node_ids) if released is None else released
    places = {name: position(10.0 * int(name[1:])) for name in node_ids} | dict(positions or {})
    nodes = tuple(
        Node(
            node_id=name,
            sequence_id=first + 2 * index,
            released=index < base,
            node_position=places[name],
            actions=tuple((node_actions or {}).get(name, ())),
        )
        for index, name in enumerate(node_ids)
    )
    edges = tuple(
        Edge(
            edge_id=f"{before.node_id}-{after.node_id}",
            sequence_id=before.sequence_id + 1,
            released=after.released,
            actions=tuple((edge_actions or {}).get(f"{before.node_id}-{after.node_id}", ())),
            **(edge_fields or {}),
        )
        for before, after in pairwise(nodes)
    )
    return Order(**HEADER, order_id=order_id, order_update_id=update, nodes=nodes, edges=edges)


def instant(*actions: Action) -> InstantActionsReceived:
    return InstantActionsReceived(InstantActions(**HEADER, actions=actions))


def at(x: float, y: float = 0.0, theta: float = 0.0, *, localized: bool = True) -> PoseReport:
    return PoseReport(Pose(x, y, theta, MAP), localized=localized, vx=0.0, omega=0.0)


class Bench:
    """A robot core; the test acts as its driver and its plug-ins."""

    def __init__(
        self,
        *,
        memory: Memory | None = None,
        ready: bool = True,
        power: frozenset[str] = frozenset(),
        **capabilities: Any,
    ) -> None:
        """Make a robot that offers the actions ``power`` of hibernation and shutdown."""
        chosen = replace(CAPABILITIES, **capabilities)
        self.capabilities = replace(chosen, actions=supported_actions(chosen.actions, chosen.rules, power))
        self.core = RobotCore(self.capabilities, memory)
        self.now = 100.0
        self.effects: list[Effect] = []
        if ready:
            self.do(Started(), at(0.0), NavigationReport(available=True, reason=""))

    def do(self, *events: Event) -> list[Effect]:
        """Handle ``events``; return the effects of these alone."""
        new = [effect for event in events for effect in self.core.handle(event, self.now)]
        self.effects.extend(new)
        return new

    def send(self, order: Order) -> list[Effect]:
        return self.do(OrderReceived(order))

    def instant(self, *actions: Action) -> list[Effect]:
        return self.do(instant(*actions))

    @property
    def goals(self) -> list[DriveGoal]:
        return [effect.goal for effect in self.effects if isinstance(effect, Drive)]

    @property
    def goal(self) -> DriveGoal:
        return self.goals[-1]

    def effects_of(self, kind: type[E]) -> list[E]:
        return [effect for effect in self.effects if isinstance(effect, kind)]

    def arrive(self) -> list[Effect]:
        """Make the robot reach its goal, and stand there."""
        goal = self.goal
        return self.do(PoseReport(goal.pose, localized=True, vx=0.0, omega=0.0), Arrived(goal.generation))

    def halted(self) -> list[Effect]:
        return self.do(Halted())

    def runs(self, *action_ids: str) -> list[Effect]:
        return self.do(*(ActionReport(each, ActionStatus.RUNNING) for each in action_ids))

    def finishes(self, *action_ids: str) -> list[Effect]:
        return self.do(*(ActionReport(each, ActionStatus.FINISHED) for each in action_ids))

    def fails(self, *action_ids: str) -> list[Effect]:
        return self.do(*(ActionReport(each, ActionStatus.FAILED, "broken") for each in action_ids))

    @property
    def state(self) -> State:
        return self.core.state(HEADER)

    @property
    def nodes(self) -> list[str]:
        return [node.node_id for node in self.state.node_states]

    @property
    def edges(self) -> list[str]:
        return [edge.edge_id for edge in self.state.edge_states]

    @property
    def errors(self) -> list[str]:
        return [error.error_type for error in self.state.errors]

    def status(self, action_id: str) -> str:
        states: Iterable[ActionState] = (*self.state.action_states, *self.state.instant_action_states)
        return next(state.action_status.value for state in states if state.action_id == action_id)

    def statuses(self) -> dict[str, str]:
        return {state.action_id: state.action_status.value for state in self.core.robot.actions.states}

    def waits(self) -> bool:
        return self.core.waits

    def asks_for_base(self) -> bool:
        return bool(self.state.new_base_request)

    @property
    def idle(self) -> bool:
        return self.core.robot.idle


def restarted(bench: Bench) -> Bench:
    """Return a robot that has restarted with what this one would have journalled."""
    kept = bench.core.memory().model_dump_json(exclude_defaults=True)
    power = POWER_ACTIONS & frozenset(bench.capabilities.actions)
    return Bench(memory=Memory.model_validate_json(kept), rules=bench.capabilities.rules, power=power)
