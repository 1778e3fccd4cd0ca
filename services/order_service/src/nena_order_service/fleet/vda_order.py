"""Build VDA 5050 orders for drive orders: the graph, its actions, its updates and its horizon."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, pairwise, zip_longest
from types import MappingProxyType
from typing import Any, Final, TypeVar
from uuid import uuid4

from pydantic import JsonValue

from nena_order_service.fleet.position import DEFAULT_DEVIATION_XY, GOAL_PREFIX, RobotProfile, Standing
from nena_order_service.fleet.type_rules import (
    NO_RULES,
    TypeRules,
    as_ruled,
    edge_fields,
    make_action,
    required_actions,
    required_heading,
)
from nena_order_service.routing.graph import Route, Step
from nena_plant_formats.lif.mobile_robots import json_value
from nena_shared.fleet_api.transport_order import Coordinate
from nena_shared.plant import DirectedEdge, Location, MapPlace, PlantModel, PlantPlace
from nena_shared.plant.driver_properties import ACTION_TAGS, ActionTrigger
from nena_shared.plant.geometry import normalized
from nena_shared.plant.track import Point, TypeAction, VehicleTypeAtPoint, VehicleTypeOnPath
from nena_shared.vda5050.action import STATION_ACTIONS, Action, ActionParameter, BlockingType
from nena_shared.vda5050.base import Identifier, WireObject
from nena_shared.vda5050.order import AllowedDeviationXY, Edge, Node, NodePosition
from nena_shared.vda5050.state import State

G = TypeVar("G", Node, Edge)


class VdaOrder(WireObject):
    """One drive order as a VDA 5050 order graph (section 6.1.1).

    It is built once and stored, so that it can be sent again unchanged after a restart: the IDs of its
    actions must not change.
    """

    order_id: Identifier
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]

    @cached_property
    def actions(self) -> tuple[Action, ...]:
        """All actions, in driving order."""
        parts = chain.from_iterable(zip_longest(self.nodes, self.edges))
        return tuple(action for part in parts if part for action in part.actions)

    @cached_property
    def action_ids(self) -> frozenset[str]:
        """The IDs of all actions."""
        return frozenset(action.action_id for action in self.actions)

    @cached_property
    def final_action_ids(self) -> frozenset[str]:
        """The IDs of the actions at the last node."""
        return frozenset(action.action_id for action in self.nodes[-1].actions)

    @cached_property
    def edges_with_actions(self) -> tuple[Edge, ...]:
        """The edges that have actions; usually none."""
        return tuple([edge for edge in self.edges if edge.actions])

    @cached_property
    def base_length(self) -> int:
        """The number of released nodes."""
        return [node.released for node in self.nodes].count(True)

    @property
    def last_sequence_id(self) -> int:
        """The sequenceId of the last node."""
        return self.nodes[-1].sequence_id


NO_ACTION: Final = ""
"""The action type of operations that only require arriving."""

RECHARGE_ACTION: Final = "startCharging"

PICK: Final = "pick"
DROP: Final = "drop"

DEFAULT_ACTION_TYPES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Load cargo": "pick",
        "Load": "pick",
        "Unload cargo": "drop",
        "Unload": "drop",
        "Charge": "startCharging",
        "CHARGE": "startCharging",
        "MOVE": NO_ACTION,
        "PARK": NO_ACTION,
        "NOP": NO_ACTION,
    }
)

STATION_PARAMETERS: Final = frozenset({"stationType", "stationName", "loadType"})
"""Parameters of pick and drop that are always sent."""

UNSPECIFIED_LOAD: Final = "unspecified"
"""Default loadType; 2.1 requires this parameter for pick and drop."""


def unique_id() -> str:
    """Return a unique ID of 32 characters; some robots do not accept longer ones."""
    return uuid4().hex


@dataclass(frozen=True, slots=True)
class OperationMap:
    """Maps operations to action types; an unknown operation is an action of the same name.

    ``action_types`` overrides the defaults; an empty action type means that only arriving is required.
    """

    action_types: Mapping[str, str] = field(default_factory=dict)
    new_id: Callable[[], str] = unique_id

    def action_type(self, operation: str) -> str:
        """Return the action type of an operation."""
        usual = DEFAULT_ACTION_TYPES.get(operation, operation)
        return self.action_types.get(operation, usual)

    def recharges(self, operation: str) -> bool:
        """Return whether an operation recharges the vehicle."""
        return self.action_type(operation) == RECHARGE_ACTION

    def actions(
        self,
        operation: str,
        properties: Mapping[str, JsonValue],
        location: Location | None = None,
        *,
        planned: TypeAction | None = None,
        recharges: bool = False,
        retriable: bool = False,
    ) -> tuple[Action, ...]:
        """Return the actions of ``operation`` with new IDs; ``properties`` become parameters.

        For pick and drop, the location's name and type become stationName and stationType, unless the
        properties define them. ``planned`` is what the plant defines for the operation: its action type is
        the operation, unless ``action_types`` has another. ``recharges``: it recharges this vehicle.
        """
        action_type = self.action_type(operation)
        if operation not in self.action_types and action_type != NO_ACTION and (recharges or planned):
            action_type = RECHARGE_ACTION if recharges else operation
        if action_type == NO_ACTION:
            return ()
        parameters: dict[str, JsonValue] = {}
        if action_type in STATION_ACTIONS:
            parameters = {"stationType": "point"}
            if location:
                parameters = {"stationType": location.type, "stationName": location.name}
            parameters["loadType"] = UNSPECIFIED_LOAD
        if planned:
            parameters |= {each.key: json_value(each) for each in planned.action_parameters}
        parameters |= properties
        action = Action(
            action_type=action_type,
            action_id=self.new_id(),
            action_descriptor=operation,
            blocking_type=BlockingType(planned.blocking_type) if planned else BlockingType.HARD,
            action_parameters=tuple(
                ActionParameter(key=key, value=value) for key, value in parameters.items()
            ),
            retriable=retriable or None,
        )
        return (action,)


START_PREFIX = "start:"
"""Prefixes of the VDA order's ID in the IDs of nodes that are not points of the plant."""


