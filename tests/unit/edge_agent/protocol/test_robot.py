"""The core as a whole: its responses, and what it refuses from driver and plug-ins."""

from __future__ import annotations

from math import inf, nan

import pytest

from nena_edge_agent.driver.port import BatteryReport, GoalReport, GoalTable, Pose, PoseReport
from nena_edge_agent.protocol.events import ActionReport, ReportState
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import Load
from nena_shared.vda5050.v2_1 import CODEC
from support.robot_core import MAP, Bench, action, at, order, position

REPORT = [ReportState()]


@pytest.mark.clause("6.6.1", "6.6.1/quiet")
def test_a_state_is_sent_for_relevant_changes_but_not_for_each_pose() -> None:
    bench = Bench()

    assert bench.do(at(0.1)) == []
    assert bench.do(at(0.1, localized=False)) == REPORT
    assert bench.do(at(0.2)) == REPORT
    assert bench.do(BatteryReport(50.0, charging=False)) == []
    assert bench.do(BatteryReport(50.0, charging=True)) == REPORT
    assert bench.do(GoalTable((GoalReport("g", external=False, status="EXECUTING"),))) == []
    assert bench.do(GoalTable((GoalReport("h", external=True, status="EXECUTING"),))) == REPORT


@pytest.mark.clause("7.8/position")
@pytest.mark.parametrize("x", [nan, inf, -inf])
def test_an_invalid_pose_is_ignored(x: float) -> None:
    bench = Bench()

    bench.do(PoseReport(Pose(x, 0.0, 0.0, MAP), localized=True))

    place = bench.state.mobile_robot_position
    assert place is not None
    assert place.x == 0.0


@pytest.mark.clause("7.8/power")
@pytest.mark.parametrize("charge", [nan, -1.0, 101.0])
def test_an_invalid_charge_is_ignored(charge: float) -> None:
    bench = Bench()
    bench.do(BatteryReport(70.0, charging=False, voltage=24.0, current=-1.0))

    bench.do(BatteryReport(charge, charging=True))

    supply = bench.state.power_supply
    assert (supply.state_of_charge, supply.charging) == (70.0, False)
    assert (supply.battery_voltage, supply.battery_current) == (24.0, -1.0)


@pytest.mark.clause("7.8/position", "6.3/frame")
def test_a_heading_is_reported_between_minus_pi_and_pi() -> None:
    bench = Bench()
    bench.do(at(0.0, theta=4.0))

    place = bench.state.mobile_robot_position
    assert place is not None
    assert place.theta == pytest.approx(4.0 - 2 * 3.14159265)


@pytest.mark.clause("7.8/position", "7.8/power")
def test_a_state_can_be_built_before_any_report() -> None:
    state = Bench(ready=False).state

    assert (state.order_id, state.last_node_id, state.mobile_robot_position) == ("", "", None)
    assert state.power_supply.state_of_charge == 100.0


@pytest.mark.clause("7.8/loads", "6.2.3/startCharging")
def test_loads_and_charging_follow_the_actions() -> None:
    bench = Bench()
    bench.instant(action("i"))
    bench.runs("i")

    bench.do(ActionReport("i", ActionStatus.FINISHED, loads=(Load(load_id="b"),), charging=True))

    assert bench.state.loads == (Load(load_id="b"),)
    assert bench.state.power_supply.charging


@pytest.mark.clause("6.2.3/startCharging")
def test_charging_ends_when_the_robot_drives() -> None:
    bench = Bench()
    bench.instant(action("i"))
    bench.do(ActionReport("i", ActionStatus.FINISHED, charging=True))

    bench.send(order("n0", "n1"))

    assert not bench.state.power_supply.charging


@pytest.mark.clause("6.6.9")
def test_a_late_report_of_an_ended_action_changes_nothing() -> None:
    bench = Bench()
    bench.instant(action("i"))
    bench.fails("i")

    effects = bench.do(ActionReport("i", ActionStatus.FINISHED, loads=(Load(load_id="b"),)))

    assert effects == []
    assert bench.state.loads == ()


def test_a_report_of_an_unknown_action_changes_nothing() -> None:
    assert Bench().do(ActionReport("nobody", ActionStatus.RUNNING)) == []


def test_a_decoded_order_survives_the_journal() -> None:
    places = {"n1": position(10.0, theta=1.0, radius=0.2)}
    sent = order("n0", "n1", "n2", positions=places, edge_fields={"reach_orientation_before_entering": False})
    bench = Bench()
    bench.send(CODEC.decode(Order, CODEC.encode(sent)))

    kept = Memory.model_validate_json(bench.core.memory().model_dump_json(exclude_defaults=True))

    assert kept.progress.nodes == sent.nodes[1:]
    assert kept.progress.edges == sent.edges
