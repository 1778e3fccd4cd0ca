"""The checker of the faults finds what it is meant to find, in forged conversations."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from faults.checker import MOST_JOURNAL_KB, Account, check, check_journals, told_in
from nena_shared.fleet_api.transport_order import TransportOrderState, TransportOrderStatus
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_1 import CODEC
from support.executions import ended_actions, executions
from support.fleet_examples import order_status, state

NAME = "T-1"
STATUS = "nena/v1/transportOrders/any/status"
LATER = 1000.0
"""Seconds."""


class Robot:
    """Reports its actions, with headers as the edge agent makes them."""

    def __init__(self, serial: str = "loop-1", *, start: float = 0.0) -> None:
        self._robot = RobotKey("NeNa", serial)
        self._number = 0
        self._start = start

    def says(self, order_id: str, status: str, action: str = "") -> Inbound:
        """Report the status of an order's action, a second after the previous report."""
        self._number += 1
        operation = {
            "action_id": action or f"of {order_id.partition('~')[0]}",
            "action_type": "drop" if order_id.startswith(f"{NAME}-1") else "pick",
            "action_status": status,
        }
        said = state(
            self._number,
            robot=self._robot,
            at=self._start + self._number,
            order_id=order_id,
            action_states=(operation,),
        )
        return Inbound(f"uagv/v2/NeNa/{self._robot.serial_number}/state", CODEC.encode(said), retained=False)

    def does(self, order_id: str, action: str = "") -> list[Inbound]:
        """Work off an order."""
        return [self.says(order_id, status, action) for status in ("WAITING", "RUNNING", "FINISHED")]

    def sets_its_clock_back(self) -> None:
        """Repeat the same timestamps from now on."""
        self._start -= self._number


def status(end: str = "FINISHED", name: str = NAME) -> TransportOrderStatus:
    return order_status(name, 9, TransportOrderState(end), processing_vehicle="loop-1")


def judge(
    states: Iterable[Inbound],
    *,
    store: Iterable[TransportOrderStatus] | None = None,
    told: Iterable[TransportOrderStatus] | None = None,
    log: str = "",
    answered: Iterable[str] = (NAME,),
) -> None:
    """Run the checker on an order that, by default, was stored and reported as finished."""
    known = [status()] if store is None else list(store)
    messages = [
        Inbound(STATUS, each.model_dump_json(by_alias=True).encode(), retained=False)
        for each in (known if told is None else told)
    ]
    done = executions(states)
    done += ended_actions(log) - set(done)
    account = Account({each.name: each for each in known}, told_in(messages), done)
    check(account, set(answered))


def both_legs(robot: Robot) -> list[Inbound]:
    return [*robot.does(f"{NAME}-0"), *robot.does(f"{NAME}-1")]


def test_a_lost_order_is_detected() -> None:
    with pytest.raises(AssertionError, match=r"lost: .*T-2"):
        judge(both_legs(Robot()), answered=(NAME, "T-2"))


def test_an_unrequested_order_is_detected() -> None:
    with pytest.raises(AssertionError, match=r"nobody gave: .*T-2"):
        judge(both_legs(Robot()), store=[status(), status(name="T-2")])


def test_unrequested_work_is_detected() -> None:
    robot = Robot()

    with pytest.raises(AssertionError, match=r"done without an order: .*T-2-0"):
        judge([*both_legs(robot), *robot.does("T-2-0")])


def again_by_the_same_robot(robot: Robot) -> list[Inbound]:
    return robot.does(f"{NAME}-0")


def again_after_a_restart_that_forgot_it(_: Robot) -> list[Inbound]:
    return Robot(start=LATER).does(f"{NAME}-0")


def again_with_the_clock_set_back(robot: Robot) -> list[Inbound]:
    robot.sets_its_clock_back()
    return both_legs(robot)


def again_by_another_robot(_: Robot) -> list[Inbound]:
    return Robot("loop-2").does(f"{NAME}-0")


def again_by_a_second_try(robot: Robot) -> list[Inbound]:
    return robot.does(f"{NAME}-0~1", "of the second try")


def again_by_a_second_try_with_the_same_action(robot: Robot) -> list[Inbound]:
    return robot.does(f"{NAME}-0~1")


def again_under_a_new_action(robot: Robot) -> list[Inbound]:
    return robot.does(f"{NAME}-0", "made anew")


@pytest.mark.parametrize(
    "again",
    [
        again_by_the_same_robot,
        again_after_a_restart_that_forgot_it,
        again_with_the_clock_set_back,
        again_by_another_robot,
        again_by_a_second_try,
        again_by_a_second_try_with_the_same_action,
        again_under_a_new_action,
    ],
)
@pytest.mark.parametrize("end", ["FINISHED", "FAILED"])
def test_repeated_executions_are_detected(again: Callable[[Robot], list[Inbound]], end: str) -> None:
    robot = Robot()
    first = both_legs(robot)

    with pytest.raises(AssertionError, match="done twice"):
        judge([*first, *again(robot)], store=[status(end)])


def test_a_load_dropped_by_another_robot_is_detected() -> None:
    with pytest.raises(AssertionError, match="set down by another robot"):
        judge([*Robot().does(f"{NAME}-0"), *Robot("loop-2").does(f"{NAME}-1")])


def test_falsely_reported_executions_are_detected() -> None:
    said = Robot().does(f"{NAME}-0")

    with pytest.raises(AssertionError, match=r"told as done, and not done: .*T-1-1"):
        judge(said)


def logged(order: str, *, robot: str = "loop-1", status: str = "FINISHED", action: str = "a") -> str:
    """Return a line of the edge agent's log."""
    return (
        "2026-11-23T06:32:04.586512Z [info     ] action ended                   "
        f"action={action} module=nena_edge_agent.agent order={order} "
        f"robot=NeNa/{robot} status={status} type=pick\n"
    )


def test_messages_lost_by_the_broker_are_read_from_robot_logs() -> None:
    said = Robot().does(f"{NAME}-0")

    judge(said, log=logged(f"{NAME}-1~1"))
    for log in (logged(f"{NAME}-1", status="FAILED"), logged(f"{NAME}-10")):
        with pytest.raises(AssertionError, match=r"not done|without an order"):
            judge(said, log=log)


def test_repeated_actions_in_the_logs_are_detected() -> None:
    said = both_legs(Robot())

    with pytest.raises(AssertionError, match="done twice"):
        judge(said, log=logged(f"{NAME}-1", robot="loop-2"))


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ([], "was never told of"),
        ([status("BEING_PROCESSED")], "was last told as BEING_PROCESSED"),
        ([status("FAILED")], "was last told as FAILED"),
        ([status("FAILED"), status()], "ended in several ways"),
    ],
)
def test_published_and_stored_differences_are_detected(told: list[TransportOrderStatus], said: str) -> None:
    with pytest.raises(AssertionError, match=said):
        judge(both_legs(Robot()), told=told)


def test_a_growing_journal_is_detected(tmp_path: Path) -> None:
    for name, size in (("loop-1", MOST_JOURNAL_KB * 1024), ("loop-2", MOST_JOURNAL_KB * 1024 + 1)):
        (tmp_path / name).write_bytes(bytes(size))

    check_journals([tmp_path / "loop-1"])
    with pytest.raises(AssertionError, match="loop-2"):
        check_journals(tmp_path.iterdir())
    with pytest.raises(AssertionError, match="no robot has a journal"):
        check_journals([])
