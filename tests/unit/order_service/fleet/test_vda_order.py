"""Missions built from routes and coordinates."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import pytest

from nena_conversations.kit.honest_robot import HonestRobot
from nena_order_service.fleet.position import NotLocatedError, RobotProfile, Standing, locate
from nena_order_service.fleet.vda_order import OperationMap, VdaOrder, build_vda_order, order_id
from nena_order_service.routing.router import Router
from nena_shared.fleet_api.transport_order import Coordinate
from nena_shared.plant import DirectedEdge, MapTransform, PlantModel, Vehicle
from nena_shared.vda5050.graph import violations
from nena_shared.vda5050.order import Node, NodePosition
from nena_shared.vda5050.state import MobileRobotPosition
from support.fleet import order_of
from support.fleet_examples import state
from support.plants import path, point

PLANT = PlantModel(
    name="row",
    points=(
        point("A", 0, 0),
        point("B", 2000, 0, orientation_deg=45.0),
        point("C", 4000, 0, orientation_deg=90.0),
    ),
    paths=(path("A B", 2000), path("B C", 2000), path("C A", 5000, name="home", max_reverse_velocity_mm_s=5)),
)
PROFILE = RobotProfile(map_id="hall")


def pose(x: float, y: float, theta: float = 0.0, map_id: str = "hall") -> MobileRobotPosition:
    return MobileRobotPosition(x=x, y=y, theta=theta, map_id=map_id, localized=True)


def standing(x: float, y: float, theta: float = 0.0, *, last: str = "") -> Standing:
    return locate(PLANT, state(last_node_id=last, mobile_robot_position=pose(x, y, theta)), PROFILE)


def place(node: Node) -> NodePosition:
    assert node.node_position is not None
    return node.node_position


def to(goal: str, start: Standing, **more: object) -> VdaOrder:
    route = Router(PLANT).route(start.point, goal)
    content: dict[str, Any] = {"plant": PLANT, "profile": PROFILE, **more}
    return build_vda_order("m", standing=start, route=route, **content)


def speed(edge: DirectedEdge | None) -> float | None:
    return edge.max_velocity_m_s if edge else 0.7


def speeds(vda_order: VdaOrder) -> list[float | None]:
    return [each.maximum_speed for each in vda_order.edges]


def test_edges_have_the_plants_speed_limits() -> None:
    start = standing(0.1, 0.0)
    goal = Coordinate(x=1.0, y=1.0)

    assert speeds(to("C", start)) == [None, None]
    assert speeds(to("C", start, speed_limit=speed)) == [1.0, 1.0]
    beside = standing(0.0, 3.0)
    assert speeds(to("B", beside, speed_limit=speed)) == [0.7, 1.0]
    straight = build_vda_order(
        "m", plant=PLANT, standing=start, profile=PROFILE, coordinate=goal, speed_limit=speed
    )
    assert speeds(straight)[-1] == 0.7


@pytest.mark.clause("6.1.1", "6.1.1/first")
def test_a_route_becomes_a_graph_that_the_standard_allows() -> None:
    actions = OperationMap().actions("Load", {})
    vda_order = to("C", standing(0.1, 0.0), actions=actions)
    assert [node.node_id for node in vda_order.nodes] == ["A", "B", "C"]
    assert [edge.edge_id for edge in vda_order.edges] == ["A --- B", "B --- C"]
    assert violations(order_of(vda_order, HonestRobot())) == ()
    assert [node.actions for node in vda_order.nodes] == [(), (), actions]
    assert vda_order.last_sequence_id == 4
    assert vda_order.action_ids == {actions[0].action_id}


def test_only_the_end_has_a_heading() -> None:
    vda_order = to("C", standing(0.0, 0.0))
    assert [place(node).theta for node in vda_order.nodes] == [None, None, pytest.approx(pi / 2)]
    assert place(vda_order.nodes[-1]).allowed_deviation_theta == PROFILE.deviation_theta
    assert place(vda_order.nodes[0]).allowed_deviation_theta is None


def test_edges_have_the_ids_of_the_plant() -> None:
    assert [edge.edge_id for edge in to("A", standing(4.0, 0.0)).edges] == ["home"]
    home_is_short = PLANT.model_copy(
        update={"paths": (path("C A", 100, name="home", max_reverse_velocity_mm_s=5),)}
    )
    route = Router(home_is_short).route("A", "C")
    vda_order = build_vda_order(
        "m", plant=home_is_short, standing=standing(0.0, 0.0), profile=PROFILE, route=route
    )
    assert [edge.edge_id for edge in vda_order.edges] == ["home:backward"]


@pytest.mark.clause("6.1.1/first")
def test_a_robot_beside_the_points_starts_where_it_is() -> None:
    vda_order = to("C", standing(1.4, 0.3))
    assert [node.node_id for node in vda_order.nodes] == ["start:m", "B", "C"]
    assert (place(vda_order.nodes[0]).x, place(vda_order.nodes[0]).y) == (1.4, 0.3)
    assert vda_order.edges[0].edge_id == "start:m --- B"


@pytest.mark.parametrize(
    ("goal", "at", "coordinate", "nodes", "heading"),
    [
        pytest.param("B", (1.3, 0.3), None, ["start:m", "B"], pi / 4, id="beside its destination"),
        pytest.param("A", (0.0, 0.0), None, ["A"], None, id="on the point"),
        pytest.param("B", (2.0, 0.0, pi), None, ["start:m", "B"], pi / 4, id="with the wrong heading"),
        pytest.param("B", (2.0, 0.0, pi / 4 + 0.1), None, ["B"], None, id="nearly with its heading"),
        pytest.param(None, (0.0, 0.0), (3.0, 1.0, 1.0), ["A", "goal:m"], 1.0, id="to a coordinate"),
        pytest.param(None, (3.0, 1.0), (1.0, 1.0), ["start:m", "goal:m"], None, id="from one to another"),
        pytest.param("B", (0.0, 0.0), (2.5, 1.0), ["A", "B", "goal:m"], None, id="by a route to one"),
    ],
)
def test_the_nodes_and_the_final_heading(
    goal: str | None,
    at: tuple[float, ...],
    coordinate: tuple[float, ...] | None,
    nodes: list[str],
    heading: float | None,
) -> None:
    start = standing(*at)
    there = Coordinate(**dict(zip(("x", "y", "theta"), coordinate, strict=False))) if coordinate else None
    route = Router(PLANT).route(start.point, goal) if goal else None
    vda_order = build_vda_order(
        "m", plant=PLANT, standing=start, profile=PROFILE, route=route, coordinate=there
    )
    assert [node.node_id for node in vda_order.nodes] == nodes
    end = place(vda_order.nodes[-1])
    assert end.theta == (heading and pytest.approx(heading))
    assert [place(node).theta for node in vda_order.nodes[:-1]] == [None] * (len(nodes) - 1)
    assert coordinate is None or (end.x, end.y) == coordinate[:2]


@pytest.mark.clause("6.1.1/first")
def test_the_start_deviation_is_wide_even_for_precise_robots() -> None:
    exact = RobotProfile(map_id="hall", deviation_xy=0.0)
    start = locate(PLANT, state(mobile_robot_position=pose(0.1, 0.0)), exact)
    radii = [place(node).allowed_deviation_xy for node in to("B", start, profile=exact).nodes]
    assert [radius and radius.a for radius in radii] == [0.5, 0.0, 0.0]


@pytest.mark.clause("6.3/frame")
def test_poses_and_lengths_are_those_of_the_map() -> None:
    profile = RobotProfile(
        map_id="hall",
        deviation_xy=0.4,
        transforms={"hall": MapTransform(2.0, pi / 2, offset_x_m=10.0)},
        transforms_itself=False,
    )
    start = locate(PLANT, state(mobile_robot_position=pose(10.0, 0.0)), profile)
    assert start == Standing("A", on_point=True, pose=pose(10.0, 0.0))
    end = place(to("B", start, profile=profile).nodes[-1])
    assert [end.x, end.y, end.theta] == [pytest.approx(10.0), pytest.approx(4.0), pytest.approx(3 * pi / 4)]
    assert end.allowed_deviation_xy is not None
    assert end.allowed_deviation_xy.a == pytest.approx(0.8)
    assert end.map_id == "hall"


@pytest.mark.clause("6.3/frame")
def test_a_robot_that_transforms_itself_is_sent_the_plants_coordinates() -> None:
    turned = {"hall": MapTransform(2.0, pi / 2, offset_x_m=10.0)}
    profile = RobotProfile(map_id="hall", transforms=turned, transforms_itself=True)
    start = locate(PLANT, state(mobile_robot_position=pose(0.0, 0.0)), profile)
    end = place(to("B", start, profile=profile).nodes[-1])
    assert (end.x, end.y) == (2.0, 0.0)


@pytest.mark.clause("6.3/frame")
def test_before_its_factsheet_a_robot_on_a_transformed_map_is_not_located() -> None:
    profile = RobotProfile(map_id="hall", transforms={"hall": MapTransform(2.0)})
    with pytest.raises(NotLocatedError, match="has not arrived"):
        locate(PLANT, state(mobile_robot_position=pose(0.0, 0.0)), profile)


def test_nodes_use_the_maps_and_frames_of_their_points() -> None:
    roof = point("R", 6000, 0, properties={"vda5050:mapId": "roof"})
    plant = PlantModel(name="two", points=(*PLANT.points, roof), paths=(path("B R", 4000), *PLANT.paths))
    profile = RobotProfile(
        map_id="hall", transforms={"roof": MapTransform(offset_x_m=100.0)}, transforms_itself=False
    )
    start = locate(plant, state(mobile_robot_position=pose(2.0, 0.0)), profile)
    route = Router(plant).route("B", "R")
    vda_order = build_vda_order(
        "m", plant=plant, standing=start, profile=profile, route=route, coordinate=Coordinate(x=7.0, y=0.0)
    )
    places = [(place(node).map_id, place(node).x) for node in vda_order.nodes]
    assert places == [("hall", 2.0), ("roof", 106.0), ("roof", 107.0)]
    there = locate(plant, state(mobile_robot_position=pose(106.0, 0.0, map_id="roof")), profile)
    assert (there.point, there.on_point) == ("R", True)


def test_a_route_that_begins_elsewhere_is_refused() -> None:
    route = Router(PLANT).route("A", "C")
    with pytest.raises(ValueError, match="begins at 'A', the robot is at 'C'"):
        build_vda_order("m", plant=PLANT, standing=standing(4.0, 0.0), profile=PROFILE, route=route)


def test_a_vda_order_needs_a_route_or_a_coordinate() -> None:
    with pytest.raises(ValueError, match="a route or a coordinate"):
        build_vda_order("m", plant=PLANT, standing=standing(4.0, 0.0), profile=PROFILE)


def test_a_vda_order_survives_the_store_unchanged() -> None:
    vda_order = to("C", standing(1.3, 0.3), actions=OperationMap().actions("Load", {"a": "b"}))
    stored = vda_order.model_dump_json(by_alias=True, exclude_none=True)
    assert VdaOrder.model_validate_json(stored) == vda_order


def test_names_of_vda_orders() -> None:
    assert order_id("order-7", 0) == "order-7-0"
    assert order_id("order-7", 1, attempt=2) == "order-7-1~2"


def test_a_robot_is_on_its_last_node_if_it_is_near() -> None:
    assert standing(0.3, 0.0, last="A").on_point
    assert standing(2.1, 0.0, last="A") == Standing("B", on_point=True, pose=pose(2.1, 0.0))
    assert standing(3.1, 2.0, last="A") == Standing("C", on_point=False, pose=pose(3.1, 2.0))
    assert locate(PLANT, state(last_node_id="B"), PROFILE) == Standing("B", on_point=True, pose=None)


def test_an_untrusted_pose_is_ignored() -> None:
    lost = pose(0.0, 0.0).model_copy(update={"localized": False})
    with pytest.raises(NotLocatedError, match="set its initial pose"):
        locate(PLANT, state(mobile_robot_position=lost), PROFILE)
    assert locate(PLANT, state(last_node_id="C", mobile_robot_position=lost), PROFILE).point == "C"


def test_a_robot_on_another_map_is_not_located() -> None:
    elsewhere = pose(0.0, 0.0, map_id="cellar")
    with pytest.raises(NotLocatedError, match="on map 'cellar', but its orders are on map 'hall'"):
        locate(PLANT, state(mobile_robot_position=elsewhere), PROFILE)


def test_a_robot_whose_map_no_point_has_is_told_the_points_maps() -> None:
    there = point("A").model_copy(update={"properties": {"vda5050:mapId": "hall"}})
    plant = PlantModel(name="plant", points=(there,))
    elsewhere = pose(0.0, 0.0, map_id="floor1")
    with pytest.raises(NotLocatedError, match="on map 'floor1', but its orders are on map 'hall'"):
        locate(plant, state(mobile_robot_position=elsewhere), replace(PROFILE, map_id="floor1"))


def test_a_profile_uses_the_vehicles_properties() -> None:
    vehicle = Vehicle(
        name="v",
        properties={
            "vda5050:mapId": "cellar",
            "vda5050:deviationXY": "0.1",
            "vda5050:deviationTheta": "90",
            "vda5050:version": "2.0.0",
        },
    )
    profile = RobotProfile.of(vehicle, default_map_id="hall", transforms={})
    assert (profile.map_id, profile.deviation_xy) == ("cellar", 0.1)
    assert profile.deviation_theta == pytest.approx(pi / 2)
    assert RobotProfile.of(Vehicle(name="v"), default_map_id="hall", transforms={}) == PROFILE
