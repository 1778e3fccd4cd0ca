"""Conversations recorded as fixtures: fleet control and one loopback agent, over a real broker.

``python -m support.conversations FOLDER`` records all of them again (``make conversations``).
"""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.loopback_bench import BenchRobot, bench_process, errors, idle
from support.robot_core import action, order
from support.waiting import PATIENCE, until
from support.zones import responses, transfer, zone

FOLDER = Path(__file__).parents[1] / "fixtures" / "conversations"
INTERFACE = "fleet"

Story = Callable[[BenchRobot], Awaitable[None]]


async def order_with_actions(robot: BenchRobot) -> None:
    """An order with actions on nodes and on an edge."""
    pick, lamp = action("pick-1", "HARD", "pick"), action("wait-1", "NONE", "wait", duration=0.1)
    await robot.begin("n0", "n1", "n2", node_actions={"n1": [pick]}, edge_actions={"n1-n2": [lamp]})
    await robot.finish("n2")


async def updates(robot: BenchRobot) -> None:
    """A base that is extended twice, the second time with a new horizon."""
    first = await robot.begin("n0", "n1", "n2", released=2)
    second = order("n1", "n2", "n3", "n4", order_id=first.order_id, update=1, first=2, released=2)
    robot.fleet.send(second)
    await robot.state(lambda state: state.order_update_id == 1)
    robot.fleet.send(order("n2", "n3", "n5", order_id=first.order_id, update=2, first=4))
    await robot.state(lambda state: state.order_update_id == 2)
    await robot.finish("n5")


async def cancel(robot: BenchRobot) -> None:
    """A cancel between nodes, and the next order from there; a cancel of nothing."""
    await robot.begin("n0", "n1", "n2", node_actions={"n2": [action("drop-1", "HARD", "drop")]})
    await robot.state(lambda state: state.driving)
    await robot.cancel()
    robot.fleet.instant(action("cancel-again", "NONE", "cancelOrder"))
    await robot.state(lambda state: any("NO_ORDER_TO_CANCEL" in each for each in errors(state)))


async def pause(robot: BenchRobot) -> None:
    """A pause during a drive, and its end."""
    await robot.begin("n0", "n1")
    await robot.state(lambda state: state.driving)
    robot.fleet.instant(action("p", "NONE", "startPause"))
    await robot.state(lambda state: state.paused and not state.driving)
    robot.fleet.instant(action("s", "NONE", "stopPause"))
    await robot.state(lambda state: not state.paused)
    await robot.finish("n1")


async def refusals(robot: BenchRobot) -> None:
    """Rejected orders (wrong start node, unknown action), then an accepted one."""
    robot.fleet.send(order("n7", "n8", order_id="far"))
    await robot.state(errors)
    robot.fleet.send(order("n0", "n1", order_id="dance", node_actions={"n1": [action("d", "HARD", "dance")]}))
    await robot.state(lambda state: len(state.errors) > 1)
    await robot.begin("n0", "n1")
    await robot.finish("n1")


async def failure(robot: BenchRobot) -> None:
    """An action that fails, so that the rest of the order is cancelled."""
    await robot.begin("n0", "n1", "n2", node_actions={"n1": [action("f", "HARD", "failAlways")]})
    await robot.state(lambda state: "ACTION_FAILED" in errors(state))
    await robot.cancel()


async def retry(robot: BenchRobot) -> None:
    """An action that fails, is retried, and succeeds."""
    await robot.begin("n0", "n1", node_actions={"n0": [action("f", "HARD", "failOnce", retriable=True)]})
    await robot.state(
        lambda state: any(each.action_status.value == "RETRIABLE" for each in state.action_states)
    )
    robot.fleet.instant(action("r", "NONE", "retry", actionId="f"))
    await robot.finish("n1")
    robot.fleet.instant(action("clear", "NONE", "clearInstantActions"))
    await robot.state(lambda state: [each.action_id for each in state.instant_action_states] == ["clear"])


async def zones(robot: BenchRobot) -> None:
    """A zone set that is downloaded and enabled, and a zone that is entered with a release."""
    robot.fleet.publish(Topic.ZONE_SET, transfer(zone("gate", "RELEASE", 13, 17)))
    await robot.state(lambda state: bool(state.zone_sets))
    robot.fleet.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))
    await robot.begin("n0", "n1", "n2")
    waiting = await robot.state(lambda state: state.zone_requests and state.last_node_id == "n1")
    (request,) = waiting.zone_requests or ()
    robot.fleet.publish(Topic.RESPONSES, responses(request.request_id, "GRANTED"))
    await robot.finish("n2")


COMMON: tuple[Story, ...] = (order_with_actions, updates, cancel, pause, refusals, failure)
STORIES: dict[str, tuple[Story, ...]] = {
    "2.0.0": COMMON,
    "2.1.0": COMMON,
    "3.0.0": (*COMMON, retry, zones),
}


async def record(story: Story, version: str, file: Path) -> None:
    """Record one conversation, from before the agent's first message."""
    broker = Broker()
    try:
        with TemporaryDirectory() as folder:
            await _record(broker, story, version, file, Path(folder))
    finally:
        broker.close()


async def _record(broker: Broker, story: Story, version: str, file: Path, folder: Path) -> None:
    with recorder(broker, file):
        await until(lambda: "nena-listen" in broker.log and "SUBSCRIBE" in broker.log, what="the recorder")
        with (
            MqttPeer(broker, f"{INTERFACE}/#") as peer,
            bench_process(broker, INTERFACE, folder, version, "--interval.visualization", "0") as process,
        ):
            robot = BenchRobot(peer, INTERFACE, version=version)
            robot.fleet.honest_headers = True
            await robot.state(idle)
            await story(robot)
            process.terminate()
            await until(lambda: "OFFLINE" in robot.fleet.connections, what="the robot's farewell")


@contextmanager
def recorder(broker: Broker, file: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run ``nena vda5050 record`` until the block ends."""
    file.unlink(missing_ok=True)
    command = ["vda5050", "record", f"mqtt://{broker.host}:{broker.port}", str(file)]
    process = subprocess.Popen([sys.executable, "-m", "nena_cli", *command])
    try:
        yield process
    finally:
        process.terminate()
        process.wait(PATIENCE)


async def record_all(folder: Path) -> None:
    """Record every conversation in every version that supports it; the folder must exist."""
    for version, stories in STORIES.items():
        for story in stories:
            await record(story, version, folder / f"{version}-{story.__name__}.jsonl")


if __name__ == "__main__":
    asyncio.run(record_all(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER))
