"""Both HTTP interfaces, with allowed and forbidden requests by their descriptions: no undescribed answer."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.checks import (
    content_type_conformance,
    not_a_server_error,
    response_schema_conformance,
    status_code_conformance,
)
from schemathesis.core.result import Ok

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.broker,
    pytest.mark.timeout(1800),
]

EXAMPLES = int(os.environ.get("NENA_FUZZ_EXAMPLES", "1"))
"""Requests of each kind (allowed, forbidden) to each operation."""
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]
STREAMS = "/(events|sse)"
"""Answers without an end."""


def ask_everything(url: str, description: str) -> int:
    """Send requests to each operation in ``description``; return their number."""
    schema = schemathesis.openapi.from_url(url + description)
    count = 0
    for found in schema.exclude(path_regex=STREAMS).get_all_operations():
        assert isinstance(found, Ok), found
        operation = found.ok()
        count += 1
        for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):

            @settings(
                max_examples=EXAMPLES,
                deadline=None,
                database=None,
                derandomize=True,
                phases=[Phase.generate],
                suppress_health_check=list(HealthCheck),
            )
            @given(case=operation.as_strategy(generation_mode=mode))
            def asked(case: schemathesis.Case[Any]) -> None:
                case.call_and_validate(base_url=url, checks=CHECKS, timeout=60)

            try:
                asked()
            except Unsatisfiable:
                assert mode is GenerationMode.NEGATIVE, f"{operation.label} cannot be asked at all"
    return count


@pytest.fixture
def fleet(broker: Broker, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(broker, interface_name, tmp_path)
    with made.stack:
        yield made


async def order_service(fleet: Fleet) -> str:
    """Start one with a robot; return its address."""
    fleet.agent()
    service = fleet.order_service("--http.burst", 1_000_000)
    async with await service.client() as client:
        return str(client.base_url).rstrip("/")


@pytest.mark.parametrize("mount", ["", pytest.param("/opentcs", marks=pytest.mark.long)])
async def test_the_order_service(fleet: Fleet, mount: str) -> None:
    assert ask_everything(f"{await order_service(fleet)}{mount}", "/openapi.json") > 8


async def test_the_status_aggregator(fleet: Fleet) -> None:
    port, url = free_port(), await order_service(fleet)
    addresses = ("--http.port", str(port), "--mqtt.port", str(fleet.broker.port), "--http.burst", "1000000")
    names = ("--interface_name", fleet.interface, "--order_service.url", url)
    with AggregatorProcess(*addresses, *names) as aggregator:
        await aggregator.logged("broker connected")

        assert ask_everything(f"http://127.0.0.1:{port}", "/api/v1/openapi.json") > 8
