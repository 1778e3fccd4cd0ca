"""A message is made to fit a factsheet without changing its meaning."""

from __future__ import annotations

from math import pi

import hypothesis.strategies as st
import pytest
from hypothesis import given

from nena_order_service.fleet.feasibility import fitted_action, fitted_order, order_problem
from nena_order_service.fleet.robot import Abilities
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import (
    ActionParameterDescription,
    ActionScope,
    MobileRobotAction,
    ValueDataType,
)
from nena_shared.vda5050.order import NodePosition
from support.fleet import make_action, make_vda_order
from support.fleet_examples import factsheet as example

pytestmark = pytest.mark.clause("7.10", "7.1.1")

MISSION = make_vda_order("m1", "A", "B", operation="pick")


def abilities(
    *actions: MobileRobotAction,
    takes: tuple[str, ...] = (),
    demands: tuple[str, ...] = (),
    version: str = "2.1.0",
) -> Abilities:
    takes, demands = (tuple(f"order.{each}" for each in fields) for fields in (takes, demands))
    return Abilities(example(actions=actions, takes=takes, demands=demands, version=version))


def pick(**kinds: ValueDataType) -> MobileRobotAction:
    return MobileRobotAction(
        action_type="pick",
        action_scopes=(ActionScope.NODE,),
        action_parameters=tuple(
            ActionParameterDescription(key=key, value_data_type=kind, is_optional=True)
            for key, kind in kinds.items()
        ),
        pause_allowed=False,
        cancel_allowed=False,
    )


def positions(vda_order: VdaOrder) -> list[NodePosition]:
    return [node.node_position for node in vda_order.nodes if node.node_position]


def headed(node_id: str) -> VdaOrder:
    """Return the VDA order with a heading at its end, which is called ``node_id``."""
    end = MISSION.nodes[1]
    assert end.node_position is not None
    place = end.node_position.model_copy(update={"theta": 1.0, "allowed_deviation_theta": 0.1})
    last = end.model_copy(update={"node_id": node_id, "node_position": place})
    return MISSION.model_copy(update={"nodes": (MISSION.nodes[0], last)})


def test_nothing_is_removed_for_a_robot_without_lists() -> None:
    assert fitted_order(headed("B"), abilities()) == headed("B")


def test_fields_that_the_robot_does_not_list_are_left_out() -> None:
    made = fitted_order(headed("B"), abilities(takes=("edges.length",)))

    assert [each.allowed_deviation_xy for each in positions(made)] == [None, None]
    assert (positions(made)[1].theta, positions(made)[1].allowed_deviation_theta) == (None, None)
    assert made.actions[0].action_descriptor is None
    assert [(each.x, each.y) for each in positions(made)] == [(0.0, 0.0), (1.0, 0.0)]


def test_fields_that_the_robot_lists_stay() -> None:
    listed = abilities(
        takes=(
            "nodes.nodePosition.theta",
            "nodes.nodePosition.allowedDeviationXY",
            "nodes.nodePosition.allowedDeviationTheta",
            "nodes.actions.actionDescriptor",
        )
    )

    assert fitted_order(headed("B"), listed) == headed("B")


@pytest.mark.parametrize(
    "listed", ["nodes.nodePosition.allowedDeviationXY.a", "nodes.nodePosition.allowedDeviationXY"]
)
def test_a_field_is_listed_directly_or_through_a_part(listed: str) -> None:
    assert positions(fitted_order(MISSION, abilities(takes=(listed,))))[0].allowed_deviation_xy is not None


def test_a_requested_heading_is_refused_rather_than_dropped() -> None:
    robot = abilities(takes=("edges.length",))
    made = fitted_order(headed("goal:m1"), robot)

    assert positions(made)[1].theta == 1.0
    assert str(order_problem(made, robot)) == (
        "its factsheet does not list headings, so coordinates cannot have one"
    )


def test_required_headings_are_filled_without_constraining_the_robot() -> None:
    robot = abilities(
        demands=("nodes.nodePosition.theta", "nodes.nodePosition.allowedDeviationTheta"),
        takes=("nodes.nodePosition.allowedDeviationXY",),
    )
    made = fitted_order(headed("B"), robot)

    assert [(each.theta, each.allowed_deviation_theta) for each in positions(made)] == [(0.0, pi), (1.0, 0.1)]
    assert order_problem(made, robot) is None


def test_a_required_heading_without_a_deviation_cannot_be_filled() -> None:
    robot = abilities(demands=("nodes.nodePosition.theta",))

    assert str(order_problem(fitted_order(MISSION, robot), robot)) == (
        "its factsheet requires the field 'nodes.nodePosition.theta', which cannot be filled here"
    )


def test_required_edge_fields_are_filled_neutrally() -> None:
    robot = abilities(
        demands=(
            "edges.length",
            "edges.maximumSpeed",
            "edges.reachOrientationBeforeEntering",
            "edges.edgeDescriptor",
            "nodes.nodeDescriptor",
            "nodes.actions.actionDescriptor",
        )
    )
    made = fitted_order(MISSION, robot)
    (edge,) = made.edges

    assert (edge.length, edge.maximum_speed) == (1.0, 1.2), "the robot's own speed"
    assert (edge.reach_orientation_before_entering, edge.edge_descriptor) == (False, "A-B")
    assert [node.node_descriptor for node in made.nodes] == ["A", "B"]
    assert made.actions[0].action_descriptor == "pick"
    assert order_problem(made, robot) is None


