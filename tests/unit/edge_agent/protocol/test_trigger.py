"""Actions that wait until somebody releases them."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.capabilities import RULES
from nena_edge_agent.protocol.events import LocalTrigger, StartAction
from support.robot_core import Bench, action, order


def waiting(*types: str, version: str = "3.0.0") -> Bench:
    bench = Bench(rules=RULES[version])
    wait = action("w", "HARD", "waitForTrigger", triggerType=list(types))
    bench.send(order("n0", "n1", node_actions={"n0": [wait]}))
    return bench


@pytest.mark.clause("6.2.3/waitForTrigger")
def test_the_robot_waits_without_a_plug_in() -> None:
    bench = waiting("FLEET_CONTROL")

    assert bench.status("w") == "RUNNING"
    assert not bench.effects_of(StartAction)
    assert not bench.goals


@pytest.mark.clause("6.2.3/trigger", "6.2.3/waitForTrigger")
def test_fleet_control_releases_it() -> None:
    bench = waiting("LOCAL", "FLEET_CONTROL")

    bench.instant(action("t", "NONE", "trigger"))

    assert (bench.status("t"), bench.status("w")) == ("FINISHED", "FINISHED")
    assert bench.goal.pose.x == 10.0


@pytest.mark.clause("6.2.3/trigger")
def test_a_trigger_that_nobody_waits_for_fails() -> None:
    bench = waiting("LOCAL")

    bench.instant(action("t", "NONE", "trigger"))

    assert (bench.status("t"), bench.status("w")) == ("FAILED", "RUNNING")


@pytest.mark.clause("6.2.3/waitForTrigger")
@pytest.mark.parametrize("version", list(RULES))
def test_somebody_at_the_robot_releases_it(version: str) -> None:
    bench = waiting("LOCAL", version=version)

    bench.do(LocalTrigger("door"))
    assert bench.status("w") == "RUNNING"
    bench.do(LocalTrigger("LOCAL"))

    assert bench.status("w") == "FINISHED"


@pytest.mark.clause("6.2.3/waitForTrigger")
def test_a_cancel_ends_the_waiting() -> None:
    bench = waiting("LOCAL")

    bench.instant(action("c", "NONE", "cancelOrder"))

    assert (bench.status("c"), bench.status("w"), bench.idle) == ("FINISHED", "FAILED", True)


@pytest.mark.clause("6.2.3/waitForTrigger", "6.1.4.3")
def test_without_a_type_the_order_is_refused() -> None:
    bench = Bench(rules=RULES["3.0.0"])

    bench.send(order("n0", "n1", node_actions={"n0": [action("w", "HARD", "waitForTrigger")]}))

    assert bench.errors == ["INVALID_ORDER_ACTION"]


@pytest.mark.clause("6.2.3/trigger")
def test_2_x_has_no_trigger_of_fleet_control() -> None:
    bench = waiting("FLEET_CONTROL", version="2.1.0")

    bench.instant(action("t", "NONE", "trigger"))

    assert (bench.status("t"), bench.status("w")) == ("FAILED", "RUNNING")


@pytest.mark.clause("6.2.3/waitForTrigger", "6.1.4.3")
@pytest.mark.parametrize("version", list(RULES))
def test_what_nothing_could_release_is_refused(version: str) -> None:
    bench = waiting(version=version)

    assert bench.errors == ["INVALID_ORDER_ACTION"]
    assert not bench.state.order_id