def order_id(order_name: str, drive_order_index: int, attempt: int = 0) -> str:
    """Return the ID of a drive order's VDA order; each new attempt is a separate order for the robot.

    Order names contain no ``~``, so the IDs of different orders never collide.
    """
    first = f"{order_name}-{drive_order_index}"
    return f"{first}~{attempt}" if attempt else first


@dataclass(frozen=True, slots=True)
class _Stop:
    """A node being built; m and rad in the frame of the map ``map_id``."""

    node_id: str
    place: MapPlace
    map_id: str
    theta: float | None = None
    edge_id: str | None = None
    """ID of the edge that leads here, if it is an edge of the plant."""
    edge_fields: Mapping[str, Any] = field(default_factory=dict)
    """Other fields of the edge that leads here, from the plant."""
    edge_rule: VehicleTypeOnPath | None = None
    rule: VehicleTypeAtPoint | None = None
    """The layout's rule for the robot's type at the node; ``edge_rule``: on the edge that leads here."""
    point: Point | None = None
    """The node's point; None: a pose or a coordinate."""
    edge: DirectedEdge | None = None
    """The plant's edge that leads here."""


SpeedLimit = Callable[[DirectedEdge | None], float | None]
"""Returns the speed limit of a vehicle on an edge or, with None, off the paths; m/s."""


def unlimited(_edge: DirectedEdge | None) -> None:
    """Return None: no speed limit."""


