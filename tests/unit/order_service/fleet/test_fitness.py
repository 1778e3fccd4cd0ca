"""What a factsheet forbids in a message, before it is sent."""

from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.feasibility import instant_action_problem, order_problem
from nena_order_service.fleet.outputs import (
    InstantActionEnded,
    PublishInstantActions,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.robot import Abilities
from nena_shared.vda5050.action import ActionParameter, ActionStatus, BlockingType
from nena_shared.vda5050.factsheet import (
    ActionParameterDescription,
    ActionScope,
    Factsheet,
    MobileRobotAction,
    ValueDataType,
)
from support.fleet import Bench, make_action, make_vda_order
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
MISSION = make_vda_order("m1", "A", "B", operation="pick")


def sheet(*actions: MobileRobotAction, **content: Any) -> Factsheet:
    return example(actions=actions, **content)


def changed(**changes: Any) -> MobileRobotAction:
    return PICK.model_copy(update=changes)


@pytest.mark.parametrize(
    "factsheet",
    [
        sheet(),
        sheet(PICK),
        sheet(PICK, arrays={"order.nodes": 2, "order.edges": 1, "node.actions": 1}),
        sheet(arrays={"order.nodes": 0}),
        sheet(arrays={"state.nodeStates": 1, "state.edgeStates": 1, "state.actionStates": 1}),
        sheet(demands=("order.nodes.nodePosition",)),
        sheet(demands=("order.nodes.nodePosition.mapId",)),
        sheet(demands=("nodes.nodePosition.allowedDeviationXY",)),
        sheet(demands=("state.loads",)),
        sheet(demands=("order.edges.actions.actionDescriptor",)),
        sheet(strings={"maximum_id_length": 7}),
        sheet(strings={"maximum_message_length": 10_000}),
        sheet(changed(action_scopes=(ActionScope.EDGE,)), PICK),
    ],
)
def test_a_vda_order_that_fits_is_taken(factsheet: Factsheet) -> None:
    assert order_problem(MISSION, Abilities(factsheet)) is None


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
            "requires the parameter 'height'",
        ),
        (sheet(demands=("order.nodes.nodePosition.theta",)), "which cannot be filled here"),
        (sheet(demands=("order.edges.trajectory",)), "which cannot be filled here"),
        (sheet(demands=("order.orderDescription",)), "which cannot be filled here"),
        (sheet(strings={"maximum_id_length": 1}), "longer than 1"),
        (sheet(strings={"id_numerical_only": True}), "numeric IDs"),
        (sheet(strings={"maximum_message_length": 300}), "allows messages of 300 bytes, not "),
    ],
)
def test_a_vda_order_that_does_not_fit_is_named(factsheet: Factsheet, problem: str) -> None:
    assert problem in str(order_problem(MISSION, Abilities(factsheet)))


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("height", 1.5, None),
        ("height", "high", "the parameter 'height' of 'pick' must be NUMBER, not 'high'"),
        ("height", True, "the parameter 'height' of 'pick' must be NUMBER, not True"),
        ("depth", 1.0, "the action 'pick' has no parameter 'depth' there, only height"),
    ],
)
def test_parameters_are_those_that_the_robot_lists(key: str, value: object, problem: str | None) -> None:
    pick = MISSION.actions[0].model_copy(
        update={"action_parameters": (ActionParameter.model_validate({"key": key, "value": value}),)}
    )
    nodes = (MISSION.nodes[0], MISSION.nodes[1].model_copy(update={"actions": (pick,)}))

    found = order_problem(MISSION.model_copy(update={"nodes": nodes}), Abilities(sheet(PICK)))
    assert (found and str(found)) == problem


def test_a_load_id_is_limited_to_the_robots_maximum_length() -> None:
    pick = make_action("pick", loadId="pallet")

    assert instant_action_problem(pick, Abilities(sheet(strings={"maximum_load_id_length": 6}))) is None
    problem = instant_action_problem(pick, Abilities(sheet(strings={"maximum_load_id_length": 5})))
    assert str(problem) == "the loadId 'pallet' is longer than 5 characters"


def test_content_outside_the_robots_version_is_a_problem() -> None:
    broken = MISSION.model_copy(update={"edges": ()})

    assert "cannot be expressed in VDA 5050 2.1.0" in str(order_problem(broken, Abilities(sheet())))


def test_instant_actions_are_checked_too() -> None:
    pick = make_action("pick", "i" * 9, height=1.0)
    everywhere = changed(action_scopes=(ActionScope.NODE, ActionScope.INSTANT))

    assert instant_action_problem(pick, Abilities(sheet(everywhere))) is None
    assert "not for INSTANT" in str(instant_action_problem(pick, Abilities(sheet(PICK))))
    short = Abilities(sheet(everywhere, strings={"maximum_id_length": 8}))
    assert "longer than 8" in str(instant_action_problem(pick, short))
    cancel = pick.model_copy(update={"action_type": "cancelOrder"})
    assert instant_action_problem(cancel, short) is None


def test_an_infeasible_order_is_never_sent() -> None:
    bench = Bench().online()
    bench.take(bench.fleet.on_factsheet(bench.robot.key, sheet(changed(action_type="drop")), bench.now))

    bench.start(MISSION)

    assert bench.orders_sent() == []
    (failed,) = bench.told(VdaOrderFailed)
    assert str(failed.reason) == (
        "the robot cannot execute the order: its factsheet does not list the action 'pick'"
    )
    assert failed.kind is FailureKind.UNFIT
    bench.start(make_vda_order("m2", "A", "B"))
    bench.run()
    assert [each.order_id for each in bench.told(VdaOrderFinished)] == ["m2"]


@pytest.mark.clause("6.2.1/fleet")
def test_an_infeasible_instant_action_is_never_sent() -> None:
    bench = Bench().online()
    bench.take(bench.fleet.on_factsheet(bench.robot.key, sheet(PICK), bench.now))

    bench.instruct(make_action("startPause"))

    assert bench.instants_sent() == []
    (ended,) = bench.told(InstantActionEnded)
    assert ended.status is ActionStatus.FAILED
    assert str(ended.reason) == (
        "not sent: the robot cannot execute it: its factsheet does not list the action 'startPause'"
    )


def test_instant_actions_per_message_respect_the_factsheet_limit() -> None:
    bench = Bench().online()
    bench.take(bench.fleet.on_factsheet(bench.robot.key, sheet(arrays={"instantActions": 2}), bench.now))
    bench.lose()
    for action_id in ("a", "b", "c"):
        bench.instruct(make_action("startPause", action_id))
    bench.sent.clear()

    bench.wait(1)

    sizes = [len(each.actions) for each in bench.sent if isinstance(each, PublishInstantActions)]
    assert sizes == [2, 1]
