"""Translate a layout's rules (LIF) for vehicle types at points and on paths to VDA 5050 order fields."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import atan2, hypot
from typing import Self, TypeVar

from nena_order_service.fleet.position import RobotProfile, Standing
from nena_plant_formats.lif.checks import SAME_PLACE_M
from nena_plant_formats.lif.mobile_robots import json_value
from nena_shared.plant import (
    DirectedEdge,
    MapTransform,
    PlantModel,
    PlantPlace,
    Point,
    Vehicle,
    curve,
    track,
)
from nena_shared.plant.driver_properties import (
    ACTION_TAGS,
    ActionTrigger,
    find_actions,
    find_edge_fields,
    read_blocking_types,
)
from nena_shared.plant.geometry import normalized
from nena_shared.vda5050 import order as vda
from nena_shared.vda5050.action import Action, ActionParameter, BlockingType

Use = TypeVar("Use", track.VehicleTypeAtPoint, track.VehicleTypeOnPath)


@dataclass(frozen=True)
class TypeRules:
    """The rules for a vehicle's possible types.

    Rules that differ between these types do not apply, except that each type's forbidden actions do.
    """

    vehicle_types: frozenset[str] = frozenset()
    can_reverse: bool = True
    properties: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Those of the vehicle."""

    @classmethod
    def of(cls, vehicle: Vehicle | None, plant: PlantModel) -> Self:
        """Return the rules for a vehicle; without a type, it may be of any type in the plant model."""
        own = vehicle.vehicle_type if vehicle else None
        return cls(
            frozenset({own}) if own else plant.vehicle_types,
            can_reverse=vehicle is None or vehicle.max_reverse_velocity_mm_s > 0,
            properties=vehicle.properties if vehicle else {},
        )

    @cached_property
    def blocking_types(self) -> Mapping[str, BlockingType]:
        """The blocking types that the vehicle sets for its actions, by action type."""
        return {name: BlockingType(own) for name, own in read_blocking_types(self.properties).items()}

    def demanded_actions(
        self, properties: Mapping[str, str], trigger: ActionTrigger | None, *tags: str | None
    ) -> Iterator[track.TypeAction]:
        """Yield the actions that properties demand of the vehicle; see ``find_actions``."""
        return find_actions(properties, trigger, (self.properties.get(ACTION_TAGS), *tags))

    def with_own_blocking(self, actions: tuple[Action, ...]) -> tuple[Action, ...]:
        """Return actions with the blocking types that the vehicle sets for them."""
        if not self.blocking_types:
            return actions
        return tuple(
            action.model_copy(
                update={"blocking_type": self.blocking_types.get(action.action_type, action.blocking_type)}
            )
            for action in actions
        )

    def at(self, point: Point) -> track.VehicleTypeAtPoint | None:
        """Return the rule for the vehicle at a point, or None."""
        return self._common_use(point.vehicle_types)

    def along(self, edge: DirectedEdge) -> track.VehicleTypeOnPath | None:
        """Return the rule for the vehicle on an edge, or None."""
        # LIF rules a direction, not a path: backwards, none of what is said of this edge holds.
        return self._common_use(edge.path.vehicle_types) if edge.is_forward else None

    def _common_use(self, uses: Iterable[Use]) -> Use | None:
        own_uses = [use for use in uses if use.vehicle_type_id in self.vehicle_types]
        if not own_uses:
            return None
        first = own_uses[0]
        alike = {"vehicle_type_id": first.vehicle_type_id}
        return first if all(use.model_copy(update=alike) == first for use in own_uses[1:]) else None


NO_RULES = TypeRules()


