"""The edge agent's extension of docs/extensions.md works when it is installed as its page says."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from nena_edge_agent.__main__ import main
from nena_edge_agent.extension import GROUP, installed
from support.broker import Broker, MqttPeer
from support.edge_agent import MANUFACTURER, QUICK, SERIAL, FleetControl, agent_settings, ended, running_agent
from support.extension_packages import install, install_example
from support.robot_core import order
from support.waiting import awaited, until

pytestmark = pytest.mark.broker

BROKEN = """
from nena_edge_agent.extension import Extension

class Broken(Extension):
    def _fail(self, *_):
        raise ValueError

    on_start = on_event = on_connect = on_message = on_record = on_end = _fail
"""


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a folder from which Python imports packages."""
    monkeypatch.syspath_prepend(tmp_path)
    installed.cache_clear()
    yield tmp_path
    installed.cache_clear()
    sys.modules.pop("acme_alarms", None)


async def command(peer: MqttPeer, control: str) -> list[bytes]:
    """Make all nodes unreachable; return the answers, none before the robot's control is connected."""
    peer.publish(f"{control}/control", b'{"command": "unreachable"}')
    return peer.payloads(f"{control}/answer")


async def test_the_example_tells_of_a_failed_drive(
    broker: Broker, interface_name: str, packages: Path
) -> None:
    install_example(packages, GROUP, "acme_alarms")
    topic = f"{interface_name}/alarms/{MANUFACTURER}/{SERIAL}"
    alarms = installed()["alarms"].Settings.model_validate({"topic": f"{interface_name}/alarms"})
    loopback = QUICK | {"control": True}
    settings = agent_settings(broker, interface_name, packages / "journal", loopback=loopback)
    settings = settings.model_copy(update={"alarms": alarms})
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name)
        async with running_agent(settings):
            await fleet.state()
            control = f"{interface_name}/loopback/{fleet.robot}"
            await awaited(partial(command, peer, control), bool, what="the answer to a command", every=0.2)
            fleet.send(order("n0", "n1", order_id="o-1"))
            (alarm,) = await until(lambda: peer.payloads(topic), what="the alarm")
    assert json.loads(alarm)["order"] == "o-1"


@pytest.mark.provokes_failures
async def test_an_extension_that_fails_does_not_stop_the_robot(
    broker: Broker, interface_name: str, packages: Path
) -> None:
    install(packages, "acme_failing_agent", BROKEN, group=GROUP, entry="broken = acme_failing_agent:Broken")
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name)
        async with running_agent(agent_settings(broker, interface_name, packages / "journal")):
            await fleet.state()
            fleet.send(order("n0", "n1", order_id="o-1"))
            await fleet.state(ended("o-1"))


@pytest.mark.parametrize(
    ("code", "why"), [("import nothing_of_this_name", "nothing_of_this_name"), ("Alarms = int", "is no")]
)
def test_an_extension_that_cannot_be_loaded_ends_the_program_with_the_reason(
    packages: Path, capsys: pytest.CaptureFixture[str], code: str, why: str
) -> None:
    install(packages, "acme_alarms", code, group=GROUP, entry="alarms = acme_alarms:Alarms")
    assert main([]) == 1
    message = capsys.readouterr().err
    assert "'alarms' (acme_alarms:Alarms)" in message
    assert why in message
