"""What a factsheet says against a message, before it is sent."""

from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.fleet import MissionFailed, MissionFinished
from nena_order_service.fleet.fitness import fitted, instant_action_problem, order_problem
from nena_shared.vda5050.action import Action, ActionParameter, BlockingType
from nena_shared.vda5050.factsheet import (
    ActionParameterDescription,
    ActionScope,
    Factsheet,
    MaximumArrayLengths,
    MaximumStringLengths,
    MobileRobotAction,
    OptionalParameter,
    Support,
    ValueDataType,
)
from support.fleet import Bench, make_mission
from support.fleet_examples import factsheet as example

pytestmark = pytest.mark.clause("7.10")

PICK = MobileRobotAction(
    action_type="pick",
    action_scopes=(ActionScope.NODE,),
    blocking_types=(BlockingType.HARD,),
    action_parameters=(
        ActionParameterDescription(key="height", value_data_type=ValueDataType.NUMBER, is_optional=True),
    ),
    pause_allowed=False,
    cancel_allowed=False,
)
MISSION = make_mission("m1", "A", "B", operation="pick")


def sheet(
    *actions: MobileRobotAction,
    fields: tuple[OptionalParameter, ...] = (),
    arrays: dict[str, Any] | None = None,
    strings: dict[str, Any] | None = None,
) -> Factsheet:
    made = example()
    limits = made.protocol_limits.model_copy(
        update={
            "maximum_array_lengths": MaximumArrayLengths.model_validate(arrays or {}),
            "maximum_string_lengths": MaximumStringLengths(**(strings or {})),
        }
    )
    features = made.protocol_features.model_copy(
        update={"mobile_robot_actions": actions, "optional_parameters": fields}
    )
    return made.model_copy(update={"protocol_limits": limits, "protocol_features": features})


def demanded(name: str) -> tuple[OptionalParameter, ...]:
    return (OptionalParameter(parameter=name, support=Support.REQUIRED),)


def changed(**changes: Any) -> MobileRobotAction:
    return PICK.model_copy(update=changes)


@pytest.mark.parametrize(
    "factsheet",
    [
        sheet(),
        sheet(PICK),
        sheet(PICK, arrays={"order.nodes": 2, "order.edges": 1, "node.actions": 1}),
        sheet(arrays={"order.nodes": 0}),
        sheet(fields=demanded("order.nodes.nodePosition")),
        sheet(fields=demanded("nodes.nodePosition.allowedDeviationXY")),
        sheet(strings={"maximum_id_length": 7}),
    ],
)
def test_a_mission_that_fits_is_taken(factsheet: Factsheet) -> None:
    assert order_problem(MISSION, factsheet) is None


@pytest.mark.clause("7.1.1")
@pytest.mark.parametrize(
    ("factsheet", "problem"),
    [
        (sheet(arrays={"order.nodes": 1}), "allows 1 nodes, not 2"),
        (sheet(changed(action_type="drop")), "does not list the action 'pick'"),
        (sheet(changed(action_scopes=(ActionScope.INSTANT,))), "not for NODE"),
        (sheet(changed(blocking_types=(BlockingType.SOFT,))), "for the blocking types SOFT"),
        (
            sheet(
                changed(
                    action_parameters=(
                        ActionParameterDescription(
                            key="height", value_data_type=ValueDataType.NUMBER, is_optional=False
                        ),
                    )
                )
            ),
            "needs the parameter 'height'",
        ),
        (sheet(fields=demanded("order.nodes.nodePosition.theta")), "which not every node has"),
        (sheet(fields=demanded("order.edges.trajectory")), "which orders here never have"),
        (sheet(strings={"maximum_id_length": 1}), "longer than 1"),
        (sheet(strings={"id_numerical_only": True}), "digits only"),
    ],
)
def test_a_mission_that_does_not_fit_is_named(factsheet: Factsheet, problem: str) -> None:
    assert problem in (order_problem(MISSION, factsheet) or "")


@pytest.mark.clause("7.1.1")
def test_fields_that_the_robot_does_not_list_are_left_out() -> None:
    lists_one = sheet(
        fields=(
            OptionalParameter(
                parameter="order.nodes.nodePosition.allowedDeviationTheta", support=Support.SUPPORTED
            ),
        )
    )

    nodes = fitted(MISSION, lists_one).nodes
    assert all(each.node_position and each.node_position.allowed_deviation_xy is None for each in nodes)
    assert fitted(MISSION, sheet()) is MISSION


@pytest.mark.clause("6.2.1/fleet")
def test_an_instant_action_is_looked_at_as_well() -> None:
    pick = Action(
        action_type="pick",
        action_id="i",
        blocking_type=BlockingType.NONE,
        action_parameters=(ActionParameter(key="height", value=1.0),),
    )
    everywhere = sheet(changed(action_scopes=(ActionScope.NODE, ActionScope.INSTANT)))

    assert instant_action_problem(pick, everywhere) is None
    assert "not for INSTANT" in (instant_action_problem(pick, sheet(PICK)) or "")
    cancel = pick.model_copy(update={"action_type": "cancelOrder"})
    assert instant_action_problem(cancel, sheet(PICK)) is None


def test_an_order_that_the_robot_cannot_take_is_never_sent() -> None:
    bench = Bench().online()
    bench.take(bench.fleet.on_factsheet(bench.robot.key, sheet(changed(action_type="drop")), bench.now))

    bench.start(MISSION)

    assert bench.orders_sent() == []
    (failed,) = bench.told(MissionFailed)
    assert failed.reason == ("the robot cannot take the order: its factsheet does not list the action 'pick'")
    bench.start(make_mission("m2", "A", "B"))
    bench.run()
    assert [each.mission_id for each in bench.told(MissionFinished)] == ["m2"]
