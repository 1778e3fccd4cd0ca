"""What a layout rules for a type of vehicles is in the orders, and what it forbids is not."""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import pi
from typing import Any

import pytest

from nena_order_service.fleet.feasibility import fitted_order, order_problem
from nena_order_service.fleet.order_execution import read_progress
from nena_order_service.fleet.position import RobotProfile, Standing
from nena_order_service.fleet.robot import Abilities
from nena_order_service.fleet.type_rules import TypeRules
from nena_order_service.fleet.vda_order import OperationMap, VdaOrder, build_vda_order
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.routing.router import RouteCosts, RouteFinder, Router
from nena_plant_formats import files, lif
from nena_shared.fleet_api.transport_order import Coordinate, Destination
from nena_shared.plant import MapTransform, PlantModel, Vehicle
from nena_shared.vda5050.action import ActionState, ActionStatus, BlockingType
from nena_shared.vda5050.order import Corridor, CorridorReferencePoint, Edge, Node, OrientationType
from nena_shared.vda5050.state import MobileRobotPosition, NodeState
from support.fleet_examples import factsheet, state
from support.lif_files import lif_2_0_of, robot_action, robot_edge, robot_node
from support.reference import reference_dir

RULED = (
    "orientation",
    "orientationType",
    "reachOrientationBeforeEntering",
    "maximumRotationSpeed",
    "maximumMobileRobotHeight",
    "minimumLoadHandlingDeviceHeight",
    "direction",
    "length",
    "corridor",
    "trajectory",
)
"""Fields of edges that a layout rules."""
ANGLE = 1e-4
"""rad; the examples have pi in five places."""


def listing(*fields: str, version: str = "3.0.0") -> Abilities:
    """Return the abilities of a robot that lists these optional fields."""
    return Abilities(factsheet(takes=(f"order.{each}" for each in fields), version=version))


ALL = (
    *(f"edges.{each}" for each in RULED),
    "nodes.nodePosition.theta",
    "nodes.nodePosition.allowedDeviationXY",
    "nodes.nodePosition.allowedDeviationTheta",
    "nodes.actions.actionDescriptor",
)


def vehicle(**properties: str) -> Vehicle:
    own = {
        "nena:vehicleType": "M.t",
        **{key.replace("_", ":", 1): value for key, value in properties.items()},
    }
    return Vehicle(name="V", properties=own)


def sent(
    plant: PlantModel,
    ends: str,
    *,
    heading: float = 0.0,
    operation: str = "MOVE",
    by: Vehicle | None = None,
    transforms: dict[str, MapTransform] | None = None,
    coordinate: Coordinate | None = None,
) -> VdaOrder:
    """Return the order by which a vehicle is sent from the first point to the last, as built."""
    by = by or vehicle()
    start, goal = ends.split()
    profile = RobotProfile.of(by, default_map_id="m", transforms=transforms or {})
    point = plant.point(start)
    map_id = point.map_id or "m"
    pose = MobileRobotPosition(x=point.x_m, y=point.y_m, theta=heading, map_id=map_id, localized=True)
    return build_vda_order(
        "m",
        plant=plant,
        standing=Standing(start, on_point=True, pose=pose),
        profile=profile,
        route=None if coordinate else Router(plant).route(start, goal, vehicle=by),
        coordinate=coordinate,
        actions=OperationMap().actions(operation, {}),
        rules=TypeRules.of(by, plant),
    )


def plant_of(*parts: dict[str, Any]) -> PlantModel:
    return lif.read(lif_2_0_of(*parts)).model


def row(*, at: dict[str, Any] | None = None, along: dict[str, Any] | None = None) -> PlantModel:
    """Make A, B and C in a row, with rules at B and on the edge that leads there."""
    return plant_of(
        robot_node("A"),
        robot_node("B", 3, 0, **(at or {})),
        robot_node("C", 6, 0),
        robot_edge("A B", **(along or {})),
        robot_edge("B C"),
    )


def first_edge(model: PlantModel, **how: Any) -> Edge:
    return sent(model, "A B", **how).edges[0]


def node_of(vda_order: VdaOrder, name: str) -> Node:
    return next(each for each in vda_order.nodes if each.node_id == name)


def deviation(node: Node) -> tuple[float, ...]:
    assert node.node_position
    ellipse = node.node_position.allowed_deviation_xy
    assert ellipse
    return ellipse.a, ellipse.b, ellipse.theta


