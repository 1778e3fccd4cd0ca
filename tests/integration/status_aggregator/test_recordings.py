"""Recordings travel from a robot over the broker to the aggregator, and open as MCAP."""

from __future__ import annotations

import io
import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from mcap.reader import make_reader

from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared import log
from nena_shared.extensions.black_box.transfer import CHUNK_SIZE
from nena_shared.settings import LogSettings
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer
from support.edge_agent import (
    MANUFACTURER,
    QUICK,
    SERIAL,
    AgentProcess,
    FleetControl,
    agent_settings,
    running_agent,
    status_of,
)
from support.robot_core import action, order
from support.served_aggregator import Served, serving
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ROBOT = f"{MANUFACTURER}/{SERIAL}"


@pytest.fixture
def fleet(broker: Broker, interface_name: str) -> Iterator[FleetControl]:
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        yield FleetControl(peer, interface_name)


def recorded(broker: Broker, interface_name: str, folder: Path) -> EdgeAgentSettings:
    """Return the settings of a robot with a black box."""
    return agent_settings(
        broker,
        interface_name,
        folder / "journal",
        black_box={"enabled": True, "delay": 0.2},
        upload={"folder": folder / "outgoing", "enabled": True},
        log_report={"folder": folder / "reports"},
        loopback=QUICK | {"control": True},
    )


async def arrived(served: Served, ending: str) -> str:
    """Wait for a recording whose name has this end; return its name."""
    found = await served.until(
        f"/api/v1/recordings?robot={ROBOT}",
        lambda files: any(each["name"].endswith(ending) for each in files),
    )
    return next(str(each["name"]) for each in found if each["name"].endswith(ending))


async def content(served: Served, name: str) -> bytes:
    answer = await served.http.get(f"/api/v1/recordings/{ROBOT}/{name}")
    assert answer.status_code == 200
    return answer.content


def by_topic(file: bytes) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    reader = make_reader(io.BytesIO(file), validate_crcs=True)
    messages: Any = reader.iter_messages()
    for _, channel, message in messages:
        found.setdefault(channel.topic, []).append(json.loads(message.data))
    return found


async def make_unreachable(fleet: FleetControl, place: str) -> None:
    """Make the node n2 unreachable; the command is repeated until the robot's control is there."""
    command = json.dumps({"command": "unreachable", "x": 20, "y": 0}).encode()

    async def ask() -> list[bytes]:
        fleet.peer.publish(f"{place}/control", command)
        return fleet.peer.payloads(f"{place}/answer")

    await awaited(ask, bool, seconds=PATIENCE, what="an answer", every=0.2)


async def test_a_failed_drive_ends_up_as_a_readable_file(
    broker: Broker, interface_name: str, tmp_path: Path, fleet: FleetControl
) -> None:
    log.configure(LogSettings())
    kept = {"recordings": {"folder": tmp_path / "received"}}
    settings = recorded(broker, interface_name, tmp_path)
    async with serving(broker, interface_name, **kept) as served, running_agent(settings):
        await fleet.state()
        await make_unreachable(fleet, f"{interface_name}/loopback/{ROBOT}")
        fleet.send(order("n0", "n1", "n2", order_id="o-1"))
        name = await arrived(served, "-drive-failed.mcap")
        found = by_topic(await content(served, name))

    base = f"{interface_name}/v2/{ROBOT}"
    assert [each["orderId"] for each in found[f"{base}/order"]] == ["o-1"]
    assert found[f"{base}/state"][-1]["errors"]
    assert found[f"{base}/connection"][0]["connectionState"] == "ONLINE"
    assert found["/nena/journal"]
    assert any("order received" in each["message"] for each in found["/nena/log"])
    assert not any("recordings" in topic for topic in found)


async def test_requested_recordings_and_log_reports_arrive_also_at_a_late_aggregator(
    broker: Broker, interface_name: str, tmp_path: Path, fleet: FleetControl
) -> None:
    kept = {"recordings": {"folder": tmp_path / "received"}}
    settings = recorded(broker, interface_name, tmp_path)
    async with running_agent(settings):
        await fleet.state()
        fleet.instant(action("i-1", "NONE", "nena:fetchRecording"))
        fleet.instant(action("i-2", "NONE", "logReport", reason="it hums"))
        await fleet.state(lambda state: {status_of(state, each) for each in ("i-1", "i-2")} == {"FINISHED"})
        async with serving(broker, interface_name, **kept) as served:
            assert by_topic(await content(served, await arrived(served, "-request.mcap")))
            report = await content(served, await arrived(served, ".log"))
    assert report.startswith(b"log report: it hums\n")


BIG = "20260102T030405.678Z-error.mcap"
CHUNKS = 12
RATE = 100_000
"""Bytes per second: a chunk takes a third of a second."""


def received_bytes(folder: Path) -> int:
    """Return how much of an unfinished file the aggregator has."""
    return sum(each.stat().st_size for each in folder.rglob("*.part"))


async def at_least(folder: Path, chunks: int) -> None:
    """Wait until the aggregator has so many chunks, and not yet all."""
    await until(lambda: received_bytes(folder) >= chunks * CHUNK_SIZE)
    assert received_bytes(folder) < CHUNKS * CHUNK_SIZE


async def test_a_transfer_survives_the_death_of_either_side(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    content = random.Random(1).randbytes(CHUNKS * CHUNK_SIZE)
    outgoing, received = tmp_path / "outgoing", tmp_path / "received"
    waiting = outgoing / f"{MANUFACTURER}%2F{SERIAL}" / BIG
    waiting.parent.mkdir(parents=True)
    waiting.write_bytes(content)
    topics = ("--interface_name", interface_name, "--topic_prefix", f"{interface_name}/nena")
    options = (
        *("--mqtt.port", str(broker.port), "--mqtt.reconnect_max", "0.2", "--history.url", "none", *topics),
        *("--http.port", "0", "--recordings.folder", str(received)),
    )
    sender = ("--upload.enabled", "--upload.folder", str(outgoing), "--upload.rate", str(RATE))
    with AgentProcess(broker, interface_name, tmp_path / "journal", *sender) as agent:
        with AggregatorProcess(*options) as first:
            await at_least(received, 2)
            agent.kill()
            agent.restart()
            await at_least(received, 4)
            first.process.kill()
        before = received_bytes(received)
        with AggregatorProcess(*options) as second:
            async with httpx.AsyncClient(base_url=await second.url(), timeout=PATIENCE) as client:

                async def listed() -> Any:
                    return (await client.get("/api/v1/recordings")).json()

                (found,) = await awaited(listed, bool, seconds=PATIENCE, what="the whole file")
                path = f"/api/v1/recordings/{ROBOT}/{BIG}"
                assert (await client.get(path)).content == content
            await until((waiting.parent / "sent" / BIG).is_file)
            assert [each.name for each in received.rglob("*") if each.is_file()] == [BIG]
            assert len(second.events("recording received")) == 1
    assert (found["robot"], found["size"]) == (ROBOT, len(content))
    assert before >= 4 * CHUNK_SIZE
