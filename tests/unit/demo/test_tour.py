"""The steps of the guided tour, without a hall."""

from __future__ import annotations

import asyncio
import io
import json
import sys
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest

from nena_demo import processes as processes_module
from nena_demo import tour as tour_module
from nena_demo.hall_stack import HallStack
from nena_demo.host import Host, JobFailedError
from nena_demo.plants.hall import make_hall
from nena_demo.processes import Processes
from nena_demo.session import ProgressPrinter
from nena_demo.tour import Tour
from nena_shared.mqtt import Outbound
from nena_shared.settings import MqttSettings
from support.fleet_examples import vehicle_status

SLEEPS = (sys.executable, "-c", "import signal; signal.pause()")


@dataclass
class Scene:
    """A tour over processes that only sleep, and what it sends."""

    tour: Tour
    running: HallStack
    output: io.StringIO
    requests: list[tuple[str, Any]] = field(default_factory=list)
    commands: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    down: bool = False

    def answer(self, request: httpx.Request) -> httpx.Response:
        if self.down:
            raise httpx.ConnectError("refused")
        self.requests.append((request.url.path, json.loads(request.content)))
        return httpx.Response(200, json={})

    def published(self, message: Outbound) -> None:
        self.commands.append((message.topic, json.loads(message.payload)))

    def vehicle(self, name: str, **fields: Any) -> None:
        status = vehicle_status(**{"name": name, "current_position": "North 1", **fields})
        self.tour.host.vehicles[name] = status
        self.tour.changed("vehicle", name, f"{status.connection} {status.state}", status.reason)

    @property
    def lines(self) -> list[str]:
        return [line.split("] ", 1)[1] for line in self.output.getvalue().splitlines()]


@pytest.fixture
async def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Scene]:
    output = io.StringIO()
    async with Processes(tmp_path) as processes:
        service = await processes.start("order-service", SLEEPS)
        agent = await processes.start("edge-agent-AMR-2", SLEEPS)
        hall = make_hall(("AMR-1", "AMR-2"))
        running = HallStack(
            hall, MqttSettings(), "http://nena.test", "http://panel.test", service, agent,
            agent_robot="AMR-2", loopback=("AMR-1", "AMR-2"),
        )  # fmt: skip
        host = Host(running.mqtt, running.rest_url, lambda *_: None)
        made = Scene(Tour(processes, running, ProgressPrinter(output), host), running, output)
        host.rest = httpx.AsyncClient(base_url=running.rest_url, transport=httpx.MockTransport(made.answer))
        monkeypatch.setattr(host.link, "publish", made.published)
        yield made


async def test_failed_step_can_be_repeated(scene: Scene) -> None:
    scene.down = True
    await scene.tour.press("b")
    assert "the request to the order service failed" in scene.lines[-1]

    scene.down = False
    await scene.tour.press("b")

    assert [body for _, body in scene.requests] == [{"locked": True}]


async def test_emergency_stop_is_pressed_at_a_driving_robot_and_released_there(scene: Scene) -> None:
    scene.vehicle("AMR-1", state="IDLE")
    scene.vehicle("AMR-2", state="EXECUTING")
    await scene.tour.press("e")
    scene.vehicle("AMR-1", state="EXECUTING")
    await scene.tour.press("e")

    topic = "uagv/loopback/NeNa/AMR-2/control"
    assert scene.commands == [
        (topic, {"command": "emergencyStop", "stop": "MANUAL"}),
        (topic, {"command": "acknowledgeEmergencyStop"}),
    ]


async def test_lost_and_returned_robots_are_reported_but_not_those_of_a_new_order_service(
    scene: Scene,
) -> None:
    for connection in ("UNKNOWN", "ONLINE", "UNKNOWN", "ONLINE"):
        scene.vehicle("AMR-2", connection=connection, reason="")
    assert scene.lines == []

    scene.vehicle("AMR-2", connection="CONNECTION_BROKEN", reason="has lost its connection")
    scene.vehicle("AMR-2", connection="ONLINE", transport_order="T-1")

    assert scene.lines == [
        "AMR-2 is CONNECTION_BROKEN: has lost its connection",
        "AMR-2 is back, and goes on with T-1",
    ]


async def test_hall_whose_robots_do_not_come_is_reported(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def too_late(*_: object) -> None:
        raise TimeoutError

    scene.vehicle("AMR-1", connection="UNKNOWN", reason="never connected")
    monkeypatch.setattr(scene.tour.host, "wait_for", too_late)
    with pytest.raises(JobFailedError, match=r"not all robots became ready .*AMR-1: UNKNOWN never connected"):
        await tour_module.guide(
            scene.tour, scene.running, ProgressPrinter(scene.output), asyncio.Queue[str]()
        )


async def test_ended_process_is_started_again_and_the_user_told(tmp_path: Path) -> None:
    told: list[str] = []
    script = f"import pathlib; path = pathlib.Path({str(tmp_path / 'count')!r}); path.open('a').write('x')"
    async with Processes(tmp_path) as processes:
        child = await processes.start("quick", (sys.executable, "-c", script))
        with pytest.raises(processes_module.ChildFailedError, match="quick ended with status 0"):
            await processes.keep_running(told.append)
        stopped = await processes.start("stopped", SLEEPS)
        await processes.stop(stopped)

    assert told == ["quick has ended with status 0; it is started again"] * processes_module.QUICK_ENDS
    assert len((tmp_path / "count").read_text()) == processes_module.QUICK_ENDS + 1
    assert child.quick_ends == processes_module.QUICK_ENDS + 1
    assert not stopped.wanted
