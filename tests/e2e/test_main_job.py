"""A host's order over the whole stack, with every part in a separate process and ROS over real DDS."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import httpx
import pytest
from std_msgs.msg import String

from nena_demo import stack
from nena_demo.host import Host, wait_for_robots
from nena_demo.processes import Processes, start_broker
from nena_demo.stack import Options, Stack
from nena_shared.fleet_api.transport_order import Destination, TransportOrderRequest, TransportOrderStatus
from support.ros import RosPeer, own_domain_id
from support.simulator import heard, publisher_to
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.ros, pytest.mark.broker]

ENDED_WITHIN = 120.0


class Running:
    """A stack that is ready, and a host that follows it."""

    def __init__(self, processes: Processes, running: Stack, host: Host) -> None:
        self.processes, self.stack, self.host = processes, running, host

    async def order(self, point: str, vehicle: str = "Robot-01") -> str:
        """Request a drive to a point; return the order's name."""
        request = TransportOrderRequest(
            destinations=(Destination(location_name=point),), intended_vehicle=vehicle
        )
        return (await self.host.create_by_rest(request)).name

    async def ended(self, name: str) -> TransportOrderStatus:
        """Wait for the end of an order."""
        await self.until(lambda: name in self.host.orders and self.host.orders[name].state.final)
        return self.host.orders[name]

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait until the host's knowledge fulfils a condition."""
        await self.host.wait_for(condition, ENDED_WITHIN)

    async def robot(self, serial_number: str) -> dict[str, object]:
        """What the aggregator shows of a robot."""
        async with httpx.AsyncClient(base_url=self.stack.panel_url, timeout=PATIENCE) as client:
            answer = await client.get(f"/api/v1/robots/NeNa/{serial_number}")
            found: dict[str, object] = answer.raise_for_status().json()
            return found

    async def robot_in(self, serial_number: str, condition: str) -> dict[str, object]:
        """Wait until the aggregator, which hears of it on its own, shows a robot in ``condition``."""
        return await awaited(
            lambda: self.robot(serial_number),
            lambda robot: robot["condition"] == condition,
            seconds=PATIENCE,
            what=f"{serial_number} is {condition}",
        )


@pytest.fixture
def domain_id() -> Iterator[int]:
    with own_domain_id(len(stack.ROBOTS)) as reserved:
        yield reserved


@asynccontextmanager
async def started(folder: Path, choices: Options) -> AsyncIterator[Running]:
    async with Processes(folder) as processes:
        running = await stack.start(processes, choices)
        host = Host(running.mqtt, running.rest_url, lambda *_: None)
        link = asyncio.create_task(host.link.run())
        try:
            await wait_for_robots(host, len(stack.ROBOTS))
            yield Running(processes, running, host)
        finally:
            link.cancel()
            with suppress(asyncio.CancelledError):
                await link
            await host.rest.aclose()


async def test_robots_in_two_domains_carry_out_an_order_each(tmp_path: Path, domain_id: int) -> None:
    choices = Options(domain_id=domain_id, separate_domains=True, time_factor=10.0)
    async with started(tmp_path, choices) as running:
        first = await running.order("Middle 2", "Robot-01")
        second = await running.order("Middle 3", "Robot-02")

        ends = [await running.ended(name) for name in (first, second)]

    assert [(end.state, end.processing_vehicle) for end in ends] == [
        ("FINISHED", "Robot-01"),
        ("FINISHED", "Robot-02"),
    ]


async def test_an_aborted_drive_is_an_error_of_the_robot_and_failed_at_the_host(
    tmp_path: Path, domain_id: int
) -> None:
    choices = Options(domain_id=domain_id, time_factor=10.0)
    async with started(tmp_path, choices) as running:
        with RosPeer(domain_id, "r1") as peer:
            faults = publisher_to(peer, String, "simulator/fault", "r1")
            faults.publish(String(data=json.dumps({"kind": "abort_halfway", "goals": 1})))
            heard(peer, "r1")

            failed = await running.ended(await running.order("Middle 1"))
            assert failed.state == "FAILED"
            assert "ABORTED" in failed.reason
            assert "Middle 1" in failed.reason

            again = await running.ended(await running.order("Middle 1"))
            assert again.state == "FINISHED"


@pytest.mark.long
async def test_a_robot_is_sent_to_a_coordinate_and_back_to_a_point(tmp_path: Path, domain_id: int) -> None:
    choices = Options(domain_id=domain_id, time_factor=10.0)
    async with started(tmp_path, choices) as running:
        answer = await running.host.rest.post(
            "/v1/vehicles/Robot-01/dispatch", json={"coordinate": {"x": 5.0, "y": 8.5, "theta": 1.57}}
        )
        assert answer.status_code == httpx.codes.CREATED, answer.text
        end = await running.ended(answer.json()["name"])
        assert end.state == "FINISHED", end.reason

        async def place() -> list[float]:
            position = (await running.robot("robot-01"))["position"]
            assert isinstance(position, dict)
            return [position["x"], position["y"]]

        there = pytest.approx([5.0, 8.5], abs=0.5)
        await awaited(place, lambda shown: shown == there, seconds=PATIENCE, what="the panel shows it there")

        back = await running.ended(await running.order("Middle 2"))
        assert back.state == "FINISHED", back.reason


async def test_an_order_survives_the_brokers_restart(tmp_path: Path, domain_id: int) -> None:
    choices = Options(domain_id=domain_id, time_factor=3.0)
    async with started(tmp_path, choices) as running:
        name = await running.order("North 3")
        await running.until(lambda: running.host.vehicles["Robot-01"].state == "EXECUTING")
        broker = running.processes.children[0]
        broker.process.kill()
        await broker.process.wait()
        await start_broker(running.processes, running.stack.mqtt.port, "mosquitto")

        end = await running.ended(name)

        assert end.state == "FINISHED", end.reason
        robot = await running.robot_in("robot-01", "IDLE")
        assert robot["connection"] == "ONLINE"
