"""Errors that last as long as their cause."""

from __future__ import annotations

from nena_edge_agent.driver.port import BlockedReport, Pose, PoseReport
from nena_edge_agent.protocol.conditions import ACTION_PLUGIN_UNUSABLE, ROBOT_BLOCKED
from nena_edge_agent.protocol.events import Halt, PluginsReport, ReportState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from support.robot_core import MAP, Bench, order

STANDS = BlockedReport(blocked=True, seconds=20.0)


def test_a_robot_that_does_not_get_on_goes_on_trying_and_says_so() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    assert ReportState() in bench.do(STANDS)

    (error,) = bench.state.errors
    assert (error.error_type, error.error_level) == (ROBOT_BLOCKED, ErrorLevel.WARNING)
    assert "20 s" in str(error.error_description)
    assert bench.state.driving
    assert not bench.effects_of(Halt)
    bench.do(BlockedReport(blocked=False, seconds=20.0))
    assert bench.errors == []


def test_without_an_order_a_robot_may_stand() -> None:
    bench = Bench()
    bench.do(STANDS)
    assert bench.errors == []


def test_the_state_says_why_the_place_is_not_to_be_trusted() -> None:
    bench = Bench()
    bench.do(PoseReport(Pose(0.0, 0.0, 0.0, MAP), localized=False, problem="no pose for 7 s"))
    (error,) = bench.state.errors
    assert error.error_type == ErrorType.LOCALIZATION_ERROR
    assert "no pose for 7 s" in str(error.error_description)


def test_plug_ins_that_cannot_be_used_are_a_warning_and_no_hindrance() -> None:
    bench = Bench()
    bench.do(PluginsReport(("plug-in 'lift' cannot be loaded", "plug-in 'forks' failed")))

    (error,) = bench.state.errors
    assert (error.error_type, error.error_level) == (ACTION_PLUGIN_UNUSABLE, ErrorLevel.WARNING)
    assert "plug-in 'lift' cannot be loaded; plug-in 'forks' failed" in str(error.error_description)
    bench.send(order("n0", "n1"))
    assert len(bench.goals) == 1
