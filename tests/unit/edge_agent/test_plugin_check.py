"""The helper for tests of plug-ins: a correct plug-in passes, and every deliberately bad one is found."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest
from pydantic import JsonValue

from nena_edge_agent.actions.plugin import ActionTimeouts, RosError
from nena_edge_agent.driver.port import Pose
from nena_edge_agent.plugin_check import (
    BLOCKED_SAMPLES,
    SAMPLE_INTERVAL,
    ContractError,
    DryDrive,
    DryRos,
    PluginTrials,
    Watchdog,
    check_plugin,
    sample_value,
)
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from support.bad_plugins import BAD, NODE, Good, made
from support.pausing import time_passes
from support.waiting import until

SHORT = ActionTimeouts(begin=0.3, obey=0.3)
LONG = ActionTimeouts(begin=30.0, obey=30.0)
PAGE = (Path(__file__).parents[3] / "docs" / "actions.md").read_text(encoding="utf-8")


async def test_a_correct_plug_in_meets_the_contract() -> None:
    await check_plugin(Good(), timeouts=LONG)


@pytest.mark.parametrize("name", list(BAD))
async def test_violations_of_the_contract_are_found(name: str) -> None:
    plugin, problem = BAD[name]

    with pytest.raises(ContractError, match=problem):
        await check_plugin(plugin, seconds=0.5 if name == "never ends" else 30.0, timeouts=SHORT)


async def test_the_plug_in_and_the_test_of_the_guide_work() -> None:
    part = PAGE.split("## A plug-in of your own")[1]
    plugin, test = re.findall(r"```python\n(.*?)```", part, re.DOTALL)
    names: dict[str, object] = {"__name__": "acme_forks"}
    exec(plugin, names)  # noqa: S102 - our own page
    exec(test.replace("from acme_forks import Forks", ""), names)  # noqa: S102

    await names["test_forks_keep_the_contract"]()  # type: ignore[operator]


@pytest.mark.parametrize("data_type", list(ValueDataType))
def test_a_sample_is_a_valid_value_of_the_parameter(data_type: ValueDataType) -> None:
    parameter = Parameter("key", data_type)

    assert parameter.problem(sample_value(parameter)) is None


@pytest.mark.parametrize(
    ("parameter", "expected"),
    [
        (Parameter("key", ValueDataType.NUMBER, minimum=2.5), 2.5),
        (Parameter("key", ValueDataType.INTEGER, minimum=2.5), 3),
        (Parameter("key", ValueDataType.NUMBER, maximum=0.5), 0.5),
        (Parameter("key", ValueDataType.NUMBER, maximum=-1), -1.0),
        (Parameter("key", ValueDataType.NUMBER, maximum=0), 0.0),
        (Parameter("key", ValueDataType.STRING, choices=("b", "a")), "b"),
    ],
)
def test_a_sample_is_within_the_allowed_values(parameter: Parameter, expected: JsonValue) -> None:
    assert sample_value(parameter) == expected
    assert parameter.problem(expected) is None


def test_an_action_has_its_required_and_its_given_parameters() -> None:
    needed, optional = Parameter("a", ValueDataType.BOOL), Parameter("b", ValueDataType.BOOL, required=False)
    plugin = made(declaration=ActionDeclaration("x", NODE, (needed, optional)))
    trials = PluginTrials(plugin, {"c": 1}, 1.0, SHORT)

    first, second = trials.make_action(), trials.make_action()
    assert {each.key: each.value for each in first.action_parameters} == {"a": True, "c": 1}
    assert first.action_id != second.action_id
    assert first.blocking_type is BlockingType.HARD
    instant = PluginTrials(made(declaration=ActionDeclaration("x", (ActionScope.INSTANT,))), {}, 1.0, SHORT)
    assert instant.make_action().blocking_type is BlockingType.NONE


async def test_messages_are_checked_and_services_succeed() -> None:
    ros = DryRos()
    publisher = ros.publisher("lift", "std_msgs/msg/String")
    publisher.publish({"data": "up"})
    assert publisher.listeners == 1
    with pytest.raises(RosError, match="no such field"):
        publisher.publish({"date": "up"})

    clamp = ros.client("clamp", "std_srvs/srv/SetBool")
    assert await clamp.call({"data": True}, seconds=1.0) == {"success": True, "message": ""}
    assert await ros.client("clear", "std_srvs/srv/Empty").call({}, seconds=1.0) == {}
    with pytest.raises(RosError, match="not true or false"):
        await clamp.call({"data": 1}, seconds=1.0)


def test_types_must_be_installed() -> None:
    ros = DryRos()
    for ask in (
        lambda: ros.publisher("x", "acme_msgs/msg/Lift"),
        lambda: ros.subscribe("x", "acme_msgs/msg/Lift", print),
        lambda: ros.client("x", "acme_msgs/srv/Lift"),
    ):
        with pytest.raises(RosError, match="is not installed"):
            ask()


async def test_drives_succeed() -> None:
    drive = DryDrive()
    await drive.drive(Pose(1.0, 2.0, 0.0, "map"), deviation_xy=0.1)

    assert drive.pose == Pose(1.0, 2.0, 0.0, "map")


async def test_an_idle_event_loop_is_not_blocked() -> None:
    dog = Watchdog()
    for _ in range(BLOCKED_SAMPLES * 4):
        await time_passes(SAMPLE_INTERVAL / 2)
    dog.stop()

    assert dog.blocked == ""


@pytest.mark.filterwarnings("ignore")
async def test_a_blocked_event_loop_is_detected_with_the_location() -> None:
    dog = Watchdog()
    await until(lambda: dog._rounds > 1)
    end = time.monotonic() + 30.0
    while not dog.blocked and time.monotonic() < end:
        pass
    dog.stop()

    assert "test_a_blocked_event_loop_is_detected_with_the_location" in dog.blocked