def limited(speed: float) -> VdaOrder:
    """Return the VDA order with a speed limit on its edge."""
    edges = tuple(each.model_copy(update={"maximum_speed": speed}) for each in MISSION.edges)
    return MISSION.model_copy(update={"edges": edges})


@pytest.mark.parametrize(
    ("robot", "speed", "sent"),
    [
        (abilities(takes=("edges.maximumSpeed",)), 0.5, 0.5),
        (abilities(demands=("edges.maximumSpeed",)), 0.5, 0.5),
        (abilities(takes=("edges.maximumSpeed",)), 1.2, None),
        (abilities(takes=("edges.length",)), 0.5, None),
        (abilities(), 0.5, None),
        (None, 0.5, None),
    ],
    ids=["listed", "demanded", "no slower than the robot", "not listed", "silent", "no factsheet"],
)
def test_a_speed_limit_is_sent_to_robots_that_list_it(
    robot: Abilities | None, speed: float, sent: float | None
) -> None:
    made = fitted_order(limited(speed), robot)

    assert [each.maximum_speed for each in made.edges] == [sent]
    assert fitted_order(made, robot) == made


def test_an_unknown_required_speed_is_a_problem() -> None:
    robot = abilities(demands=("edges.maximumRotationSpeed",))

    assert "edges.maximumRotationSpeed" in str(order_problem(fitted_order(MISSION, robot), robot))


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (ValueDataType.NUMBER, "1.5", 1.5),
        (ValueDataType.INTEGER, "3", 3),
        (ValueDataType.BOOL, "True", True),
        (ValueDataType.STRING, "1.5", "1.5"),
        (ValueDataType.OBJECT, '{"a": 1}', {"a": 1}),
        (ValueDataType.ARRAY, "[1, 2]", [1, 2]),
        (ValueDataType.NUMBER, "high", "high"),
        (ValueDataType.NUMBER, "nan", "nan"),
        (ValueDataType.BOOL, "perhaps", "perhaps"),
        (ValueDataType.ARRAY, "[1,", "[1,"),
        (ValueDataType.ARRAY, "[" * 100_000, "[" * 100_000),
        (ValueDataType.ARRAY, "1", "1"),
        (ValueDataType.STRING, 3, "3"),
        (ValueDataType.STRING, 1.5, "1.5"),
        (ValueDataType.STRING, True, "true"),
    ],
)
def test_text_becomes_the_declared_type(kind: ValueDataType, text: float | str, value: object) -> None:
    robot = abilities(pick(height=kind))
    fitted = fitted_action(make_action("pick", height=text), robot).parameter("height")
    assert (type(fitted), fitted) == (type(value), value)


def test_added_parameters_are_sent_only_to_robots_that_list_them() -> None:
    action = make_action("pick", stationType="x", loadType="x", height="x")

    def keys(robot: Abilities) -> list[str]:
        return [each.key for each in fitted_action(action, robot).action_parameters]

    assert keys(abilities()) == keys(abilities(pick())) == ["stationType", "loadType", "height"]
    assert keys(abilities(pick(loadType=ValueDataType.STRING))) == ["loadType", "height"]


FIELDS = (
    "nodes.nodePosition.theta",
    "nodes.nodePosition.allowedDeviationXY",
    "nodes.nodePosition.allowedDeviationTheta",
    "nodes.nodeDescriptor",
    "nodes.actions.actionDescriptor",
    "edges.length",
    "edges.maximumSpeed",
    "edges.maximumRotationSpeed",
    "edges.reachOrientationBeforeEntering",
)


@given(
    supports=st.dictionaries(st.sampled_from(FIELDS), st.sampled_from(["takes", "demands"])),
    goal=st.sampled_from(["B", "goal:m1"]),
)
def test_fitting_twice_changes_nothing_and_requested_headings_stay(
    supports: dict[str, str], goal: str
) -> None:
    robot = abilities(
        takes=tuple(field for field, support in supports.items() if support == "takes"),
        demands=tuple(field for field, support in supports.items() if support == "demands"),
    )
    asked = headed(goal)
    made = fitted_order(asked, robot)

    assert fitted_order(made, robot) == made
    assert made.action_ids == asked.action_ids
    assert [(each.node_id, each.sequence_id, each.released) for each in made.nodes] == [
        (each.node_id, each.sequence_id, each.released) for each in asked.nodes
    ]
    assert [(each.x, each.y, each.map_id) for each in positions(made)] == [
        (each.x, each.y, each.map_id) for each in positions(asked)
    ]
    if goal != "B":
        assert positions(made)[1].theta == positions(asked)[1].theta


@pytest.mark.clause("6.2.3/pick")
@pytest.mark.parametrize("given", ["lhd", "loadHandlingDevice"])
@pytest.mark.parametrize(
    ("listed", "version", "sent"),
    [
        ("lhd", "3.0.1", "lhd"),
        ("loadHandlingDevice", "2.1.0", "loadHandlingDevice"),
        (None, "2.1.0", "lhd"),
        (None, "3.0.0", "lhd"),
        (None, "3.0.1", "loadHandlingDevice"),
    ],
)
def test_the_load_handling_device_has_the_listed_key_or_that_of_the_version(
    given: str, listed: str | None, version: str, sent: str
) -> None:
    kinds = {listed: ValueDataType.STRING} if listed else {}
    robot = abilities(pick(**kinds), version=version)
    (parameter,) = fitted_action(
        make_action("pick", "i1", BlockingType.NONE, **{given: "fork"}), robot
    ).action_parameters
    assert (parameter.key, parameter.value) == (sent, "fork")
