"""Each row of the decision about an order, over a real broker to a running agent, in each version.

The rows are those of the decision procedure (section 6.1.2, figure 8): 1 to 5 for every message, A for
a new order, B for an update. A refusal names its error, its level and the message, and changes nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any
from uuid import uuid4

import pytest

from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import RULES, codec_for
from support.broker import Broker
from support.expressible import EXPRESSIBLE
from support.loopback_bench import BenchRobot, idle, place, shared_robot
from support.robot_core import MAP, action, order, position

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

VERSIONS = ("2.0.0", "2.1.0", "3.0.0")
WITH_ZERO_FIRST = tuple(each for each in VERSIONS if RULES[each].first_update_id_is_zero)
WITH_EQUAL_COMPARED = tuple(each for each in VERSIONS if RULES[each].equal_update_id_compared)
WITH_NODE_REPEATED = tuple(each for each in VERSIONS if RULES[each].stitching_node_repeated)


@pytest.fixture(scope="module", params=VERSIONS)
def process(
    request: pytest.FixtureRequest, broker: Broker, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[BenchRobot]:
    with shared_robot(broker, tmp_path_factory.mktemp("journal"), request.param) as made:
        yield made


@pytest.fixture
async def robot(process: BenchRobot) -> BenchRobot:
    """Return the robot in AUTOMATIC at n0, without an active order or an error."""
    await process.command("operatingMode", mode="AUTOMATIC")
    await process.command("speed", speed=500)
    if not idle(await process.state(lambda _: True)):
        await process.cancel()
    await process.command("pose", x=0, y=0)  # while it drives, the robot would drive on from there
    await process.state(lambda state: ready(state) and idle(state))
    return process


def ready(state: State) -> bool:
    there = place(state)
    return state.operating_mode is OperatingMode.AUTOMATIC and (there.x, there.y) == (0, 0)


@dataclass(frozen=True)
class Refusal:
    """An expected refusal; ``level`` is that of 3.0, in 2.x it is WARNING."""

    error_type: ErrorType
    level: ErrorLevel = ErrorLevel.WARNING
    references: Mapping[str, str] = field(default_factory=dict)


def new_id() -> str:
    return f"o-{uuid4().hex[:8]}"


async def held(robot: BenchRobot, order_id: str) -> State:
    """Make the robot wait at n1, its decision point, with n2 in the horizon and update 1."""
    robot.fleet.send(order("n0", "n1", order_id=order_id))
    await robot.state(lambda state: state.order_id == order_id and idle(state))
    robot.fleet.send(order("n1", "n2", order_id=order_id, update=1, first=2, released=1))
    return await robot.state(
        lambda state: (
            state.order_update_id == 1 and state.order_id == order_id and len(state.node_states) == 1
        )
    )


async def refused(robot: BenchRobot, sent: Order, expected: Refusal, payload: bytes | None = None) -> None:
    """Send an order and read its refusal, and that nothing else has changed."""
    before = await robot.state(lambda _: True)
    robot.fleet.peer.publish(
        robot.fleet.topic(Topic.ORDER), payload or codec_for(robot.version).encode(_addressed(robot, sent))
    )
    names = EXPRESSIBLE[robot.version].error_names
    references = {"orderId": sent.order_id, "orderUpdateId": str(sent.order_update_id), **expected.references}

    def found(state: State) -> ErrorEntry | None:
        return next(
            (
                each
                for each in state.errors
                if each.error_type == names[expected.error_type]
                and references.items()
                <= {(ref.reference_key, ref.reference_value) for ref in each.error_references}
            ),
            None,
        )

    after = await robot.state(found)
    error = found(after)
    assert error is not None
    level = (
        expected.level if expected.level in EXPRESSIBLE[robot.version].error_levels else ErrorLevel.WARNING
    )
    assert error.error_level is level
    assert error.error_description
    assert _held_by(after) == _held_by(before)


def _addressed(robot: BenchRobot, sent: Order) -> Order:
    key = robot.fleet.robot
    header = {"manufacturer": key.manufacturer, "serial_number": key.serial_number, "version": robot.version}
    return sent.model_copy(update=header)


def _held_by(state: State) -> tuple[Any, ...]:
    return (
        state.order_id,
        state.order_update_id,
        state.last_node_id,
        state.last_node_sequence_id,
        [each.node_id for each in state.node_states],
        [each.edge_id for each in state.edge_states],
        [(each.action_id, each.action_status) for each in state.action_states],
    )


async def accepted(robot: BenchRobot, sent: Order) -> State:
    """Send an order and read its echo without any error."""
    robot.fleet.send(sent)
    return await robot.state(
        lambda state: (
            (state.order_id, state.order_update_id) == (sent.order_id, sent.order_update_id)
            and not state.errors
        )
    )


@pytest.mark.clause("6.1.4.1", "6.1.1")
@pytest.mark.parametrize("fault", ["gap", "parity", "type", "base behind horizon"])
async def test_row_1_a_malformed_order(robot: BenchRobot, fault: str) -> None:
    waiting = await held(robot, new_id())
    sent = order("n0", "n1", "n2", order_id=new_id())
    body = json.loads(codec_for(robot.version).encode(_addressed(robot, sent)))
    match fault:
        case "gap":
            body["nodes"][2]["sequenceId"] = 6
        case "parity":
            for each in (*body["nodes"], *body["edges"]):
                each["sequenceId"] += 1
        case "type":
            body["nodes"][1]["released"] = "yes"
        case _:
            body["edges"][0]["released"] = body["nodes"][1]["released"] = False

    await refused(robot, sent, Refusal(ErrorType.VALIDATION_FAILURE), json.dumps(body).encode())

    assert waiting.order_id == robot.states[-1].order_id


@pytest.mark.clause("6.1.4.9", "6.6.6")
async def test_row_2_a_mode_that_rejects_orders(robot: BenchRobot) -> None:
    await robot.command("operatingMode", mode="MANUAL")
    await robot.state(lambda state: state.operating_mode is OperatingMode.MANUAL)

    await refused(robot, order("n0", "n1", order_id=new_id()), Refusal(ErrorType.MOBILE_ROBOT_NOT_AVAILABLE))

    await robot.command("operatingMode", mode="AUTOMATIC")
    name = EXPRESSIBLE[robot.version].error_names[ErrorType.MOBILE_ROBOT_NOT_AVAILABLE]
    await robot.state(lambda state: name not in [each.error_type for each in state.errors])


@pytest.mark.clause("7.1.2")
async def test_row_3_more_nodes_or_actions_than_the_robot_can_store(robot: BenchRobot) -> None:
    await held(robot, new_id())
    many = [f"n{number}" for number in range(1001)]
    places = {name: position(0.01 * number) for number, name in enumerate(many)}

    await refused(
        robot,
        order(*many, order_id=new_id(), positions=places),
        Refusal(ErrorType.INSUFFICIENT_MEMORY, ErrorLevel.URGENT),
    )


@pytest.mark.clause("6.1.4.2", "7.3/edge")
async def test_row_4_an_unsupported_optional_field(robot: BenchRobot) -> None:
    await held(robot, new_id())

    await refused(
        robot,
        order("n0", "n1", order_id=new_id(), edge_fields={"maximum_mobile_robot_height": 1.0}),
        Refusal(ErrorType.UNSUPPORTED_PARAMETER, ErrorLevel.CRITICAL, {"edgeId": "n0-n1"}),
    )


@pytest.mark.clause("6.1.4.3")
@pytest.mark.parametrize("released", [2, 1], ids=["base", "horizon"])
async def test_row_5_an_unknown_action(robot: BenchRobot, released: int) -> None:
    await held(robot, new_id())

    await refused(
        robot,
        order(
            "n0",
            "n1",
            order_id=new_id(),
            released=released,
            node_actions={"n1": [action("a1", "HARD", "somersault")]},
        ),
        Refusal(ErrorType.INVALID_ORDER_ACTION, references={"actionId": "a1"}),
    )


@pytest.mark.clause("6.1.4.6")
async def test_row_a1_another_order_is_active(robot: BenchRobot) -> None:
    await held(robot, new_id())

    await refused(robot, order("n1", "n2", order_id=new_id()), Refusal(ErrorType.OTHER_ORDER_ACTIVE))


@pytest.mark.clause("6.1.2/A2")
async def test_row_a2_a_new_order_with_an_update_id(robot: BenchRobot) -> None:
    sent = order("n0", "n1", order_id=new_id(), update=3)

    if robot.version in WITH_ZERO_FIRST:
        await refused(robot, sent, Refusal(ErrorType.VALIDATION_FAILURE))
    else:
        await accepted(robot, sent)


@pytest.mark.clause("6.1.4.10", "6.3.1")
async def test_row_a3_an_unknown_map(robot: BenchRobot) -> None:
    elsewhere = position(10.0).model_copy(update={"map_id": f"not-{MAP}"})

    await refused(
        robot,
        order("n0", "n1", order_id=new_id(), positions={"n1": elsewhere}),
        Refusal(ErrorType.UNKNOWN_MAP_ID, references={"nodeId": "n1"}),
    )


@pytest.mark.clause("6.1.4.7")
async def test_row_a4_a_start_away_from_the_robot(robot: BenchRobot) -> None:
    await refused(
        robot,
        order("n4", "n5", order_id=new_id()),
        Refusal(ErrorType.START_NODE_OUT_OF_RANGE, references={"nodeId": "n4"}),
    )


@pytest.mark.clause("6.1.4.8")
async def test_row_a5_an_unreachable_node(robot: BenchRobot) -> None:
    await robot.command("noRoute", x=30, y=0)
    await robot.state(lambda _: True)

    await refused(
        robot,
        order("n0", "n3", order_id=new_id()),
        Refusal(ErrorType.NO_ROUTE_TO_TARGET, references={"nodeId": "n3"}),
    )

    await robot.command("noRoute", x=30, y=0, active=False)


@pytest.mark.clause("6.1.2/A6", "6.6.5")
async def test_row_a6_an_accepted_order_clears_earlier_rejections(robot: BenchRobot) -> None:
    await refused(robot, order("n4", "n5", order_id=new_id()), Refusal(ErrorType.START_NODE_OUT_OF_RANGE))
    await robot.command("speed", speed=1)

    sent = order("n0", "n1", "n2", order_id=new_id(), node_actions={"n2": [action("a", "HARD", "pick")]})
    state = await accepted(robot, sent)

    assert [each.node_id for each in state.node_states] == ["n1", "n2"]
    assert [each.edge_id for each in state.edge_states] == ["n0-n1", "n1-n2"]
    assert [each.action_id for each in state.action_states] == ["a"]


@pytest.mark.clause("6.1.4.4")
async def test_row_b1_an_outdated_update(robot: BenchRobot) -> None:
    order_id = new_id()
    await held(robot, order_id)

    await refused(
        robot, order("n0", "n3", order_id=order_id, update=0), Refusal(ErrorType.OUTDATED_ORDER_UPDATE)
    )


@pytest.mark.clause("6.1.3.1")
async def test_row_b2_an_update_after_a_cancel(robot: BenchRobot) -> None:
    order_id = new_id()
    await held(robot, order_id)
    await robot.cancel()

    await refused(
        robot,
        order("n1", "n2", order_id=order_id, update=2, first=2),
        Refusal(ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL),
    )


@pytest.mark.clause("6.1.4.5")
async def test_row_b3_a_repeated_update(robot: BenchRobot) -> None:
    order_id = new_id()
    await held(robot, order_id)
    repeated = order("n1", "n2", order_id=order_id, update=1, first=2, released=1)

    state = await accepted(robot, repeated.model_copy(update={"header_id": 77}))
    assert len(state.node_states) == 1

    other = order("n1", "n3", order_id=order_id, update=1, first=2, released=1)
    if robot.version in WITH_EQUAL_COMPARED:
        await refused(robot, other, Refusal(ErrorType.SAME_ORDER_UPDATE_ID))
    else:
        state = await accepted(robot, other)
        assert [each.node_id for each in state.node_states] == ["n2"]


@pytest.mark.clause("6.1.2/B4")
@pytest.mark.parametrize(("node_id", "first"), [("n2", 4), ("n0", 0), ("n1", 4)])
async def test_row_b4_an_update_that_begins_at_another_node(
    robot: BenchRobot, node_id: str, first: int
) -> None:
    order_id = new_id()
    await held(robot, order_id)

    await refused(
        robot,
        order(node_id, "n3", order_id=order_id, update=2, first=first),
        Refusal(_wrong_stitching(robot), references={"nodeId": node_id}),
    )


@pytest.mark.clause("6.1.2/stitching")
async def test_row_b4_an_update_that_changes_the_decision_point(robot: BenchRobot) -> None:
    order_id = new_id()
    await held(robot, order_id)
    sent = order(
        "n1", "n2", order_id=order_id, update=2, first=2, node_actions={"n1": [action("a", "HARD", "pick")]}
    )

    if robot.version in WITH_NODE_REPEATED:
        await refused(robot, sent, Refusal(_wrong_stitching(robot), references={"nodeId": "n1"}))
    else:
        state = await accepted(robot, sent)
        assert state.action_states == ()


@pytest.mark.clause("6.1.2/B5")
async def test_row_b5_an_update_of_a_finished_order(robot: BenchRobot) -> None:
    order_id = new_id()
    robot.fleet.send(order("n0", "n1", order_id=order_id))
    await robot.state(lambda state: state.order_id == order_id and idle(state))

    await refused(
        robot,
        order("n0", "n2", order_id=order_id, update=1, first=2),
        Refusal(_wrong_stitching(robot), references={"nodeId": "n0"}),
    )
    await accepted(robot, order("n1", "n2", order_id=order_id, update=1, first=2))
    await robot.state(lambda state: state.last_node_id == "n2" and idle(state))


@pytest.mark.clause("6.1.2/B6")
async def test_row_b6_an_accepted_update_replaces_the_horizon(robot: BenchRobot) -> None:
    order_id = new_id()
    await held(robot, order_id)
    await refused(
        robot, order("n0", "n3", order_id=order_id, update=0), Refusal(ErrorType.OUTDATED_ORDER_UPDATE)
    )

    await accepted(robot, order("n1", "n3", order_id=order_id, update=2, first=2))

    done = await robot.state(lambda state: idle(state) and state.last_node_id == "n3")
    assert done.last_node_sequence_id == 4
    assert all(
        "n2" not in [each.node_id for each in state.node_states]
        for state in robot.states
        if state.order_update_id == 2
    )


def _wrong_stitching(robot: BenchRobot) -> ErrorType:
    """No version names this error; 2.x has one name for all errors of updates."""
    return (
        ErrorType.VALIDATION_FAILURE
        if robot.version in WITH_NODE_REPEATED
        else ErrorType.OUTDATED_ORDER_UPDATE
    )
