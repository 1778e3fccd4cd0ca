"""Hibernation and shutdown over a broker, with real commands: what is published, and in which order."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from nena_edge_agent import program
from nena_edge_agent.journal import Journal
from nena_shared.clock import SystemClock
from nena_shared.mqtt import Inbound
from nena_shared.tasks import StartError
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import CODECS
from support.broker import Broker, MqttPeer
from support.edge_agent import QUICK, SERIAL, FleetControl, agent_settings, error_types, running_agent
from support.robot_core import action, order
from support.waiting import until

pytestmark = pytest.mark.broker

IN_3 = tuple(each for each in CODECS if each >= "3")
NEVER = "2100-01-01T00:00:00.000Z"
SLEEP = action("s", "NONE", "startHibernation", wakeUpTime=NEVER)
WAKE = action("w", "NONE", "stopHibernation")
SHUTDOWN = action("d", "NONE", "shutdown")
SILENT = (Topic.STATE, Topic.VISUALIZATION)


class Site:
    """One robot, its fleet control, and the file into which its commands write."""

    def __init__(self, peer: MqttPeer, interface_name: str, folder: Path, version: str) -> None:
        self.peer = peer
        self.fleet = FleetControl(peer, interface_name, version=version)
        self.journal = folder / "journal"
        self._file = folder / "commands"

    def noting(self, word: str, then: str = "true") -> list[str]:
        """Return a command that writes ``word`` and the wake-up time, then does something else."""
        return ["sh", "-c", f'echo {word} $NENA_WAKE_UP_TIME >> "$0"; {then}', str(self._file)]

    def power(self, **changes: Any) -> dict[str, Any]:
        commands = {
            "hibernate_command": self.noting("hibernate"),
            "wake_command": self.noting("wake"),
            "shutdown_command": self.noting("shutdown"),
        }
        return commands | changes

    @property
    def commands(self) -> list[str]:
        """What has run so far."""
        return self._file.read_text().splitlines() if self._file.exists() else []

    async def has_run(self, *commands: str) -> None:
        await until(lambda: self.commands == list(commands), what=f"commands {commands}: {self.commands}")

    async def connected(self, *states: str) -> None:
        await until(
            lambda: self.fleet.connections == list(states), what=lambda: f"{states}: {self.fleet.connections}"
        )

    def subject(self, message: Inbound) -> str:
        """Name a message: its topic, or the state of the connection."""
        topic = message.topic.rsplit("/", 1)[-1]
        return json.loads(message.payload)["connectionState"] if topic == Topic.CONNECTION else topic

    @property
    def story(self) -> list[str]:
        """What the robot has published."""
        own = (*SILENT, Topic.CONNECTION)
        topics = [self.fleet.topic(each) for each in own]
        return [self.subject(each) for each in self.peer.history if each.topic in topics]

    def asleep(self) -> list[str]:
        """Return what was published while the robot was hibernating."""
        story = self.story
        begin = story.index("HIBERNATING")
        end = story.index("ONLINE", begin) if "ONLINE" in story[begin:] else len(story)
        return [each for each in story[begin:end] if each in SILENT]


def instant_status(state: dict[str, Any], action_id: str) -> str | None:
    found = (each["actionStatus"] for each in state["instantActionStates"] if each["actionId"] == action_id)
    return next(found, None)


def shows(action_id: str, status: str) -> Callable[[dict[str, Any]], bool]:
    return lambda state: instant_status(state, action_id) == status


@asynccontextmanager
async def site(
    broker: Broker, interface_name: str, folder: Path, version: str = "3.0.1", **changes: Any
) -> AsyncIterator[Site]:
    """Run the agent with commands that note that they ran."""
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        made = Site(peer, interface_name, folder, version)
        async with agent(broker, interface_name, made, version=version, **changes):
            await made.fleet.state()
            yield made


@asynccontextmanager
async def agent(
    broker: Broker, interface_name: str, made: Site, *, version: str = "3.0.1", **changes: Any
) -> AsyncIterator[None]:
    power = made.power(**changes.pop("power", {}))
    settings = agent_settings(broker, interface_name, made.journal, version=version, power=power, **changes)
    async with running_agent(settings):
        yield


@pytest.mark.clause("6.2.3/startHibernation", "6.5")
@pytest.mark.parametrize("version", IN_3)
async def test_a_robot_hibernates_and_wakes(
    broker: Broker, interface_name: str, tmp_path: Path, version: str
) -> None:
    async with site(broker, interface_name, tmp_path, version) as there:
        there.fleet.send(order("n0", "n9"))
        await there.fleet.state(lambda state: state["orderId"] == "o1")
        there.fleet.instant(SLEEP)
        await there.connected("ONLINE", "HIBERNATING")
        await there.has_run(f"hibernate {NEVER}")
        last = there.fleet.states[-1]
        assert (instant_status(last, "s"), last["nodeStates"], last["driving"]) == ("FINISHED", [], False)

        there.fleet.instant(action("i", "NONE", "stateRequest"))
        there.fleet.send(order("n0", "n1", order_id="o2"))
        there.fleet.instant(WAKE)
        await there.connected("ONLINE", "HIBERNATING", "ONLINE")
        awake = await there.fleet.state(shows("w", "FINISHED"))
        assert there.asleep() == []
        assert (awake["orderId"], instant_status(awake, "i")) == ("o1", None)
        assert there.commands == [f"hibernate {NEVER}", "wake"]
        there.fleet.instant(action("i", "NONE", "stateRequest"))
        await there.fleet.state(shows("i", "FINISHED"))


@pytest.mark.clause("6.2.3/startHibernation", "6.6/restart")
async def test_restarted_agent_connects_as_hibernating(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    async with site(broker, interface_name, tmp_path) as there:
        there.fleet.instant(SLEEP)
        await there.has_run(f"hibernate {NEVER}")
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        again = Site(peer, interface_name, tmp_path, "3.0.1")
        await again.connected("OFFLINE")
        async with agent(broker, interface_name, again):
            await again.connected("OFFLINE", "HIBERNATING")
            await peer.wait_for(again.fleet.topic(Topic.FACTSHEET), lambda each: not each.retained)
            assert again.story == ["OFFLINE", "HIBERNATING"]
            again.fleet.instant(WAKE)
            await again.fleet.state(shows("w", "FINISHED"))
            assert again.asleep() == []
            assert again.commands == [f"hibernate {NEVER}", "wake"]


class ShiftedClock(SystemClock):
    """A clock that a test can set."""

    def __init__(self) -> None:
        self.shift = timedelta()

    def now(self) -> datetime:
        return datetime.now(UTC) + self.shift


@pytest.mark.clause("6.2.3/startHibernation")
async def test_robot_wakes_at_its_wake_up_time_even_after_a_suspend(
    broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The monotonic clock stands still meanwhile: only the time of day is set forward."""
    clock = ShiftedClock()
    monkeypatch.setattr(program, "SystemClock", lambda: clock)
    async with site(broker, interface_name, tmp_path) as there:
        there.fleet.instant(SLEEP)
        await there.has_run(f"hibernate {NEVER}")
        clock.shift = timedelta(days=365 * 80)

        await there.connected("ONLINE", "HIBERNATING", "ONLINE")
        assert there.asleep() == []
        assert there.commands == [f"hibernate {NEVER}", "wake"]


