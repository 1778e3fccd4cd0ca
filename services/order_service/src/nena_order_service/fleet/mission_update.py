"""How a mission grows: a newer plan against the one that the robot has (VDA 5050 3.0 section 6.1.2)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from nena_order_service.fleet import reported_errors
from nena_order_service.fleet.delivery import Delivery
from nena_order_service.fleet.mission import Mission
from nena_order_service.fleet.reported import ErrorEntry, State
from nena_order_service.fleet.reported_errors import ErrorIdentity
from nena_shared.vda5050.order import Edge, Node


class BaseChangedError(ValueError):
    """A plan that does not keep what the robot was told to be its base, which nothing takes back."""

    def __init__(self, mission_id: str, problem: str) -> None:
        super().__init__(f"mission {mission_id!r} cannot be changed so: {problem}")
        self.mission_id = mission_id


@dataclass(slots=True)
class PendingUpdate:
    """An update that no state has echoed yet. ``plan`` is the whole mission by it."""

    plan: Mission
    message: Mission
    """What is sent: from the decision point on."""
    update_id: int
    delivery: Delivery
    errors_before: frozenset[ErrorIdentity] = frozenset()

    def refusals(self, errors: Iterable[ErrorEntry]) -> tuple[ErrorEntry, ...]:
        """Give the errors by which the robot refuses it."""
        return tuple(
            each
            for each in errors
            if reported_errors.identity(each) not in self.errors_before
            and not reported_errors.of_another_action(each, self.plan)
            and reported_errors.refuses_update(each, self.plan.mission_id, self.update_id)
        )

    def is_refused(self, refusals: Iterable[ErrorEntry], now: float) -> bool:
        """Tell whether refusals are to be believed."""
        return self.delivery.is_refused(now, named=any(map(self._is_named, refusals)))

    def _is_named(self, error: ErrorEntry) -> bool:
        return reported_errors.is_named(error, self.plan) or reported_errors.names_update(error)


def grown(held: Mission, plan: Mission) -> Mission:
    """Give the plan with the base of ``held`` as the robot was sent it, to the last field.

    Raises:
        BaseChangedError: the plan is of another mission, or not a way on from the base.

    """
    base = _base_length(held)
    if plan.mission_id != held.mission_id:
        raise BaseChangedError(held.mission_id, f"the plan is that of {plan.mission_id!r}")
    if _base_length(plan) < base or _outline(plan, base) != _outline(held, base):
        raise BaseChangedError(held.mission_id, "the plan has another base")
    nodes = (*held.nodes[:base], *plan.nodes[base:])
    edges = (*held.edges[: base - 1], *plan.edges[base - 1 :])
    return Mission(mission_id=plan.mission_id, nodes=nodes, edges=edges)


def update_of(held: Mission, plan: Mission) -> Mission:
    """Give what must be sent to a robot that has ``held`` so that it has ``plan``, from its base's end on.

    Raises:
        BaseChangedError: as :func:`grown`.

    """
    whole, begin = grown(held, plan), _base_length(held) - 1
    return Mission(mission_id=whole.mission_id, nodes=whole.nodes[begin:], edges=whole.edges[begin:])


def released_to(plan: Mission, sequence_id: int) -> Mission:
    """Give the plan with its base ending at the node ``sequence_id``."""
    nodes = tuple(_released(node, released=node.sequence_id <= sequence_id) for node in plan.nodes)
    edges = tuple(edge.model_copy(update={"released": edge.sequence_id < sequence_id}) for edge in plan.edges)
    return Mission(mission_id=plan.mission_id, nodes=nodes, edges=edges)


def held_by(state: State, plan: Mission) -> Mission:
    """Give as much of the plan as a robot that has an older update says that it has for its base."""
    base = [each.sequence_id for each in state.node_states if each.released]
    return released_to(plan, base[-1] if base else state.last_node_sequence_id)


def _base_length(mission: Mission) -> int:
    return sum(1 for node in mission.nodes if node.released)


def _outline(mission: Mission, base: int) -> tuple[object, ...]:
    """Give what makes a base the same; how exactly it is written may differ, as by a newer factsheet."""
    parts: tuple[Node | Edge, ...] = (*mission.nodes[:base], *mission.edges[: base - 1])
    return tuple(
        (_name(each), each.sequence_id, tuple(action.action_id for action in each.actions)) for each in parts
    )


def _name(part: Node | Edge) -> str:
    return part.node_id if isinstance(part, Node) else part.edge_id


def _released(node: Node, *, released: bool) -> Node:
    return node.model_copy(update={"released": released})