def edge_fields(
    edges: Sequence[DirectedEdge],
    rules: TypeRules,
    plant: PlantModel,
    standing: Standing,
    profile: RobotProfile,
) -> Iterator[dict[str, object]]:
    """Yield the VDA 5050 fields that the rules define for each edge of a route.

    Of several allowed orientations, the one with the least turning before and after the edge is chosen.
    """
    pose = standing.pose
    heading = profile.on(pose.map_id).heading_to_plant(pose.theta) if pose else None
    for number, edge in enumerate(edges, start=1):
        rule, end, planned = rules.along(edge), plant.point(edge.destination), find_edge_fields(edge)
        if planned:
            planned["turns_as_planned"] = True
        wanted = required_heading(rules.at(end), end) if number == len(edges) else None
        if rule is None:
            heading = None  # it may have turned on the way
            yield planned
            continue
        tangents = _tangents_of(edge, rule, plant)
        orientation = _orientation_of(rule, tangents, heading, wanted, can_reverse=rules.can_reverse)
        heading = None if orientation is None else _absolute_orientation(rule, orientation, tangents[1])
        transform = profile.on(end.map_id or profile.map_id)
        trajectory = _make_trajectory(rule.trajectory, (plant.point(edge.source), end), transform)
        fields = _edge_fields(rule, orientation, transform, profile.corridor_width)
        yield {**fields, "trajectory": trajectory, **planned}


def required_heading(rule: track.VehicleTypeAtPoint | None, point: Point) -> float | None:
    """Return the required heading at a point, rad in the plant's frame; None: any."""
    return rule.theta if rule is not None and rule.theta is not None else point.heading_rad


Tangents = tuple[float | None, float | None]
"""Directions of a path at its start and end, rad in the plant's frame; None if it has no length."""


def _tangents_of(edge: DirectedEdge, rule: track.VehicleTypeOnPath, plant: PlantModel) -> Tangents:
    a, b = plant.point(edge.source), plant.point(edge.destination)
    places = [(a.x_m, a.y_m), (b.x_m, b.y_m)]
    if rule.trajectory:  # its control points show the directions at its ends
        places = [(control_point.x, control_point.y) for control_point in rule.trajectory.control_points]
    parts = [(start, end) for start, end in pairwise(places) if start != end]
    if not parts:
        return None, None
    first, last = (atan2(end[1] - start[1], end[0] - start[0]) for start, end in (parts[0], parts[-1]))
    return first, last


_SAME_TURN = 6
"""Decimal places to which turns, rad, are rounded for comparison."""


def _orientation_of(
    rule: track.VehicleTypeOnPath,
    tangents: Tangents,
    heading: float | None,
    wanted: float | None,
    *,
    can_reverse: bool,
) -> float | None:
    """Return the orientation with the least turning before and after the edge, rad."""
    possible = [
        orientation
        for orientation in rule.orientations
        if can_reverse or not rule.leads_backward(orientation)
    ]

    def turning(orientation: float) -> float:
        turn_in = _turn_between(heading, _absolute_orientation(rule, orientation, tangents[0]))
        turn_out = _turn_between(_absolute_orientation(rule, orientation, tangents[1]), wanted)
        return round(turn_in + turn_out, _SAME_TURN)

    return min(possible, key=turning, default=None)


def _absolute_orientation(
    rule: track.VehicleTypeOnPath, orientation: float, tangent: float | None
) -> float | None:
    if rule.orientation_type is track.PathOrientationType.GLOBAL:
        return orientation
    return None if tangent is None else tangent + orientation


def _turn_between(start: float | None, end: float | None) -> float:
    return 0.0 if start is None or end is None else abs(normalized(end - start))