def example(name: str) -> PlantModel:
    (file,) = reference_dir("lif-2.0").glob(f"{name}-*.lif.json")
    return files.read(file.read_bytes()).model


def expected(name: str) -> Any:
    (file,) = reference_dir("lif-2.0").glob(f"{name}.json")
    return json.loads(file.read_bytes())


def missing(wanted: Any, found: Any, where: str = "") -> Iterator[str]:
    """Yield where something is not as wanted; numbers of the sequence and IDs of actions do not count."""
    if isinstance(wanted, dict):
        for key, value in wanted.items():
            if key not in ("sequenceId", "actionId"):
                yield from missing(value, (found or {}).get(key), f"{where}.{key}")
    elif isinstance(wanted, list):
        if len(wanted) != len(found or ()):
            yield f"{where}: {len(wanted)} expected"
        for one, other in zip(wanted, found or (), strict=False):
            yield from missing(one, other, where)
    elif isinstance(wanted, float) and found is not None:
        if abs(wanted - found) > ANGLE:
            yield f"{where}: {wanted} expected"
    elif wanted != found:
        yield f"{where}: {wanted} expected"


def differences(name: str, vda_order: VdaOrder) -> list[str]:
    """Return how the order that a robot with all abilities is sent differs from that of the authors."""
    robot = listing(*ALL)
    made = fitted_order(vda_order, robot)
    assert order_problem(made, robot) is None
    content = made.model_dump(mode="json", by_alias=True, exclude_none=True)
    found: list[str] = []
    for parts, key in (("nodes", "nodeId"), ("edges", "edgeId")):
        known = {each[key]: each for each in content[parts]}
        for part in expected(name).get(parts, ()):
            found += missing(part, known.get(part[key]), part[key])
    return found


def of_series_1(**properties: str) -> Vehicle:
    return vehicle(nena_vehicleType="Manufacturer_A.Series_1", **properties)


def test_a_corridor_is_requested_or_omitted_as_in_example_28_1() -> None:
    name = "28.1-corridor-sent-in-one-order-omitted-in-another.order"
    narrow = sent(example("28"), "N1 N2", by=of_series_1(vda5050_corridorWidth="0.4"))
    assert differences(f"{name}-a", narrow) == []
    without = sent(example("28"), "N1 N2", by=of_series_1(vda5050_corridorWidth="0"))
    assert differences(f"{name}-b", without) == []
    assert without.edges[0].corridor is None


def test_an_edge_is_driven_as_the_robot_stands_as_in_example_28_2() -> None:
    """Where the robot stands needs no heading: the edge says with which one it is entered."""
    name = "28.2-forward-vs-rotated-and-backward-traversal-of-the-same-edge.order"
    forward = sent(example("28"), "N1 N2", heading=0.4, by=of_series_1())
    backward = sent(example("28"), "N1 N2", heading=2.9, by=of_series_1())
    assert differences(f"{name}-a", forward) == ["N1.nodePosition.theta: 0.0 expected"]
    assert differences(f"{name}-b", backward) == ["N1.nodePosition.theta: 3.141592653589793 expected"]
    assert forward.edges[0].reach_orientation_before_entering is True


def test_a_feasible_action_is_sent_if_ordered_as_in_example_28_3() -> None:
    name = "28.3-feasible-action-sent-in-one-order-omitted-in-another.order"
    charging = sent(example("28"), "N1 N2", operation="Charge", by=of_series_1())
    assert differences(f"{name}-a", charging) == []
    assert differences(f"{name}-b", sent(example("28"), "N1 N2", by=of_series_1())) == []


def test_a_missing_heading_comes_from_a_coordinate_as_in_example_28_4() -> None:
    """A coordinate is no node of the layout, so its node has an ID of its own."""
    name = "28.4-theta-not-encoded-on-a-node-calculated-at-runtime.order"
    there = sent(example("28"), "N1 N2", coordinate=Coordinate(x=11.0, y=0.0, theta=1.5), by=of_series_1())
    goal = there.nodes[-1]
    assert goal.node_id == "goal:m"
    named = there.model_copy(update={"nodes": (goal.model_copy(update={"node_id": "N2"}),), "edges": ()})
    robot = fitted_order(named, listing(*ALL)).model_dump(mode="json", by_alias=True, exclude_none=True)
    assert list(missing(expected(name)["nodes"][0], robot["nodes"][0])) == []


