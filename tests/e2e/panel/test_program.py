"""The program as its user starts it."""

from __future__ import annotations

import socket

import httpx
import psutil
import pytest

from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer, free_port
from support.fleet_examples import connection, factsheet, position, state, way
from support.waiting import PATIENCE, until

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

ROBOTS = 50
MEMORY_LIMIT = 120 * 1024 * 1024


async def test_starts_without_a_broker_and_reports_it() -> None:
    port = free_port()
    with AggregatorProcess("--http.port", "0", "--mqtt.port", str(port)) as aggregator:
        url = await aggregator.url()
        told = await aggregator.logged("broker not reachable, retrying")
        assert told["port"] == port
        async with httpx.AsyncClient(base_url=url, timeout=PATIENCE) as http:
            assert (await http.get("/healthz")).status_code == 200
            assert (await http.get("/readyz")).status_code == 503
        assert aggregator.end() == 0


def test_a_port_in_use_is_one_clear_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with AggregatorProcess("--http.port", str(port)) as aggregator:
            assert aggregator.process.wait(PATIENCE) == 1
            assert aggregator.output == (
                f"nena-status-aggregator: cannot listen on 127.0.0.1 port {port}: Address already in use. "
                "Set http.port to a free port (0: any), or stop the program that uses it.\n"
            )


async def test_exits_cleanly_while_a_client_follows_the_events(broker: Broker) -> None:
    with AggregatorProcess("--http.port", "0", "--mqtt.port", str(broker.port)) as aggregator:
        url = await aggregator.url()
        async with (
            httpx.AsyncClient(base_url=url, timeout=PATIENCE) as http,
            http.stream("GET", "/api/v1/events") as stream,
        ):
            lines = stream.aiter_lines()
            assert (await anext(lines)).startswith("id: ")
            assert aggregator.end() == 0


async def test_memory_with_fifty_robots(broker: Broker, interface_name: str) -> None:
    topics = TopicScheme(interface_name)
    options = ("--http.port", "0", "--mqtt.port", str(broker.port), "--interface_name", interface_name)
    with AggregatorProcess(*options) as aggregator, MqttPeer(broker) as peer:
        url = await aggregator.url()
        await aggregator.logged("broker connected")
        for number in range(ROBOTS):
            robot = RobotKey("ACME", f"r{number}")
            peer.publish(topics.of(robot, Topic.CONNECTION), CODEC.encode(connection(robot=robot)))
            peer.publish(topics.of(robot, Topic.FACTSHEET), CODEC.encode(factsheet(robot=robot)))
            for count in range(20):
                moving = state(
                    count,
                    robot=robot,
                    at=count,
                    order_id=f"o{number}",
                    mobile_robot_position=position(count, number),
                    **way(*[f"node {each}" for each in range(20)]),
                )
                peer.publish(topics.of(robot, Topic.STATE), CODEC.encode(moving))
        with httpx.Client(base_url=url, timeout=PATIENCE) as http:
            await until(lambda: _last_is_there(http), what="the last state")
        used = psutil.Process(aggregator.process.pid).memory_info().rss
        assert used <= MEMORY_LIMIT, f"{used / 1024 / 1024:.0f} MB"


def _last_is_there(http: httpx.Client) -> bool:
    http.get("/metrics")
    answer = http.get(f"/api/v1/robots/ACME/r{ROBOTS - 1}")
    return answer.status_code == 200 and (answer.json()["position"] or {}).get("x") == 19
