"""Actions that failed and may be tried again."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.events import LocalTrigger, StartAction
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, action, order


def failed(version: str = "3.0.0", *, retriable: bool = True) -> Bench:
    """Return a robot of which the first of two actions has failed."""
    bench = Bench(rules=RULES[version])
    work = [action("a", "HARD", retriable=retriable), action("b", "HARD")]
    bench.send(order("n0", "n1", node_actions={"n0": work}))
    bench.runs("a")
    bench.fails("a")
    return bench


@pytest.mark.clause("6.6.9/retriable")
@pytest.mark.parametrize(
    ("version", "retriable", "status"),
    [("3.0.0", True, "RETRIABLE"), ("3.0.0", False, "FAILED"), ("2.1.0", True, "FAILED")],
)
def test_a_failure_is_retriable_if_order_and_version_allow_it(
    version: str,
    retriable: bool,  # noqa: FBT001 - an example
    status: str,
) -> None:
    bench = failed(version, retriable=retriable)

    assert bench.status("a") == status
    assert bench.errors == ["ACTION_FAILED"]
    assert bench.status("b") == ("WAITING" if status == "RETRIABLE" else "INITIALIZING")


@pytest.mark.clause("6.6.9/retriable")
@pytest.mark.clause("6.2.3/retry")
def test_a_retriable_action_blocks_the_order_until_it_is_retried() -> None:
    bench = failed()
    assert not bench.idle
    assert not bench.goals

    bench.instant(action("r", "NONE", "retry", actionId="a"))

    assert (bench.status("r"), bench.status("a")) == ("FINISHED", "INITIALIZING")
    assert [each.action.action_id for each in bench.effects_of(StartAction)] == ["a", "a"]
    assert bench.errors == []
    bench.runs("a")
    bench.finishes("a")
    assert bench.status("b") == "INITIALIZING"


@pytest.mark.clause("6.6.9/retriable")
@pytest.mark.clause("6.2.3/skipRetry")
def test_a_skipped_action_fails_and_the_order_continues() -> None:
    bench = failed()

    bench.instant(action("s", "NONE", "skipRetry", actionId="a"))

    assert (bench.status("s"), bench.status("a"), bench.status("b")) == ("FINISHED", "FAILED", "INITIALIZING")
    assert bench.errors == ["ACTION_FAILED"]


@pytest.mark.clause("6.6.9/retriable")
@pytest.mark.clause("6.2.3/retry", "6.2.3/skipRetry", "6.2.1/refused")
@pytest.mark.parametrize("kind", ["retry", "skipRetry"])
@pytest.mark.parametrize("wanted", ["b", "unknown"])
def test_only_retriable_actions_are_retried(kind: str, wanted: str) -> None:
    bench = failed()

    bench.instant(action("r", "NONE", kind, actionId=wanted))

    assert bench.status("r") == "FAILED"
    assert "INVALID_INSTANT_ACTION" in bench.errors
    assert bench.status("a") == "RETRIABLE"


@pytest.mark.clause("6.6.9/retriable")
@pytest.mark.clause("6.2.3/retry")
def test_nothing_is_retried_during_a_pause() -> None:
    bench = failed()
    bench.instant(action("p", "NONE", "startPause"))

    bench.instant(action("r", "NONE", "retry", actionId="a"))

    assert (bench.status("r"), bench.status("a")) == ("FAILED", "RETRIABLE")


@pytest.mark.clause("6.6.9/retriable")
@pytest.mark.clause("6.1.3/actions")
def test_a_cancel_ends_it() -> None:
    bench = failed()

    bench.instant(action("c", "NONE", "cancelOrder"))

    assert (bench.status("c"), bench.status("a")) == ("FINISHED", "FAILED")
    assert bench.idle


@pytest.mark.clause("6.6.9/retriable")
def test_it_ends_with_its_edge() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", "n1", edge_actions={"n0-n1": [action("a", "NONE", retriable=True)]}))
    bench.runs("a")
    bench.fails("a")
    assert bench.status("a") == "RETRIABLE"

    bench.arrive()

    assert bench.status("a") == "FAILED"
    assert bench.idle
    (failure,) = bench.state.errors
    assert "retry" not in (failure.error_hint or "")


@pytest.mark.clause("6.6.9/retriable")
@pytest.mark.clause("6.2.3/retry")
def test_a_retriable_action_can_be_retried_after_a_restart() -> None:
    bench = failed()
    again = Bench(
        memory=Memory.model_validate_json(bench.core.memory().model_dump_json()), rules=RULES["3.0.0"]
    )
    assert again.status("a") == "RETRIABLE"
    assert again.errors == ["ACTION_FAILED"]

    again.instant(action("r", "NONE", "retry", actionId="a"))

    assert again.status("a") == "INITIALIZING"
    assert not again.errors


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
def test_a_trigger_without_a_waiting_action_fails() -> None:
    bench = waiting("LOCAL")

    bench.instant(action("t", "NONE", "trigger"))

    assert (bench.status("t"), bench.status("w")) == ("FAILED", "RUNNING")


@pytest.mark.clause("6.2.3/waitForTrigger")
@pytest.mark.parametrize("version", list(RULES))
def test_a_person_at_the_robot_releases_it(version: str) -> None:
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
@pytest.mark.parametrize("version", list(RULES))
def test_a_wait_without_a_usable_trigger_is_refused(version: str) -> None:
    bench = waiting(version=version)

    assert bench.errors == ["INVALID_ORDER_ACTION"]
    assert not bench.state.order_id