@pytest.mark.clause("6.2.3/startHibernation")
async def test_robot_stays_awake_with_a_warning_if_its_command_fails(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        there = Site(peer, interface_name, tmp_path, "3.0.1")
        failing = {"hibernate_command": there.noting("hibernate", "echo battery is hot; exit 3")}
        async with agent(broker, interface_name, there, power=failing):
            await there.fleet.state()
            there.fleet.instant(SLEEP)
            state = await there.fleet.state(lambda state: "POWER_COMMAND_FAILED" in error_types(state))

            (warning,) = (each for each in state["errors"] if each["errorType"] == "POWER_COMMAND_FAILED")
            assert warning["errorLevel"] == "WARNING"
            assert "ended with exit code 3" in warning["errorDescription"]
            assert there.fleet.connections == ["ONLINE", "HIBERNATING", "ONLINE"]
            assert there.commands == [f"hibernate {NEVER}", "wake"]


@pytest.mark.clause("6.2.3/startHibernation")
async def test_hanging_wake_command_is_ended(broker: Broker, interface_name: str, tmp_path: Path) -> None:
    hanging = {"wake_command": ["sleep", "3600"], "command_timeout": 0.2}
    async with site(broker, interface_name, tmp_path, power=hanging) as there:
        there.fleet.instant(SLEEP)
        await there.has_run(f"hibernate {NEVER}")
        there.fleet.instant(WAKE)

        state = await there.fleet.state(shows("w", "FAILED"))
        (shown,) = (each for each in state["instantActionStates"] if each["actionId"] == "w")
        assert shown["actionResult"] == "sleep did not end within 0.2 s"
        assert there.fleet.connections[-1] == "ONLINE"


@pytest.mark.clause("6.2.3/shutdown", "6.5")
@pytest.mark.parametrize("version", IN_3)
async def test_robot_shuts_down_after_announcing_it(
    broker: Broker, interface_name: str, tmp_path: Path, version: str
) -> None:
    async with site(broker, interface_name, tmp_path, version) as there:
        there.fleet.instant(SHUTDOWN)

        await there.has_run("shutdown")
        await there.connected("ONLINE", "OFFLINE")
        assert instant_status(there.fleet.states[-1], "d") == "FINISHED"
        assert there.story[-1] == "OFFLINE"


def full_disk(*_: object) -> None:
    raise OSError(28, "No space left on device")


@pytest.mark.clause("6.2.3/shutdown")
async def test_robot_with_a_failing_disk_shuts_down(
    broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with site(broker, interface_name, tmp_path) as there:
        monkeypatch.setattr(Journal, "write", full_disk)
        there.fleet.instant(SHUTDOWN)

        await there.has_run("shutdown")
        await there.connected("ONLINE", "OFFLINE")
        assert instant_status(there.fleet.states[-1], "d") == "FINISHED"


@pytest.mark.clause("6.2.3/startHibernation")
async def test_robot_with_a_failing_disk_stays_awake(
    broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with site(broker, interface_name, tmp_path) as there:
        with monkeypatch.context() as disk:
            disk.setattr(Journal, "write", full_disk)
            there.fleet.instant(SLEEP)
            await there.fleet.state(lambda state: "JOURNAL_NOT_WRITTEN" in error_types(state))
        await there.fleet.state(shows("s", "FINISHED"))

        there.fleet.send(order("n0", "n1"))
        await there.fleet.state(lambda state: state["orderId"] == "o1")
        assert there.fleet.connections == ["ONLINE"]
        assert there.commands == []


@pytest.mark.clause("6.2.3/shutdown")
async def test_failed_shutdown_ends_the_agent_with_an_error_status(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    missing = {"shutdown_command": [str(tmp_path / "missing")]}

    async def shut_down() -> None:
        async with site(broker, interface_name, tmp_path, power=missing) as there:
            there.fleet.instant(SHUTDOWN)
            await there.connected("ONLINE", "OFFLINE")

    with pytest.raises(StartError, match=r"could not be shut down: .*missing cannot be started"):
        await shut_down()


@pytest.mark.clause("6.2.3/shutdown")
async def test_other_robots_of_the_fleet_continue(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    loopback = {**QUICK, "count": 2, "power": True}
    settings = agent_settings(broker, interface_name, tmp_path, version="3.0.0", loopback=loopback)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        first, second = (
            FleetControl(peer, interface_name, f"{SERIAL}-{number}", "3.0.0") for number in (1, 2)
        )
        async with running_agent(settings):
            await asyncio.gather(first.state(), second.state())
            first.instant(SHUTDOWN)
            await until(lambda: first.connections == ["ONLINE", "OFFLINE"])

            second.instant(SLEEP)
            await until(lambda: second.connections == ["ONLINE", "HIBERNATING"])
            second.instant(WAKE)
            await second.state(shows("w", "FINISHED"))
        assert first.connections == ["ONLINE", "OFFLINE"]


@pytest.mark.clause("6.2.3/startHibernation", "6.2.3/shutdown", "7.10")
@pytest.mark.parametrize(
    ("commands", "listed"),
    [
        ({}, set()),
        ({"hibernate_command": ["true"]}, {"startHibernation", "stopHibernation"}),
        ({"shutdown_command": ["true"]}, {"shutdown"}),
    ],
)
@pytest.mark.parametrize("version", ["2.1.0", *IN_3])
async def test_factsheet_lists_actions_with_a_command(
    broker: Broker,
    interface_name: str,
    tmp_path: Path,
    *,
    version: str,
    commands: dict[str, Any],
    listed: set[str],
) -> None:
    settings = agent_settings(broker, interface_name, tmp_path, version=version, power=commands)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name, version=version)
        async with running_agent(settings):
            message = await peer.wait_for(fleet.topic(Topic.FACTSHEET))

    features = json.loads(message.payload)["protocolFeatures"]
    actions = features.get("mobileRobotActions") or features.get("agvActions")
    offered = {each["actionType"] for each in actions}
    assert offered & {"startHibernation", "stopHibernation", "shutdown"} == (
        listed if version in IN_3 else set()
    )