def _edge_fields(
    rule: track.VehicleTypeOnPath,
    orientation: float | None,
    transform: MapTransform,
    corridor_width: float | None,
) -> dict[str, object]:
    """Return the fields of an edge for which the rule has values."""
    guidance, corridor = rule.line_guidance, None
    if rule.corridor and corridor_width != 0:  # 0: the vehicle may not leave the trajectory at all
        widths = (rule.corridor.maximum_left_width, rule.corridor.maximum_right_width)
        left, right = (
            transform.length_to_map(width if corridor_width is None else min(width, corridor_width))
            for width in widths
        )
        reference = rule.corridor.corridor_reference_point
        corridor = vda.Corridor(
            left_width=left,
            right_width=right,
            corridor_reference_point=vda.CorridorReferencePoint(reference) if reference else None,
        )
    fields: dict[str, object] = {
        "reach_orientation_before_entering": not rule.rotation_allowed,
        "maximum_rotation_speed": rule.max_rotation_speed,
        "minimum_load_handling_device_height": _not_negative(rule.min_height),
        "maximum_mobile_robot_height": _not_negative(rule.max_height),
        "direction": guidance.direction if guidance else None,
        "length": transform.length_to_map(guidance.length) if guidance and guidance.length else None,
        "corridor": corridor,
    }
    if orientation is not None:
        # 7.3: a tangential orientation is relative to the path, so the map's rotation does not touch it.
        absolute = rule.orientation_type is track.PathOrientationType.GLOBAL
        heading = transform.heading_to_map(orientation) if absolute else orientation
        fields |= {
            "orientation": normalized(heading),
            "orientation_type": vda.OrientationType(rule.orientation_type),
        }
    return fields


def _not_negative(height: float | None) -> float | None:
    return None if height is None or height < 0 else height


def _make_trajectory(
    trajectory: track.PathTrajectory | None, ends: tuple[Point, Point], transform: MapTransform
) -> vda.Trajectory | None:
    """Return the trajectory in the map's frame; None if it does not lead from node to node."""
    if trajectory is None or curve.fault(trajectory):
        return None
    trajectory = curve.scaled(trajectory)
    # VDA 5050 3.0, 7.3: control points include both ends, so a curve that misses its nodes contradicts them.
    for (x, y), point in zip(curve.places(trajectory, 1), ends, strict=True):
        if hypot(x - point.x_m, y - point.y_m) > SAME_PLACE_M:
            return None
    control_points = []
    for control_point in trajectory.control_points:
        place = transform.to_map(PlantPlace(control_point.x, control_point.y))
        control_points.append(vda.ControlPoint(x=place.x_m, y=place.y_m, weight=control_point.weight))
    return vda.Trajectory(
        degree=trajectory.degree,
        knot_vector=trajectory.knot_vector,
        control_points=tuple(control_points),
    )


def required_actions(
    rule: track.VehicleTypeAtPoint | track.VehicleTypeOnPath | None, own: Iterable[Action], ids: Iterator[str]
) -> tuple[Action, ...]:
    """Return the rule's required actions that are not among ``own``, with new IDs."""
    if rule is None or not rule.actions:
        return ()
    own_types = {action.action_type for action in own}
    required = [
        action
        for action in rule.actions
        if action.requirement_type is track.RequirementType.REQUIRED and action.action_type not in own_types
    ]
    return tuple(make_action(ruled, action_id) for ruled, action_id in zip(required, ids, strict=False))


def make_action(ruled: track.TypeAction, action_id: str) -> Action:
    """Return an action of the plant model."""
    return Action(
        action_type=ruled.action_type,
        action_id=action_id,
        action_descriptor=ruled.action_description or ruled.action_type,
        blocking_type=BlockingType(ruled.blocking_type),
        action_parameters=tuple(_fixed_parameters(ruled)),
    )


def as_ruled(actions: Iterable[Action], rule: track.VehicleTypeAtPoint | None) -> Iterator[Action]:
    """Yield actions with the blocking types and parameters that the rule defines for them."""
    listed = {action.action_type: action for action in reversed(rule.actions if rule else ())}
    for action in actions:
        ruled = listed.get(action.action_type)
        if ruled is None:
            yield action
            continue
        fixed = tuple(_fixed_parameters(ruled))
        keys = {parameter.key for parameter in fixed}
        others = (parameter for parameter in action.action_parameters if parameter.key not in keys)
        changes = {
            "blocking_type": BlockingType(ruled.blocking_type),
            "action_parameters": (*others, *fixed),
        }
        yield action.model_copy(update=changes)


def _fixed_parameters(action: track.TypeAction) -> Iterator[ActionParameter]:
    return (
        ActionParameter(key=parameter.key, value=json_value(parameter))
        for parameter in action.action_parameters
    )