def build_vda_order(
    name: str,
    *,
    plant: PlantModel,
    standing: Standing,
    profile: RobotProfile,
    route: Route | None = None,
    coordinate: Coordinate | None = None,
    actions: tuple[Action, ...] = (),
    speed_limit: SpeedLimit = unlimited,
    rules: TypeRules = NO_RULES,
) -> VdaOrder:
    """Build the VDA order with ID ``name`` (section 6.1.1): along the route, then to the coordinate, if any.

    It starts at the robot's position: at its point or, off the points, at a temporary node at its pose.
    The last node has the heading of the point or coordinate, and ``actions``. Actions required by ``rules``
    are at their nodes and edges, except at the start node; actions that properties demand are also there.

    Raises:
        ValueError: there is neither a route nor a coordinate, or the route does not start at the robot.
    """
    if route is None and coordinate is None:
        raise ValueError("a VDA order needs a route or a coordinate")
    if route is not None and route.source != standing.point:
        raise ValueError(f"the route begins at {route.source!r}, the robot is at {standing.point!r}")
    stops = list(_stops_of_route(name, plant, standing, profile, route, rules=rules, speed_limit=speed_limit))
    if coordinate is not None:
        # A coordinate has no map of its own: it is on that of the node before it.
        transform = profile.on(stops[-1].map_id)
        theta = None if coordinate.theta is None else transform.heading_to_map(coordinate.theta)
        place = transform.to_map(PlantPlace(coordinate.x, coordinate.y))
        fields = {"maximum_speed": speed_limit(None)}
        stops.append(_Stop(GOAL_PREFIX + name, place, stops[-1].map_id, theta, edge_fields=fields))
    # Only the last node gets a heading, so that the robot need not stop to turn at those in between.
    elif len(stops) > 1 and (heading := _heading_at(plant, profile, stops[-1].node_id, rules)) is not None:
        stops[-1] = replace(stops[-1], theta=heading)
    return VdaOrder(
        order_id=name,
        nodes=tuple(_make_nodes(stops, profile, actions, rules)),
        edges=tuple(
            Edge(
                edge_id=end.edge_id or f"{start.node_id} --- {end.node_id}",
                sequence_id=2 * index + 1,
                released=True,
                actions=_edge_actions(end, rules),
                **end.edge_fields,
            )
            for index, (start, end) in enumerate(pairwise(stops))
        ),
    )


def _stops_of_route(
    name: str,
    plant: PlantModel,
    standing: Standing,
    profile: RobotProfile,
    route: Route | None,
    *,
    rules: TypeRules,
    speed_limit: SpeedLimit,
) -> Iterator[_Stop]:
    """Yield the start and the points of the route.

    The start is a temporary node at the robot's pose, if it must drive or turn to be at its start point.
    """
    # Without steps, a robot that stands at its goal may still have to turn there. The first node counts as
    # reached at once (6.6.2), so the turn needs a second one.
    turns = False
    if route is not None and not route.steps and standing.pose is not None:
        wanted = _heading_at(plant, profile, standing.point, rules)
        allowed = profile.deviation_theta_at(plant.point(standing.point))
        turns = wanted is not None and abs(normalized(wanted - standing.pose.theta)) > allowed
    pose = standing.pose if turns or not standing.on_point else None
    if pose is not None:
        yield _Stop(START_PREFIX + name, MapPlace(pose.x, pose.y), pose.map_id)
    if pose is None or route is not None:
        fields: dict[str, object] = {} if pose is None else {"maximum_speed": speed_limit(None)}
        yield _stop_at(plant, profile, rules, standing.point, fields)
    steps = route.steps if route else ()
    ruled = edge_fields([step.edge for step in steps], rules, plant, standing, profile)
    for step, of_rule in zip(steps, ruled, strict=True):
        fields = {"maximum_speed": speed_limit(step.edge), **of_rule}
        yield _stop_at(plant, profile, rules, step.destination, fields, step=step)