def test_orders_for_each_example_can_be_sent_in_each_version() -> None:
    tried = 0
    for file in sorted(reference_dir("lif-2.0").glob("*.lif.json")):
        model = files.read(file.read_bytes()).model
        for path in model.paths:
            for use in path.vehicle_types:
                by = vehicle(nena_vehicleType=use.vehicle_type_id)
                made = sent(model, f"{path.source} {path.destination}", by=by)
                for version in ("2.0.0", "2.1.0", "3.0.0"):
                    robot = listing(*ALL, version=version)
                    assert order_problem(fitted_order(made, robot), robot) is None, (
                        file.name,
                        path.name,
                        version,
                    )
                tried += 1
    assert tried > 60


def test_required_actions_are_sent_and_feasible_ones_are_not() -> None:
    beep = robot_action("beep", actionParameters=[{"key": "times", "value": 2}], actionDescriptor="d")
    rules = {"requiredActions": [beep], "feasibleActions": [robot_action("pick")]}
    made = sent(row(at=rules, along=rules), "A C")
    (at_b,) = node_of(made, "B").actions
    (on_edge,) = made.edges[0].actions
    for each in (at_b, on_edge):
        assert (each.action_type, each.blocking_type, each.action_descriptor) == (
            "beep",
            BlockingType.SOFT,
            "d",
        )
        assert each.parameter("times") == 2
    assert at_b.action_id != on_edge.action_id
    assert [each.action_id for each in made.actions] == [on_edge.action_id, at_b.action_id]
    assert made.final_action_ids == frozenset()


def test_required_actions_are_not_repeated_at_the_start_node() -> None:
    model = row(at={"requiredActions": [robot_action("beep")]})
    assert sent(model, "B C").actions == ()
    assert [each.action_type for each in sent(model, "A B").nodes[-1].actions] == ["beep"]


def test_an_ordered_and_required_action_is_sent_once_as_in_the_layout() -> None:
    fixed = [{"key": "loadType", "value": "EUR"}, {"key": "side", "value": ["left"]}]
    pick = robot_action("pick", blockingType="SINGLE", actionParameters=fixed)
    made = sent(row(at={"requiredActions": [robot_action("beep"), pick]}), "A B", operation="pick")
    beep, ordered = made.nodes[-1].actions
    assert (beep.action_type, ordered.action_type, ordered.blocking_type) == (
        "beep",
        "pick",
        BlockingType.SINGLE,
    )
    assert {each.key: each.value for each in ordered.action_parameters} == {
        "stationType": "point",
        "loadType": "EUR",
        "side": ["left"],
    }


def test_a_required_action_en_route_does_not_start_the_operation() -> None:
    made = sent(row(at={"requiredActions": [robot_action("beep")]}), "A C", operation="pick")
    beep, pick = made.actions
    ahead = tuple(
        NodeState(node_id=each.node_id, sequence_id=each.sequence_id, released=True)
        for each in made.nodes[2:]
    )

    def operating(action_id: str) -> bool:
        running = ActionState(action_id=action_id, action_status=ActionStatus.RUNNING)
        return read_progress(state(order_id="m", node_states=ahead, action_states=(running,)), made).operating

    assert not operating(beep.action_id)
    assert operating(pick.action_id)


def test_a_point_that_forbids_the_action_is_not_a_destination() -> None:
    stations = {"stationId": "S", "interactionNodeIds": ["B", "C"]}
    near = robot_node("B", 3, 0, "M.u", feasibleActions=[robot_action("drop")])
    near["mobileRobotTypeNodeProperties"] += robot_node("B", forbiddenActionTypes=["drop"])[
        "mobileRobotTypeNodeProperties"
    ]
    model = plant_of(
        robot_node("A", 0, 0, "M.t M.u"),
        near,
        robot_node("C", 6, 0, "M.t M.u", feasibleActions=[robot_action("drop")]),
        robot_edge("A B", "M.t M.u"),
        robot_edge("B C", "M.t M.u"),
        stations,
    )
    finder = RouteFinder(model, Router(model))
    drop = [Destination(location_name="S", operation="drop")]
    other = vehicle(nena_vehicleType="M.u")
    assert finder.find("A", drop, vehicle=vehicle()).legs[-1].points[-1] == "C"
    assert finder.find("A", drop, vehicle=other).legs[-1].points[-1] == "B"
    assert RouteCosts(model, finder).cost_of_route("A", drop, vehicle=vehicle()).complete == 6000
    assert RouteCosts(model, finder).cost_of_route("A", drop, vehicle=other).complete == 3000
    with pytest.raises(NoRouteError):
        finder.find("A", drop, vehicle=vehicle(), avoid=["C"])
    park = [Destination(location_name="B", operation="PARK")]
    assert finder.find("A", park, vehicle=vehicle()).cost == 3000
    lowering = RouteFinder(model, Router(model), action_type=OperationMap({"PARK": "drop"}).action_type)
    with pytest.raises(NoRouteError):
        lowering.find("A", park, vehicle=vehicle())


