"""Two aggregators that divide the robots, as processes, and one Prometheus over them."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from nena_shared.vda5050.topics import RobotKey, Topic
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer
from support.fleet_examples import state, vehicle_status
from support.panel import Hall, seconds_now
from support.prometheus import Prometheus, eventually
from support.waiting import PATIENCE

ROBOTS = tuple(RobotKey("ACME", f"r{number}") for number in range(1, 13))


def halves(broker: Broker, peer: MqttPeer, interface_name: str) -> list[Hall]:
    """Return the same hall twice, one per aggregator."""
    return [Hall.of(broker, peer, interface_name) for _ in range(2)]


async def fleet(hall: Hall) -> dict[str, Any]:
    async with httpx.AsyncClient(timeout=PATIENCE) as http:
        answer: dict[str, Any] = (await http.get(f"{hall.url}api/v1/fleet")).json()
    return answer


def robots_of(shown: dict[str, Any]) -> set[str]:
    return {each["id"] for each in shown["robots"]}


async def both(halls: list[Hall]) -> list[dict[str, Any]]:
    """Return the fleets of both, once together they have all robots."""
    shown = [await fleet(hall) for hall in halls]
    return shown if sum(len(each["robots"]) for each in shown) >= len(ROBOTS) else []


@pytest.mark.broker
async def test_two_aggregators_share_the_robots_and_prometheus_adds_them_up(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    with MqttPeer(broker) as peer:
        halls = halves(broker, peer, interface_name)
        with halls[0].aggregator("--share", "1/2") as one, halls[1].aggregator("--share", "2/2") as other:
            for each in (one, other):
                await each.logged("broker connected")
            say(halls[0])
            first, second = await eventually(partial(both, halls), "all robots")
            assert (first["share"], second["share"]) == ("1/2", "2/2")
            assert robots_of(first) | robots_of(second) == {str(robot) for robot in ROBOTS}
            assert not robots_of(first) & robots_of(second)
            await one_prometheus_sums_them_up(halls, tmp_path)


def say(hall: Hall) -> None:
    """Make each robot send a state, and the order service a status of one of them."""
    for robot in ROBOTS:
        hall.send(Topic.STATE, state(robot=robot, at=seconds_now()), robot=robot)
    status = vehicle_status(robot=ROBOTS[0])
    hall.peer.publish(hall.fleet.vehicle_status(status.name), status.model_dump_json(by_alias=True))


async def one_prometheus_sums_them_up(halls: list[Hall], folder: Path) -> None:
    addresses = [hall.url.removeprefix("http://").rstrip("/") for hall in halls]
    async with Prometheus(folder, *addresses) as prometheus:
        ask = prometheus.query
        all_idle = f'nena:robots:sum{{condition="IDLE"}} == {len(ROBOTS)}'
        await eventually(partial(ask, all_idle), "the sum of both")
        once = f"count(count by (serial_number) (nena_robot_states_total) == 1) == {len(ROBOTS)}"
        await eventually(partial(ask, once), "each robot at one of them")
        await eventually(partial(ask, "sum(nena_robots_share_ratio) == 1"), "the whole")
        watched = 'absent(ALERTS{alertname="NenaRobotsUnwatched"})'
        await eventually(partial(ask, watched), "nothing to alert of")


def test_invalid_share_is_rejected_at_startup() -> None:
    with AggregatorProcess("--share", "3/2") as process:
        assert process.process.wait(PATIENCE) != 0
        assert "1/2 for the first of two" in process.output