def _stop_at(
    plant: PlantModel,
    profile: RobotProfile,
    rules: TypeRules,
    point_name: str,
    edge_fields: Mapping[str, Any],
    *,
    step: Step | None = None,
) -> _Stop:
    """Return the node of a point; ``step`` leads there, None: the robot is there, or off the paths."""
    point = plant.point(point_name)
    map_id = point.map_id or profile.map_id
    return _Stop(
        point_name,
        profile.on(map_id).to_map(PlantPlace(point.x_m, point.y_m)),
        map_id,
        edge_id=step.edge_id if step else None,
        edge_fields=edge_fields,
        edge_rule=rules.along(step.edge) if step else None,
        rule=rules.at(point),
        point=point,
        edge=step.edge if step else None,
    )


def _heading_at(plant: PlantModel, profile: RobotProfile, point_name: str, rules: TypeRules) -> float | None:
    point = plant.point(point_name)
    wanted = required_heading(rules.at(point), point)
    transform = profile.on(point.map_id or profile.map_id)
    return None if wanted is None else transform.heading_to_map(wanted)


def _edge_actions(end: _Stop, rules: TypeRules) -> tuple[Action, ...]:
    properties = end.edge.path.properties if end.edge else {}
    demanded = (make_action(each, unique_id()) for each in rules.demanded_actions(properties, None))
    required = required_actions(end.edge_rule, (), iter(unique_id, ""))
    return rules.with_own_blocking((*required, *demanded))


def _make_nodes(
    stops: list[_Stop], profile: RobotProfile, actions: tuple[Action, ...], rules: TypeRules
) -> Iterator[Node]:
    last = len(stops) - 1
    for index, stop in enumerate(stops):
        own = tuple(as_ruled(actions, stop.rule)) if index == last else ()
        required = required_actions(stop.rule, own, iter(unique_id, "")) if index else ()
        trigger = ActionTrigger.PASSING if stop.edge else ActionTrigger.ORDER_START
        demanded = rules.demanded_actions(
            stop.point.properties if stop.point else {},
            ActionTrigger.ORDER_END if index == last else trigger,
            stop.edge.path.properties.get(ACTION_TAGS) if stop.edge else None,
        )
        planned = (make_action(each, unique_id()) for each in demanded)
        yield Node(
            node_id=stop.node_id,
            sequence_id=2 * index,
            released=True,
            node_position=_node_position(stop, profile, starts=index == 0),
            actions=rules.with_own_blocking((*required, *planned, *own)),
        )


def _node_position(stop: _Stop, profile: RobotProfile, *, starts: bool) -> NodePosition:
    """Return the position of a node; the start node has a wide deviation (section 6.6.2)."""
    # A robot outside the deviation of the first node refuses the order (6.1.4), so neither the layout's
    # bounds nor a narrow deviation of the vehicle apply to it.
    deviation = profile.deviation_xy_at(stop.point)
    deviation = max(deviation, DEFAULT_DEVIATION_XY) if starts else deviation
    transform = profile.on(stop.map_id)
    bounds = stop.rule.allowed_deviation_xy if stop.rule and not starts else None
    a, b = bounds.ellipse(deviation) if bounds else (deviation, deviation)
    turned = transform.heading_to_map(bounds.theta or 0.0) if bounds and a != b else 0.0
    return NodePosition(
        x=stop.place.x_m,
        y=stop.place.y_m,
        theta=stop.theta,
        map_id=stop.map_id,
        allowed_deviation_xy=AllowedDeviationXY(
            a=transform.length_to_map(a), b=transform.length_to_map(b), theta=normalized(turned)
        ),
        allowed_deviation_theta=None if stop.theta is None else profile.deviation_theta_at(stop.point),
    )


class BaseChangedError(ValueError):
    """The plan changes the robot's base, which is not allowed (section 6.1.2)."""

    def __init__(self, order_id: str, problem: str) -> None:
        super().__init__(f"VDA order {order_id!r} cannot be changed: {problem}")
        self.order_id = order_id


