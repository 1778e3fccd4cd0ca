"""The way of a VDA order from its first sending to its one end, by example."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_conversations.kit.honest_robot import ROBOT, HonestRobot
from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.order_execution import OrderExecution, read_progress
from nena_order_service.fleet.outputs import (
    FleetOutput,
    NodePassed,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.robot import VdaOrderPhase
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType, error
from nena_shared.vda5050.state import OperatingMode, State
from support.fleet import Bench, make_vda_order
from support.fleet_examples import state, way


def failure(bench: Bench) -> VdaOrderFailed:
    (only,) = bench.told(VdaOrderFailed)
    return only


def sending(robot: HonestRobot | None = None) -> Bench:
    """Return a bench whose order from A to B was sent, and has not arrived."""
    bench = Bench(robot=robot).online()
    bench.start(make_vda_order("m", "A", "B"))
    return bench


def driving() -> Bench:
    """Return a bench whose robot has accepted an order from A to B."""
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    return bench


def adopting(robot: HonestRobot | None, vda_order: VdaOrder, *, accepted: bool) -> Bench:
    """Return the bench of an order service that restarted, before it has heard anything."""
    bench = Bench(robot=robot)
    bench.take(bench.control.adopt_order(vda_order, bench.now, accepted=accepted))
    return bench


@pytest.mark.clause("6.6.2/fleet", "6.1.2/confirm")
def test_a_vda_order_is_executed_to_its_end() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B", "C", operation="pick"))
    bench.run()
    assert bench.story() == [
        "VdaOrderAccepted",
        "NodePassed",
        "NodePassed",
        "NodePassed",
        "OperationStarted",
        "VdaOrderFinished",
    ]
    assert [each.node_id for each in bench.told(NodePassed)] == ["A", "B", "C"]
    assert bench.orders_sent() == ["m"]
    assert bench.view().availability.can_take_order


def test_a_vda_order_without_route_and_operation_finishes_when_accepted() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A"))
    assert bench.story() == ["VdaOrderAccepted", "NodePassed", "VdaOrderFinished"]


@pytest.mark.clause("6.6.2/fleet")
def test_nodes_with_lost_states_are_reported_in_order() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B", "C", "B", "D"))
    bench.deliver()
    for _ in range(4):
        bench.robot.step()
    bench.report()
    passed = [(each.node_id, each.sequence_id) for each in bench.told(NodePassed)]
    assert passed == [("A", 0), ("B", 2), ("C", 4), ("B", 6), ("D", 8)]


@pytest.mark.clause("6.6.2/fleet")
def test_the_operation_is_not_finished_at_the_last_node() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B", operation="pick"))
    bench.deliver()
    bench.robot.step()
    bench.report()
    assert not bench.told(VdaOrderFinished)


@pytest.mark.clause("6.1.2/confirm")
def test_a_lost_order_is_resent_with_growing_delays() -> None:
    bench = sending()
    times = []
    for _ in range(60):
        before = len(bench.sent)
        bench.wait(0.25)
        if len(bench.sent) > before:
            times.append(bench.now - 100.0)
    assert times == [1.0, 3.0, 7.0, 15.0]
    bench.exchange()
    bench.wait(60, reporting=True)
    assert bench.orders_sent() == ["m"] * 5, "what was echoed is not sent again"
    assert bench.robot.accepted == ["m"]


@pytest.mark.clause("6.1.2/confirm")
def test_an_order_that_is_never_accepted_fails_with_the_number_of_attempts() -> None:
    bench = sending()
    bench.wait(60, reporting=True)
    assert str(failure(bench).reason) == "the order was sent 6 times, but the robot never accepted it"
    assert failure(bench).kind is FailureKind.NOT_TAKEN
    assert bench.orders_sent() == ["m"] * 6


def test_an_order_whose_id_the_robot_reports_otherwise_fails_with_that_id() -> None:
    bench = sending()
    bench.robot.order_id = "m-cut-of"
    bench.wait(60, reporting=True)
    assert str(failure(bench).reason).endswith("never accepted it: its states have orderId 'm-cut-of'")


def test_an_order_that_the_broker_refuses_fails_at_once_and_names_the_topic() -> None:
    bench = sending()
    bench.take(bench.control.on_undeliverable("uagv/v2/ACME/r.1/order", bench.now))
    assert "uagv/v2/ACME/r.1/order" in str(failure(bench).reason)
    bench.wait(60, reporting=True)
    assert bench.orders_sent() == ["m"]


def test_a_refused_message_ends_no_order_that_the_robot_has() -> None:
    bench = sending()
    bench.exchange()
    bench.take(bench.control.on_undeliverable("uagv/v2/ACME/r.1/order", bench.now))
    bench.run()
    assert bench.ends() == {"m": 1}
    assert bench.told(VdaOrderFailed) == []


@pytest.mark.clause("6.1.4/fleet")
def test_a_refusal_that_names_the_order_fails_the_vda_order_with_the_robots_words() -> None:
    bench = Bench(robot=HonestRobot(position=(9.0, 9.0, 0.0))).online()
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    assert str(failure(bench).reason) == "the robot refuses the order"
    assert failure(bench).details == ("START_NODE_OUT_OF_RANGE: no",)
    assert failure(bench).kind is FailureKind.REFUSED


@pytest.mark.clause("6.1.4/fleet")
@pytest.mark.parametrize("has_pose", [True, False], ids=["not localised", "no pose yet"])
@pytest.mark.parametrize("cleared", [True, False], ids=["refusal goes", "refusal stays"])
def test_an_order_refused_by_an_unlocalised_robot_is_resent_once_it_is_localised(
    *, has_pose: bool, cleared: bool
) -> None:
    bench = sending()
    bench.robot.localized, bench.robot.has_pose = False, has_pose
    bench.robot.errors.append(error(ErrorType.START_NODE_OUT_OF_RANGE, "no", order_id="m"))
    bench.lose()
    bench.wait(60, reporting=True)
    assert bench.ends() == {}
    assert bench.orders_sent() == ["m"], "it would be refused again"
    bench.robot.localized = bench.robot.has_pose = True
    if cleared:
        bench.robot.errors.clear()
    bench.report()
    bench.tick()
    assert bench.orders_sent() == ["m", "m"]
    bench.run()
    assert bench.ends() == {"m": 1}
    assert bench.told(VdaOrderFinished)


@pytest.mark.clause("6.1.4/fleet")
def test_a_refusal_counts_once_the_robot_is_localised_again() -> None:
    bench = sending(HonestRobot(position=(9.0, 9.0, 0.0)))
    bench.robot.localized = False
    bench.exchange()
    assert bench.ends() == {}
    bench.robot.errors.clear()
    bench.robot.localized = True
    bench.report()
    bench.exchange()
    assert str(failure(bench).reason) == "the robot refuses the order"


@pytest.mark.clause("6.1.4/fleet")
def test_a_refusal_before_the_robots_first_state_is_not_final() -> None:
    bench = sending()
    bench.lose()
    bench.now += 0.5
    bench.connection(ConnectionState.ONLINE)
    bench.robot.errors.append(error(ErrorType.START_NODE_OUT_OF_RANGE, "no", order_id="m"))
    bench.report()  # its pose has come meanwhile
    assert bench.ends() == {}
    assert bench.orders_sent() == ["m", "m"]


@pytest.mark.clause("6.1.4/fleet")
def test_refusals_are_excused_for_one_sending_despite_reconnects() -> None:
    bench = sending(HonestRobot(position=(9.0, 9.0, 0.0)))
    for _ in range(3):
        bench.now += 0.5
        bench.connection(ConnectionState.ONLINE)
        bench.exchange()
        bench.robot.errors.clear()
        bench.report()
    assert str(failure(bench).reason) == "the robot refuses the order"
    assert bench.orders_sent() == ["m", "m"]


@pytest.mark.clause("6.1.4/fleet")
@pytest.mark.parametrize("kind", ["noRouteError", "orderError", "validationError", "orderUpdateError"])
def test_a_refusal_without_references_is_identified_by_type_and_time(kind: str) -> None:
    bench = sending()
    bench.robot.errors.append(ErrorEntry(error_type=kind, error_level=ErrorLevel.WARNING))
    bench.report()
    assert bench.ends() == {}
    bench.tick()
    assert bench.orders_sent() == ["m", "m"]
    bench.report()
    assert bench.ends() == {}, "the robot has had no time to answer"
    bench.wait(FleetSettings().resend_after, reporting=True)
    assert failure(bench).details == (kind,)


@pytest.mark.clause("6.1.4/fleet")
def test_a_refusal_of_a_foreign_message_does_not_refuse_the_accepted_order() -> None:
    bench = sending()
    bench.robot.errors.append(ErrorEntry(error_type="validationError", error_level=ErrorLevel.WARNING))
    bench.report()
    bench.tick()
    bench.run()
    assert bench.ends() == {"m": 1}
    assert bench.told(VdaOrderFinished)


@pytest.mark.clause("6.1.4/fleet")
def test_a_refusal_from_before_the_order_does_not_refuse_it() -> None:
    bench = Bench()
    bench.robot.errors.append(ErrorEntry(error_type="noRouteError", error_level=ErrorLevel.WARNING))
    bench.online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.report()
    bench.run()
    assert bench.told(VdaOrderFinished)


@pytest.mark.clause("6.1.4/fleet")
@pytest.mark.parametrize(
    ("key", "value", "fails"),
    [("orderId", "other", False), ("actionId", "i1", False), ("actionId", "m/pick", True)],
)
def test_a_refusal_counts_if_it_names_the_order_or_its_part(key: str, value: str, *, fails: bool) -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B", operation="pick"))
    named = ErrorReference(reference_key=key, reference_value=value)
    bench.robot.errors.append(
        ErrorEntry(error_type="orderError", error_level=ErrorLevel.WARNING, error_references=(named,))
    )
    bench.report()
    assert bench.ends() == ({"m": 1} if fails else {})


@pytest.mark.clause("6.6.9/failed")
def test_a_failed_operation_fails_the_vda_order_with_the_robots_words() -> None:
    bench = Bench(robot=HonestRobot(actions_fail=True)).online()
    bench.start(make_vda_order("m", "A", "B", operation="pick"))
    bench.run()
    assert str(failure(bench).reason) == "the action 'pick' has failed"
    assert failure(bench).details == ("ACTION_FAILED: dropped it",)
    assert failure(bench).kind is FailureKind.ACTION
    assert bench.instants_sent() == [], "the robot has ended the order itself"


@pytest.mark.clause("6.6.9/failed", "6.1.3/fleet")
def test_a_failed_operation_cancels_later_actions() -> None:
    bench = Bench(robot=HonestRobot(actions_fail=True)).online()
    one, two = (make_vda_order("m", "A", operation=each) for each in ("pick", "weigh"))
    node = one.nodes[0].model_copy(update={"actions": (*one.actions, *two.actions)})
    bench.start(one.model_copy(update={"nodes": (node,)}))
    bench.deliver()
    bench.robot.step()
    bench.robot.step()
    bench.report()
    assert bench.instants_sent() == ["cancelOrder"]
    bench.exchange()
    assert str(failure(bench).reason) == "the action 'pick' has failed"
    assert bench.robot.executed == ["m/pick"]


@pytest.mark.clause("6.6.5.1/fleet")
def test_a_node_that_cannot_be_reached_cancels_the_order_and_then_fails_it() -> None:
    bench = Bench(robot=HonestRobot(unreachable={"C"})).online()
    bench.start(make_vda_order("m", "A", "B", "C"))
    bench.deliver()
    bench.robot.step()
    bench.robot.step()
    bench.report()
    assert bench.view().order_phase is VdaOrderPhase.CANCELLING
    assert bench.instants_sent() == ["cancelOrder"]
    assert bench.ends() == {}, "the robot still has the order"
    bench.exchange()
    assert str(failure(bench).reason) == "the robot cannot continue the order"
    assert failure(bench).details == ("NODE_UNREACHABLE: no way",)
    assert failure(bench).kind is FailureKind.DRIVE
    assert bench.robot.idle


@pytest.mark.clause("6.6.5.1/fleet")
def test_a_fatal_error_without_references_fails_after_a_delay() -> None:
    bench = driving()
    bench.robot.errors.append(ErrorEntry(error_type="lidarDirty", error_level=ErrorLevel.FATAL))
    bench.robot.paused = True  # so that it stands
    bench.wait(9, reporting=True)
    assert bench.view().order_phase is VdaOrderPhase.RUNNING
    bench.wait(3, reporting=True)
    bench.exchange()
    assert str(failure(bench).reason) == "the robot has stopped with an error"
    assert failure(bench).details == ("lidarDirty",)


@pytest.mark.clause("6.6.5.1/fleet")
def test_a_fatal_error_that_passes_does_not_fail_the_vda_order() -> None:
    bench = driving()
    bench.robot.paused = True
    for _ in range(3):
        bench.robot.errors.append(ErrorEntry(error_type="lidarDirty", error_level=ErrorLevel.FATAL))
        bench.wait(7, reporting=True)
        bench.robot.errors.clear()
        bench.report()
    bench.robot.paused = False
    bench.run()
    assert bench.told(VdaOrderFinished)


@pytest.mark.clause("6.6.5.1/fleet")
def test_a_warning_does_not_affect_the_vda_order() -> None:
    bench = sending()
    bench.robot.errors.append(ErrorEntry(error_type="batteryLow", error_level=ErrorLevel.URGENT))
    bench.run()
    assert bench.told(VdaOrderFinished)


@pytest.mark.clause("6.1.3/fleet")
def test_a_cancelled_vda_order_ends_when_the_robot_has_confirmed_it() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B", operation="pick"))
    bench.cancel()
    bench.report()
    assert bench.ends() == {}
    assert str(bench.view().wait_reason) == "the robot has not yet confirmed the end of the order"
    bench.exchange()
    assert bench.told(VdaOrderCancelled)
    assert bench.robot.executed == []


@pytest.mark.clause("6.1.3/fleet", "6.2.1/fleet")
def test_a_lost_cancel_is_resent_with_the_same_id() -> None:
    bench = driving()
    bench.cancel()
    bench.cancel()
    assert bench.instants_sent() == ["cancelOrder"], "one is enough"
    bench.lose()
    bench.wait(2, reporting=True)
    assert bench.instants_sent() == ["cancelOrder", "cancelOrder"]
    bench.exchange()
    assert bench.told(VdaOrderCancelled)
    assert len(bench.robot.instants) == 1


def test_an_order_that_waits_to_be_sent_is_cancelled_at_once() -> None:
    bench = Bench().online()
    bench.connection(ConnectionState.OFFLINE)
    bench.start(make_vda_order("m", "A", "B"))
    bench.cancel()
    assert bench.told(VdaOrderCancelled)
    assert bench.sent == []


@pytest.mark.clause("6.1.3/fleet")
def test_an_order_that_may_still_arrive_is_cancelled_at_the_robot() -> None:
    bench = sending()
    bench.cancel()
    bench.wait(5, reporting=True)
    assert bench.ends() == {}
    assert bench.orders_sent() == ["m"], "a cancelled order is not sent again"
    bench.exchange()
    assert bench.told(VdaOrderCancelled)
    assert bench.robot.idle


def test_a_cancel_is_unclear_while_a_resent_copy_may_still_arrive() -> None:
    bench = Bench(FleetSettings(sendings=2)).online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.deliver()
    bench.wait(1)
    assert bench.orders_sent() == ["m", "m"]
    bench.cancel()
    bench.robot.set_mode(OperatingMode.MANUAL)
    bench.report()
    bench.robot.set_mode(OperatingMode.AUTOMATIC)
    bench.wait(10, reporting=True)
    assert bench.told(VdaOrderCancelled) == []
    assert failure(bench).kind is FailureKind.UNCLEAR
    bench.deliver()
    assert bench.robot.idle


@pytest.mark.clause("6.1.3/fleet")
def test_a_cancel_that_finds_no_order_ends_a_vda_order_that_never_came() -> None:
    bench = sending()
    bench.lose()
    bench.cancel()
    bench.exchange()
    assert bench.told(VdaOrderCancelled)
    assert bench.robot.accepted == []


@pytest.mark.clause("6.1.3/fleet")
def test_a_vda_order_done_before_the_cancel_arrives_is_finished() -> None:
    bench = driving()
    bench.cancel()
    bench.robot.step()
    bench.report()
    assert bench.told(VdaOrderFinished)
    assert bench.ends() == {"m": 1}


@pytest.mark.clause("6.1.3/fleet")
def test_a_cancel_that_is_never_confirmed_fails_the_vda_order() -> None:
    bench = driving()
    bench.cancel()
    bench.wait(60, reporting=True)
    assert "does not confirm cancelOrder: sent 6 times" in str(failure(bench).reason)
    assert failure(bench).kind is FailureKind.UNCLEAR


@pytest.mark.clause("6.6.6/fleet")
def test_a_robot_switched_to_manual_has_abandoned_the_order() -> None:
    bench = driving()
    bench.robot.set_mode(OperatingMode.MANUAL)
    bench.report()
    assert (
        str(failure(bench).reason) == "the robot abandoned the order when it changed to operating mode manual"
    )
    assert failure(bench).kind is FailureKind.DRIVE
    assert bench.instants_sent() == [], "nothing is sent to a robot in manual mode"
    assert not bench.view().availability.can_take_order


@pytest.mark.clause("6.6.6/fleet")
@pytest.mark.parametrize("mode", [OperatingMode.MANUAL, OperatingMode.SERVICE, OperatingMode.TEACH_IN])
@pytest.mark.parametrize(
    "told", ["its actions fail", "it drops the order", "it stands with an error", "later"]
)
def test_a_mode_is_named_as_the_cause_of_whatever_fails_with_it(told: str, mode: OperatingMode) -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B", operation="pick"))
    robot, words = bench.robot, mode.lower().replace("_", " ")
    robot.mode = mode
    if told == "its actions fail":
        robot.statuses = dict.fromkeys(robot.statuses, ActionStatus.FAILED)
    if told == "it stands with an error":
        robot.paused = True
        robot.errors.append(ErrorEntry(error_type="manual", error_level=ErrorLevel.FATAL))
    if told == "later":
        bench.report()
        robot.mode = OperatingMode.AUTOMATIC
    if told in ("it drops the order", "later"):
        robot.order_id = ""
    bench.wait(60, reporting=True)
    if told in ("its actions fail", "it stands with an error"):
        assert str(bench.control.view(bench.now).wait_reason) == (
            f"the robot is in operating mode {words}, which takes no orders"
        )
        robot.mode, robot.paused = OperatingMode.AUTOMATIC, False
        bench.run()

    assert str(failure(bench).reason) == (
        f"the robot abandoned the order when it changed to operating mode {words}"
    )


def test_repeated_messages_from_before_the_order_do_not_end_it() -> None:
    bench = Bench().online()
    bench.now += 1
    online, before = bench.robot.connection(ConnectionState.ONLINE, bench.now), bench.robot.state(bench.now)
    bench.take(bench.fleet.on_connection(bench.robot.key, online, bench.now))
    bench.take(bench.fleet.on_state(bench.robot.key, before, bench.now))
    bench.now += 1
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    assert bench.told(VdaOrderAccepted)

    bench.take(bench.fleet.on_connection(bench.robot.key, online, bench.now))
    bench.take(bench.fleet.on_state(bench.robot.key, before, bench.now))
    bench.run()
    assert bench.told(VdaOrderFinished)
    assert not bench.told(VdaOrderFailed)


@pytest.mark.clause("6.6/restart")
def test_a_robot_that_no_longer_reports_its_order_has_lost_it() -> None:
    bench = driving()
    bench.robot.restart(journal=False)
    bench.now += 1
    bench.report()
    assert "no longer has the order: it has no order" in str(failure(bench).reason)
    assert failure(bench).kind is FailureKind.LOST
    assert bench.orders_sent() == ["m"], "it is not given again without being asked for"


@pytest.mark.clause("6.6/restart")
def test_a_robot_that_kept_its_order_continues_after_a_restart() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B", "C", operation="pick"))
    bench.deliver()
    bench.robot.step()
    bench.report()
    bench.robot.restart(journal=True)
    bench.run()
    assert bench.told(VdaOrderFinished)
    assert [each.node_id for each in bench.told(NodePassed)] == ["A", "B", "C"]


@pytest.mark.clause("6.6.2/fleet")
def test_a_foreign_cancel_fails_the_vda_order() -> None:
    bench = driving()
    bench.robot._clear()
    bench.report()
    assert str(failure(bench).reason) == (
        "the robot abandoned the order: its states have no nodeStates left, but lastNodeId 'A' with "
        "lastNodeSequenceId 0, not 'B' with 2"
    )


@pytest.mark.clause("6.6/restart")
@pytest.mark.parametrize("accepted", [False, True])
def test_an_adopted_running_vda_order_continues(accepted: bool) -> None:  # noqa: FBT001 - a parameter
    bench = Bench()
    vda_order = make_vda_order("m", "A", "B", "C")
    bench.start(vda_order)
    bench.online()
    bench.deliver()
    bench.robot.step()
    again = adopting(bench.robot, vda_order, accepted=accepted)
    again.online()
    assert again.orders_sent() == []
    assert [each.node_id for each in again.told(NodePassed)] == ["A", "B"]
    again.run()
    assert again.told(VdaOrderFinished)
    assert again.robot.accepted == ["m"]


def test_an_adopted_vda_order_that_is_done_is_finished() -> None:
    bench = Bench().online()
    vda_order = make_vda_order("m", "A", "B")
    bench.start(vda_order)
    bench.run()
    again = adopting(bench.robot, vda_order, accepted=True)
    again.online()
    assert again.story() == ["VdaOrderAccepted", "NodePassed", "NodePassed", "VdaOrderFinished"]


def test_an_adopted_vda_order_that_never_arrived_is_sent() -> None:
    bench = adopting(None, make_vda_order("m", "A", "B"), accepted=False)
    bench.wait(5)
    assert bench.sent == [], "nothing is known of the robot yet"
    bench.online()
    assert bench.orders_sent() == ["m"]
    bench.run()
    assert bench.told(VdaOrderAccepted)
    assert bench.told(VdaOrderFinished)


@pytest.mark.clause("6.6/restart")
def test_an_adopted_vda_order_that_the_robot_has_lost_fails() -> None:
    bench = adopting(None, make_vda_order("m", "A", "B"), accepted=True)
    bench.online()
    assert "no longer has the order" in str(failure(bench).reason)
    assert bench.sent == []


@pytest.mark.parametrize("arrived", [True, False], ids=["arrived", "may still arrive"])
def test_an_adopted_vda_order_can_be_cancelled_before_anything_is_known(*, arrived: bool) -> None:
    first = Bench().online()
    vda_order = make_vda_order("m", "A", "B", "C")
    first.start(vda_order)
    if arrived:
        first.deliver()
    bench = adopting(first.robot, vda_order, accepted=False)
    bench.cancel()
    assert bench.ends() == {}
    bench.online()
    assert bench.instants_sent() == ["cancelOrder"]
    bench.exchange()
    assert bench.told(VdaOrderCancelled)
    assert bench.robot.idle


@pytest.mark.clause("6.6.2/fleet")
def test_missing_action_states_eventually_fail_the_order() -> None:
    bench = Bench(FleetSettings(standstill_patience=5.0)).online()
    bench.start(make_vda_order("m", "A", operation="pick"))
    bench.deliver()
    bench.robot.actions.clear()
    bench.robot.statuses.clear()
    bench.wait(4, reporting=True)
    assert bench.ends() == {}
    bench.wait(3, reporting=True)
    assert str(failure(bench).reason) == "the robot does not report the actions of the order"


@pytest.mark.clause("6.6.9/instant", "6.6.8")
def test_order_actions_are_distinguished_from_instant_actions() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B", operation="pick"))
    bench.deliver()
    action = make_vda_order("x", "A", operation="logReport").actions[0]
    bench.robot.instants[action.action_id] = (action, ActionStatus.RUNNING)
    bench.run()
    assert bench.told(VdaOrderFinished)
    assert bench.view().availability.can_take_order


def fresh(*, adopted: bool = False, accepted: bool = False) -> OrderExecution:
    """Return an execution without a controller: only the test sends and requests."""
    vda_order = make_vda_order("m", "A", "B", "C", operation="pick")
    return OrderExecution(ROBOT, vda_order, FleetSettings(), adopted=adopted, accepted=accepted)


def test_an_action_failing_en_route_is_a_drive_failure() -> None:
    run = fresh()
    run.send((), 0.0)
    failed = {"action_id": "m/pick", "action_type": "pick", "action_status": "FAILED"}
    told = list(run.on_state(state(order_id="m", action_states=(failed,), **way("B", "C")), 1.0))
    assert [type(each).__name__ for each in told] == ["VdaOrderAccepted", "NodePassed"]
    assert run.wants_cancel(state(order_id="m", **way("B", "C")))

    (end,) = run.on_state(state(order_id="m", action_states=(failed,)), 2.0)
    assert isinstance(end, VdaOrderFailed)
    assert (end.kind, str(end.reason)) == (FailureKind.DRIVE, "the action 'pick' has failed")


def test_a_published_end_is_final() -> None:
    run = fresh(adopted=True, accepted=True)
    (end,) = run.on_state(state(order_id="other"), 0.0)
    assert isinstance(end, VdaOrderFailed)
    assert end.kind is FailureKind.LOST
    assert "it has the order 'other'" in str(end.reason)


def test_a_robot_with_an_unknown_newer_update_has_not_lost_the_order() -> None:
    run = fresh(adopted=True, accepted=True)
    (end,) = run.on_state(state(order_id="m", order_update_id=3, **way("B", "C")), 0.0)
    assert isinstance(end, VdaOrderFailed)
    assert end.kind is FailureKind.UNCLEAR, "it may have done what the store knows nothing of"
    assert "the robot has update 3 of the order, and update 0 is the last one known here" in str(end.reason)


STATES = st.builds(
    state,
    order_id=st.sampled_from(["m", "m", "m", "", "other"]),
    order_update_id=st.sampled_from([0, 0, 0, 1]),
    last_node_sequence_id=st.sampled_from([0, 2, 4]),
    node_states=st.sampled_from([way("B", "C"), way("C", first=4), {"node_states": ()}]).map(
        lambda made: made["node_states"]
    ),
    action_states=st.just(())
    | st.sampled_from(["WAITING", "RUNNING", "RETRIABLE", "FINISHED", "FAILED"]).map(
        lambda status: ({"action_id": "m/pick", "action_type": "pick", "action_status": status},)
    ),
    errors=st.sampled_from(
        [
            (),
            ({"error_type": "wheel", "error_level": "FATAL"},),
            ({"error_type": "orderError", "error_level": "WARNING"},),
            (
                {
                    "error_type": "orderError",
                    "error_level": "WARNING",
                    "error_references": ({"reference_key": "orderId", "reference_value": "m"},),
                },
            ),
        ]
    ),
    operating_mode=st.sampled_from(["AUTOMATIC", "AUTOMATIC", "MANUAL"]),
    new_base_request=st.booleans(),
)
STEPS = st.lists(
    st.tuples(st.sampled_from(["state", "state", "send", "tick", "cancel"]), STATES), max_size=12
)


@given(STEPS, st.booleans())
def test_any_robot_behaviour_gives_one_end_and_ordered_nodes(
    steps: list[tuple[str, State]],
    adopted: bool,  # noqa: FBT001 - drawn
) -> None:
    run, now, seen = fresh(adopted=adopted), 0.0, state()
    told: list[FleetOutput] = []
    for kind, said in steps:
        if run.ended:
            break
        now += 4.0
        if kind == "state":
            seen = said
            told += run.on_state(said, now)
        elif kind == "tick":
            told += run.on_tick(seen, now)
        elif kind == "cancel":
            told += run.begin_cancel()
        elif run.is_due(now):
            run.send(seen.errors, now)
    ends = [each for each in told if isinstance(each, VdaOrderFinished | VdaOrderFailed | VdaOrderCancelled)]
    assert len(ends) == run.ended
    assert ends == [] or told[-1] is ends[0]
    passed = [each.sequence_id for each in told if isinstance(each, NodePassed)]
    assert passed == sorted(set(passed))
    accepted = [isinstance(each, VdaOrderAccepted) for each in told]
    assert sum(accepted) <= 1
    assert accepted[:1] == [True] or passed == [], "it is accepted before a node is passed"


@pytest.mark.parametrize(("ahead", "failed"), [(["B"], ["h"]), ([], [])])
def test_a_failed_edge_action_counts_only_until_the_edge_is_left(ahead: list[str], failed: list[str]) -> None:
    whole = make_vda_order("m", "A", "B")
    horn = Action(action_type="horn", action_id="h", blocking_type=BlockingType.NONE)
    edge = whole.edges[0].model_copy(update={"actions": (horn,)})
    vda_order = whole.model_copy(update={"edges": (edge,)})
    told = [{"action_id": "h", "action_type": "horn", "action_status": "FAILED"}]
    progress = read_progress(state(order_id="m", **way(*ahead), action_states=told), vda_order)
    assert [each.action_id for each in progress.failed] == failed
