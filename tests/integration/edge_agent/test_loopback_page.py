"""What docs/loopback.md shows works, line by line, and its tables are complete."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import get_args

import pytest

from nena_edge_agent.loopback.actions import simulated_actions
from nena_edge_agent.loopback.control import AnyCommand
from nena_edge_agent.loopback.settings import LoopbackSettings
from support.broker import Broker, MqttPeer
from support.loopback_bench import BenchRobot
from support.waiting import PATIENCE

PAGE = (Path(__file__).parents[3] / "docs" / "loopback.md").read_text(encoding="utf-8")


def commands(program: str) -> list[list[str]]:
    """Return the words of each call of ``program`` on the page."""
    blocks = "".join(re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)).replace("\\\n", " ")
    words = shlex.split(blocks)
    programs = ("mosquitto", "mosquitto_pub", "mosquitto_sub", "nena-edge-agent")
    starts = [index for index, word in enumerate(words) if word in programs] + [len(words)]
    calls = [words[start:end] for start, end in pairwise(starts)]
    return [[word for word in call[1:] if word != "&"] for call in calls if call[0] == program]


def first_column(heading: str) -> list[str]:
    """Return the names in the first column of the table under a heading, or after a line."""
    table = PAGE.split(heading, 1)[1].split("|---", 1)[1]
    return [
        name
        for row in table.split("\n\n", 1)[0].splitlines()[1:]
        for name in re.findall(r"`(.*?)`", row.split("|")[1])
    ]


@contextmanager
def shown_agent(broker: Broker, folder: Path) -> Iterator[None]:
    """Run the edge agent as the page starts it, at this broker."""
    (options,) = commands("nena-edge-agent")
    here = ["--mqtt.port", str(broker.port), "--journal.folder", str(folder)]
    with subprocess.Popen([sys.executable, "-m", "nena_edge_agent", *options, *here]) as process:
        try:
            yield
        finally:
            process.terminate()


def publish(broker: Broker, call: list[str]) -> None:
    subprocess.run(["mosquitto_pub", "-p", str(broker.port), *call], check=True, timeout=PATIENCE)


@pytest.mark.broker
@pytest.mark.e2e
async def test_the_commands_work(own_broker: Broker, tmp_path: Path) -> None:
    if shutil.which("mosquitto_pub") is None:
        pytest.skip("the page's commands need mosquitto_pub: apt-get install mosquitto-clients")
    calls = commands("mosquitto_pub")
    assert len(calls) > 20
    with MqttPeer(own_broker, "uagv/#") as peer, shown_agent(own_broker, tmp_path):
        robot = BenchRobot(peer, "uagv", version="2.1.0")
        await robot.command("speed", speed=1)

        for call in calls:
            expected = len(robot.answers) + 1
            publish(own_broker, call)
            if call[call.index("-t") + 1].endswith("/order"):
                await robot.state(lambda state: state.order_id == "first" and state.driving)
                continue
            await robot.answered(expected)
            assert robot.answers[-1]["accepted"], robot.answers[-1]


def test_every_command_is_documented() -> None:
    names = {get_args(each.model_fields["command"].annotation)[0] for each in get_args(AnyCommand)}

    assert set(first_column("All commands:")) == names
    shown = set(re.findall(r'"command": "(\w+)"', PAGE))
    assert shown == names


def test_every_setting_is_documented() -> None:
    assert set(first_column("## Settings")) == set(LoopbackSettings.model_fields)


def test_every_simulated_action_is_documented() -> None:
    names = [each.declaration.action_type for each in simulated_actions()]

    assert first_column("## Simulated actions") == names