def with_kept_base(held: VdaOrder, plan: VdaOrder) -> VdaOrder:
    """Return the plan, with the base exactly as it was sent in ``held`` (section 6.1.2).

    Raises:
        BaseChangedError: the plan is for another VDA order, or does not continue from the base.
    """
    base = held.base_length
    if plan.order_id != held.order_id:
        raise BaseChangedError(held.order_id, f"the plan is that of {plan.order_id!r}")
    # The identities have to be the same. Optional fields may differ, as they do after a new factsheet.
    held_parts: tuple[Node | Edge, ...] = (*held.nodes[:base], *held.edges[: base - 1])
    plan_parts: tuple[Node | Edge, ...] = (*plan.nodes[:base], *plan.edges[: base - 1])
    if plan.base_length < base or [*map(_identity_of, held_parts)] != [*map(_identity_of, plan_parts)]:
        raise BaseChangedError(held.order_id, "the plan has a different base")
    # What was sent stays as it was: robots compare the stitching node with their own (6.1.2).
    nodes = (*held.nodes[:base], *plan.nodes[base:])
    edges = (*held.edges[: base - 1], *plan.edges[base - 1 :])
    return VdaOrder(order_id=plan.order_id, nodes=nodes, edges=edges)


def update_of(held: VdaOrder, plan: VdaOrder) -> VdaOrder:
    """Return the order update that changes ``held`` to ``plan``, from the end of the base (section 6.1.2).

    Raises:
        BaseChangedError: as :func:`with_kept_base`.
    """
    whole, begin = with_kept_base(held, plan), held.base_length - 1
    return VdaOrder(order_id=whole.order_id, nodes=whole.nodes[begin:], edges=whole.edges[begin:])


def released_to(plan: VdaOrder, sequence_id: int) -> VdaOrder:
    """Return the plan with its base ending at the node ``sequence_id`` (section 6.1.1)."""
    nodes = tuple(_with_release(node, released=node.sequence_id <= sequence_id) for node in plan.nodes)
    edges = tuple(_with_release(edge, released=edge.sequence_id < sequence_id) for edge in plan.edges)
    return VdaOrder(order_id=plan.order_id, nodes=nodes, edges=edges)


def held_by(state: State, plan: VdaOrder) -> VdaOrder:
    """Return the plan with the base that a robot with an older update reports (section 6.1.2)."""
    base = [node.sequence_id for node in state.node_states if node.released]
    return released_to(plan, base[-1] if base else state.last_node_sequence_id)


def _identity_of(part: Node | Edge) -> tuple[str, int, list[str]]:
    """Return the identity of a node or an edge."""
    name = part.node_id if isinstance(part, Node) else part.edge_id
    return name, part.sequence_id, [action.action_id for action in part.actions]


def _with_release(part: G, *, released: bool) -> G:
    return part if part.released is released else part.model_copy(update={"released": released})


def with_other_horizon(held: VdaOrder, base_end: int, tail: VdaOrder) -> VdaOrder:
    """Return ``held`` up to its node ``base_end``, continued by ``tail``, which starts there (section 6.1.2).

    The base is unchanged; of the first node of ``tail`` only the ID is used.

    Raises:
        ValueError: ``tail`` starts at another node, has only one node, or reuses an action ID.
    """
    if tail.nodes[0].node_id != held.nodes[base_end].node_id or not tail.edges:
        raise ValueError(f"the new route does not continue from node {held.nodes[base_end].node_id!r}")
    # 2.1 lets a robot keep listing the actions of a dropped horizon; 3.0 forbids it (6.6.9.1).
    if tail.action_ids & held.action_ids:
        raise ValueError("action IDs of the old horizon are reused")
    shift = 2 * base_end  # 6.1.1: nodes are even, edges odd, and both count on
    nodes = (node.model_copy(update={"sequence_id": node.sequence_id + shift}) for node in tail.nodes[1:])
    edges = (edge.model_copy(update={"sequence_id": edge.sequence_id + shift}) for edge in tail.edges)
    return VdaOrder(
        order_id=held.order_id,
        nodes=(*held.nodes[: base_end + 1], *nodes),
        edges=(*held.edges[:base_end], *edges),
    )
