"""Traces of orders through real programs: host, order service, edge agent and back, in one trace."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import aclosing
from pathlib import Path

import httpx
import pytest

from nena_shared.extensions.tracing import order_span_id, trace_id_of, vda_order_span_id
from support.broker import Broker
from support.collector import Collector, Received, collecting
from support.order_service_fleet import Fleet, listening, order_in, vehicle_idle
from support.programs import OrderServiceProgram, Program
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

HOST_TRACE, HOST_SPAN = "0af7651916cd43dd8448eb211c80319c", "b7ad6b7169203331"
TRACEPARENT = f"00-{HOST_TRACE}-{HOST_SPAN}-01"
TRANSPORT = {
    "name": "T-1",
    "destinations": [
        {"locationName": "Goods in", "operation": "Load cargo"},
        {"locationName": "Storage", "operation": "Unload cargo"},
    ],
}
ORDER_SERVICE, AGENT = "nena-order-service", "nena-edge-agent"


@pytest.fixture
def fleet(broker: Broker, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(broker, interface_name, tmp_path)
    with made.stack:
        yield made


@pytest.fixture
def collector() -> Iterator[Collector]:
    with collecting() as made:
        yield made


def robot(fleet: Fleet, endpoint: str, speed: float = 40.0) -> Program:
    """Start a loopback robot with traces."""
    return fleet.agent_of(f'tracing = {{endpoint = "{endpoint}"}}\n{fleet.agent_file(speed=speed)}')


async def started(fleet: Fleet, endpoint: str) -> tuple[OrderServiceProgram, httpx.AsyncClient]:
    """Start the order service with traces, and wait until it is ready."""
    program = fleet.order_service("--tracing.endpoint", endpoint)
    client = await program.client()
    await listening(client)
    return program, client


def path_of(span: Received, spans: list[Received]) -> list[str]:
    """Return the names of a span and the spans above it, the root first."""
    above = [each for each in spans if each.id == span.parent]
    return [*(path_of(above[0], spans) if above else []), span.name]


async def test_an_order_is_one_trace_of_both_programs(fleet: Fleet, collector: Collector) -> None:
    _, client = await started(fleet, collector.url)
    robot(fleet, collector.url)
    async with aclosing(client):
        await vehicle_idle(client)
        await client.post("/v1/transportOrders", json=TRANSPORT, headers={"traceparent": TRACEPARENT})
        order = await order_in(client, "T-1", "FINISHED", "FAILED")
    assert order["traceparent"] == TRACEPARENT
    await until(lambda: len(collector.named("transport order")) == 1, what="the order's span")
    await until(lambda: len(collector.named("robot order")) == 2, what="the robot's spans")

    spans = collector.spans
    assert {each.trace for each in spans} == {f"{trace_id_of('T-1'):032x}"}
    root = collector.one("transport order")
    assert root.id == f"{order_span_id('T-1'):016x}"
    assert (root.parent, root.links) == ("", ((HOST_TRACE, HOST_SPAN),))
    assert root.attributes["nena.state"] == "FINISHED"
    assert root.events[0] == "nena:orderCreated"
    paths = {(each.service, *path_of(each, spans)) for each in spans}
    vda = ("transport order", "VDA 5050 order")
    assert paths == {
        (ORDER_SERVICE, "transport order"),
        (ORDER_SERVICE, "transport order", "create order"),
        (ORDER_SERVICE, "transport order", "dispatch"),
        (ORDER_SERVICE, "transport order", "plan"),
        (ORDER_SERVICE, *vda),
        (ORDER_SERVICE, *vda, "deliver"),
        (AGENT, *vda, "robot order"),
        (AGENT, *vda, "robot order", "goal"),
        (AGENT, *vda, "robot order", "action pick"),
        (AGENT, *vda, "robot order", "action drop"),
    }
    assert [each.attributes["vda5050.order_id"] for each in collector.named("VDA 5050 order")] == [
        "T-1-0",
        "T-1-1",
    ]
    assert not any(each.failed for each in spans)
    by_id = {each.id: each for each in spans}
    assert all(by_id[each.parent].begin <= each.begin <= each.end for each in spans if each.parent)


async def test_a_trace_outlives_the_order_service_that_began_it(fleet: Fleet, collector: Collector) -> None:
    program, client = await started(fleet, collector.url)
    agent = robot(fleet, collector.url, speed=5.0)
    async with aclosing(client):
        await vehicle_idle(client)
        host = fleet.peer(f"{fleet.prefix}/hosts/wms/transportOrders/answer")
        request = json.dumps({**TRANSPORT, "traceparent": TRACEPARENT})
        host.publish(f"{fleet.prefix}/hosts/wms/transportOrders/create", request.encode())
        await awaited(
            lambda: client.get("/v1/transportOrders/T-1/delivery"),
            lambda answer: answer.json().get("phase") == "DELIVERED",
            what="the robot has its order",
        )
    program.kill()
    _, client = await started(fleet, collector.url)
    async with aclosing(client):
        await order_in(client, "T-1", "FINISHED")
    await until(lambda: len(collector.named("transport order")) == 1, what="the order's span")

    root = collector.one("transport order")
    assert root.links == ((HOST_TRACE, HOST_SPAN),)
    first, second = collector.named("VDA 5050 order")
    assert first.id == f"{vda_order_span_id('T-1-0'):016x}"
    assert (first.parent, second.parent) == (root.id, root.id)
    assert (first.attributes["nena.restored"], second.attributes["nena.restored"]) == (True, False)
    assert agent.process.poll() is None


async def test_a_collector_that_does_not_answer_stops_nothing(fleet: Fleet) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        endpoint = f"http://127.0.0.1:{silent.getsockname()[1]}/v1/traces"
        program, client = await started(fleet, endpoint)
        agent = robot(fleet, endpoint)
        async with aclosing(client):
            await vehicle_idle(client)
            await client.post("/v1/transportOrders", json=TRANSPORT)
            order = await order_in(client, "T-1", "FINISHED", "FAILED")
            assert order["state"] == "FINISHED"
            await program.logged("traces cannot be exported")
            metrics = (await client.get("/metrics")).text
        failed = 'nena_trace_spans_total{outcome="failed"}'
        assert next(float(line.split()[1]) for line in metrics.splitlines() if line.startswith(failed)) > 0
        for each in (program, agent):
            each.process.terminate()
            assert each.process.wait(PATIENCE) == 0
