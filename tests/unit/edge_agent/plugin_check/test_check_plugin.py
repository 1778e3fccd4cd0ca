"""The command check-plugin: what it prints, and its exit status."""

from __future__ import annotations

from pathlib import Path

import pytest

from nena_edge_agent.actions.plugin import RosError
from nena_edge_agent.driver.port import Pose
from nena_edge_agent.plugin_check.command import DryDrive, DryRos, main, report
from nena_edge_agent.plugin_check.contract import Finding, Verdict

SETTINGS = """
[[operations]]
kind = "service"
action_type = "clamp"
[operations.call]
service = "clamp"
type = "std_srvs/srv/SetBool"
fields = { %s = true }
"""


def settings(folder: Path, field: str = "data") -> str:
    file = folder / "agent.toml"
    file.write_text(SETTINGS % field, encoding="utf-8")
    return str(file)


def test_a_configured_action_is_checked_without_a_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["clamp", "--config", settings(tmp_path), "--timeout", "1"]) == 0

    out = capsys.readouterr().out
    assert out.startswith("clamp\n  ok        Declaration: 'clamp' for NODE; parameters: none\n")
    assert "skipped   Cancel: the declaration does not allow cancelling" in out
    assert out.endswith("Passed: the plug-in keeps the contract.\n")


@pytest.mark.parametrize(
    ("name", "field", "problem"),
    [
        ("clmp", "data", "setting NAME: 'clmp' is not a plug-in"),
        (
            "clamp",
            "dat",
            "setting operations.0.call.fields.dat: std_srvs/srv/SetBool request has no such field",
        ),
    ],
)
def test_usage_errors_are_reported_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, field: str, problem: str
) -> None:
    assert main([name, "--config", settings(tmp_path, field)]) == 2
    assert problem in capsys.readouterr().err


def test_parameters_are_read_from_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wait", "--parameters", '{"duration": "long"}', "--timeout", "1"]) == 0
    assert "skipped   Check of parameters: action 'wait': parameter 'duration'" in capsys.readouterr().out


@pytest.mark.parametrize("parameters", ["[1]", "{", "[" * 100_000])
def test_invalid_parameters_are_refused(parameters: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["wait", "--parameters", parameters])
    assert "argument --parameters: " in capsys.readouterr().err


def test_problems_are_reported_with_a_remedy() -> None:
    text = report("lift", [Finding("Cancel", Verdict.BROKEN, "no end", "report FAILED")])

    assert text == "lift\n  BROKEN    Cancel: no end\n            -> report FAILED\n  1 broken\n"


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