@pytest.mark.parametrize(
    ("bounds", "ellipse"),
    [
        ({"aMaximum": 0.4, "bMaximum": 0.25, "theta": 1.0}, (0.4, 0.25, 1.0)),
        ({"aMinimum": 0.8, "aMaximum": 0.9}, (0.8, 0.5, 0.0)),
        ({"aMaximum": 0.3, "bMaximum": 0.3, "theta": 1.0}, (0.3, 0.3, 0.0)),
    ],
)
def test_the_deviation_respects_its_bounds(bounds: dict[str, float], ellipse: tuple[float, ...]) -> None:
    assert deviation(node_of(sent(row(at={"allowedDeviationXY": bounds}), "A C"), "B")) == ellipse


def test_the_start_keeps_a_deviation_that_the_robot_is_within() -> None:
    narrow = row(at={"allowedDeviationXY": {"aMaximum": 0.1, "bMaximum": 0.1}})
    assert deviation(sent(narrow, "B C").nodes[0])[0] == 0.5


@pytest.mark.parametrize(
    ("heading", "orientation"), [(0.1, 0.0), (3.0, pi), (-3.0, pi), (pi / 2, 0.0), (pi / 2 + 0.1, pi)]
)
def test_the_orientation_with_the_least_turning_is_chosen(heading: float, orientation: float) -> None:
    both = row(along={"mobileRobotOrientations": [0.0, pi]})
    assert first_edge(both, heading=heading).orientation == pytest.approx(orientation)


def test_the_final_heading_counts_too() -> None:
    both = row(along={"mobileRobotOrientations": [0.0, pi]}, at={"theta": 3.0})
    assert first_edge(both, heading=1.5).orientation == pytest.approx(pi)
    last = sent(both, "A B").nodes[-1].node_position
    assert last
    assert last.theta == 3.0


def test_a_vehicle_that_cannot_reverse_drives_forwards_and_not_where_only_backwards_is_allowed() -> None:
    forwards_only = vehicle().model_copy(update={"max_reverse_velocity_mm_s": 0})
    both = row(along={"mobileRobotOrientations": [pi, 0.0]})
    assert first_edge(both, heading=pi, by=forwards_only).orientation == 0.0
    with pytest.raises(NoRouteError):
        first_edge(row(along={"mobileRobotOrientations": [pi, 3.0]}), by=forwards_only)


def test_orientations_of_the_plant_are_rotated_to_the_map() -> None:
    turned = {"m": MapTransform(rotation_rad=pi / 2, scale=2.0)}
    rules = {
        "mobileRobotOrientations": [1.0],
        "orientationType": "GLOBAL",
        "corridor": {"maximumLeftWidth": 1, "maximumRightWidth": 0.5, "corridorReferencePoint": "CONTOUR"},
        "physicalLineGuidedProperty": {"direction": "LEFT", "length": 4.0},
    }
    edge = first_edge(row(along=rules), transforms=turned)
    assert edge.orientation == pytest.approx(1.0 + pi / 2)
    assert edge.orientation_type is OrientationType.GLOBAL
    assert edge.corridor == Corridor(
        left_width=2.0, right_width=1.0, corridor_reference_point=CorridorReferencePoint.CONTOUR
    )
    assert (edge.direction, edge.length) == ("LEFT", 8.0)


def test_a_trajectory_is_sent_in_the_frame_of_the_map() -> None:
    curve = {
        "degree": 2,
        "knotVector": [0, 0, 0, 1, 1, 1],
        "controlPoints": [{"x": 0, "y": 0}, {"x": 1.5, "y": 2, "weight": 0.5}, {"x": 3, "y": 0}],
    }
    edge = first_edge(row(along={"trajectory": curve, "mobileRobotOrientations": [0.0, pi]}), heading=0.9)
    assert edge.trajectory
    assert [(each.x, each.y, each.weight) for each in edge.trajectory.control_points] == [
        (0, 0, 1),
        (1.5, 2, 0.5),
        (3, 0, 1),
    ]
    assert edge.orientation == 0.0
    moved = first_edge(row(along={"trajectory": curve}), transforms={"m": MapTransform(offset_x_m=1.0)})
    assert moved.trajectory
    assert moved.trajectory.control_points[0].x == 1.0


