"""Builds the mission of one drive order (VDA 5050 3.0 sections 6.1.1 and 7.3)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

from nena_order_service.fleet.mission import Mission
from nena_order_service.fleet.profile import DEFAULT_DEVIATION_XY, RobotProfile
from nena_order_service.fleet.standing import Standing
from nena_order_service.routing import Route
from nena_shared.fleet_api.transport_order import Coordinate
from nena_shared.plant import MapPlace, PlantModel, PlantPlace
from nena_shared.plant.transform import normalized
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.order import AllowedDeviationXY, Edge, Node, NodePosition

START_PREFIX = "start:"
GOAL_PREFIX = "goal:"
"""Before the mission's id: nodes that are no points of the plant."""


def mission_id(order_name: str, drive_order_index: int, attempt: int = 0) -> str:
    """Give the id of a drive order's mission; each new attempt is an order of its own for the robot.

    Names of orders hold no ``~``, so that no two orders have missions of one id.
    """
    first = f"{order_name}-{drive_order_index}"
    return f"{first}~{attempt}" if attempt else first


@dataclass(frozen=True, slots=True)
class _Stop:
    """A node in the making: m and rad of the map ``map_id``."""

    node_id: str
    place: MapPlace
    map_id: str
    theta: float | None = None
    edge_id: str | None = None
    """Of the edge that leads here, where the plant has a name for it."""


def build_mission(
    name: str,
    *,
    plant: PlantModel,
    standing: Standing,
    profile: RobotProfile,
    route: Route | None = None,
    coordinate: Coordinate | None = None,
    actions: tuple[Action, ...] = (),
) -> Mission:
    """Build the mission called ``name``: along the route, if any, then to the coordinate, if any.

    It begins where the robot stands; if that is no point of the plant, at a temporary node at its own pose.
    Points that are passed have no heading, so that the robot need not stop; the last one has that of the
    point or coordinate. ``actions`` are done at the end.

    Raises:
        ValueError: neither a route nor a coordinate, or a route that begins elsewhere than at the robot.

    """
    if route is None and coordinate is None:
        message = "a mission needs a route or a coordinate"
        raise ValueError(message)
    if route is not None and route.source != standing.point:
        message = f"the route begins at {route.source!r}, the robot is at {standing.point!r}"
        raise ValueError(message)
    stops = list(_way(name, plant, standing, profile, route))
    if coordinate is not None:
        stops.append(_goal(name, profile, coordinate, stops[-1].map_id))
    elif len(stops) > 1:
        stops[-1] = replace(stops[-1], theta=_heading(plant, profile, stops[-1].node_id))
    return Mission(
        mission_id=name,
        nodes=tuple(_nodes(stops, profile, actions)),
        edges=tuple(_edges(stops)),
    )


def _way(
    name: str, plant: PlantModel, standing: Standing, profile: RobotProfile, route: Route | None
) -> Iterator[_Stop]:
    """Give the start and the points of the route."""
    apart = _start(name, plant, standing, profile, route)
    if apart is not None:
        yield apart
    if apart is None or route is not None:
        yield _at(plant, profile, standing.point)
    for step in route.steps if route else ():
        yield _at(plant, profile, step.destination, step.edge_id)


def _start(
    name: str, plant: PlantModel, standing: Standing, profile: RobotProfile, route: Route | None
) -> _Stop | None:
    """Give the temporary node where the robot is, if it must drive to get to its own point."""
    pose = standing.pose
    if pose is None:
        return None
    if standing.on_point and not (route and not route.steps and _must_turn(plant, profile, standing)):
        return None
    return _Stop(START_PREFIX + name, MapPlace(pose.x, pose.y), pose.map_id)


def _must_turn(plant: PlantModel, profile: RobotProfile, standing: Standing) -> bool:
    wanted = _heading(plant, profile, standing.point)
    if wanted is None or standing.pose is None:
        return False
    return abs(normalized(wanted - standing.pose.theta)) > profile.deviation_theta


def _at(plant: PlantModel, profile: RobotProfile, point_name: str, edge_id: str | None = None) -> _Stop:
    point = plant.point(point_name)
    map_id = point.map_id or profile.map_id
    place = profile.on(map_id).to_map(PlantPlace(point.x_m, point.y_m))
    return _Stop(point_name, place, map_id, edge_id=edge_id)


def _heading(plant: PlantModel, profile: RobotProfile, point_name: str) -> float | None:
    point = plant.point(point_name)
    transform = profile.on(point.map_id or profile.map_id)
    return None if point.heading_rad is None else transform.heading_to_map(point.heading_rad)


def _goal(name: str, profile: RobotProfile, coordinate: Coordinate, map_id: str) -> _Stop:
    """Give the coordinate, on the map where the way to it ends."""
    place = profile.on(map_id).to_map(PlantPlace(coordinate.x, coordinate.y))
    theta = None if coordinate.theta is None else profile.on(map_id).heading_to_map(coordinate.theta)
    return _Stop(GOAL_PREFIX + name, place, map_id, theta)


def _nodes(stops: list[_Stop], profile: RobotProfile, actions: tuple[Action, ...]) -> Iterator[Node]:
    last = len(stops) - 1
    for index, stop in enumerate(stops):
        yield Node(
            node_id=stop.node_id,
            sequence_id=2 * index,
            released=True,
            node_position=_position(stop, profile, starts=index == 0),
            actions=actions if index == last else (),
        )


def _position(stop: _Stop, profile: RobotProfile, *, starts: bool) -> NodePosition:
    """Give the place of a node; where the robot starts, a wide deviation is what lets it (section 6.6.2)."""
    deviation = max(profile.deviation_xy, DEFAULT_DEVIATION_XY) if starts else profile.deviation_xy
    radius = profile.on(stop.map_id).length_to_map(deviation)
    return NodePosition(
        x=stop.place.x_m,
        y=stop.place.y_m,
        theta=stop.theta,
        map_id=stop.map_id,
        allowed_deviation_xy=AllowedDeviationXY(a=radius, b=radius),
        allowed_deviation_theta=None if stop.theta is None else profile.deviation_theta,
    )


def _edges(stops: list[_Stop]) -> Iterator[Edge]:
    for index, (before, after) in enumerate(pairwise(stops)):
        yield Edge(
            edge_id=after.edge_id or f"{before.node_id} --- {after.node_id}",
            sequence_id=2 * index + 1,
            released=True,
            actions=(),
        )