@pytest.mark.parametrize(("off", "is_sent"), [(0.009, True), (0.011, False)])
def test_a_trajectory_that_misses_its_nodes_is_not_sent(off: float, *, is_sent: bool) -> None:
    curve = {"knotVector": [0, 0, 1, 1], "controlPoints": [{"x": 0, "y": 0}, {"x": 3, "y": off}]}
    assert (first_edge(row(along={"trajectory": curve})).trajectory is not None) is is_sent


@pytest.mark.parametrize("knots", [(), (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 2.0, 2.0)])
def test_an_invalid_trajectory_in_own_json_is_not_sent(knots: tuple[float, ...]) -> None:
    """NeNa's JSON is read as it is; LIF is repaired when it is read."""
    curve = {"knotVector": [0, 0, 1, 1], "controlPoints": [{"x": 0, "y": 0}, {"x": 3, "y": 0}]}
    content = json.loads(row(along={"trajectory": curve, "mobileRobotOrientations": [0.0]}).to_json())
    content["paths"][0]["vehicleTypes"][0]["trajectory"]["knotVector"] = knots
    sent_curve = first_edge(PlantModel.from_json(json.dumps(content))).trajectory
    usable = len(knots) == 4 and knots == tuple(sorted(knots))
    assert (sent_curve.knot_vector if sent_curve else None) == ((0.0, 0.0, 1.0, 1.0) if usable else None)


def test_other_edge_fields_of_the_layout_are_sent() -> None:
    rules = {
        "reachOrientationBeforeEntering": False,
        "maximumRotationSpeed": 0.5,
        "minimumLoadHandlingDeviceHeight": 0.2,
        "maximumMobileRobotHeight": 2.0,
    }
    edge = first_edge(row(along=rules))
    assert edge.reach_orientation_before_entering is False
    assert (edge.maximum_rotation_speed, edge.minimum_load_handling_device_height) == (0.5, 0.2)
    assert (edge.maximum_mobile_robot_height, edge.orientation, edge.orientation_type) == (2.0, None, None)


FULL = row(
    along={
        "mobileRobotOrientations": [1.0],
        "maximumRotationSpeed": 0.5,
        "minimumLoadHandlingDeviceHeight": 0.2,
        "maximumMobileRobotHeight": 2.0,
        "corridor": {"maximumLeftWidth": 1, "maximumRightWidth": 1},
        "physicalLineGuidedProperty": {"direction": "LEFT", "length": 3.5},
    }
)


@pytest.mark.parametrize("field", [each for each in RULED if each != "trajectory"])
def test_only_listed_fields_are_sent(field: str) -> None:
    content = fitted_order(sent(FULL, "A B"), listing(f"edges.{field}")).edges[0]
    given = content.model_dump(mode="json", by_alias=True, exclude_none=True)
    assert given.keys() & set(RULED) == {field}


def test_robots_without_a_factsheet_are_not_sent_layout_fields() -> None:
    for abilities in (None, listing()):
        given = (
            fitted_order(sent(FULL, "A B"), abilities).edges[0].model_dump(by_alias=True, exclude_none=True)
        )
        assert given.keys() & set(RULED) == set()


def test_a_required_length_is_taken_from_the_layout() -> None:
    robot = Abilities(factsheet(demands=("order.edges.length",)))
    assert [each.length for each in fitted_order(sent(FULL, "A C"), robot).edges] == [3.5, 3.0]


def test_a_vehicle_without_a_type_uses_rules_common_to_all_types() -> None:
    two = robot_edge("A B", "M.t", maximumRotationSpeed=0.5)
    two["mobileRobotTypeEdgeProperties"] += robot_edge("A B", "M.u", maximumRotationSpeed=0.5)[
        "mobileRobotTypeEdgeProperties"
    ]
    nodes = (robot_node("A", 0, 0, "M.t M.u"), robot_node("B", 3, 0, "M.t M.u"))
    nameless = Vehicle(name="V")
    assert first_edge(plant_of(*nodes, two), by=nameless).maximum_rotation_speed == 0.5
    two["mobileRobotTypeEdgeProperties"][1]["maximumRotationSpeed"] = 0.4
    assert first_edge(plant_of(*nodes, two), by=nameless).maximum_rotation_speed is None
    assert first_edge(plant_of(*nodes, two)).maximum_rotation_speed == 0.5
