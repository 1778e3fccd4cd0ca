from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.broker import Broker
from support.nav2_agent import Bench
from support.ros import RosPeer, own_domain_id


@pytest.fixture
def other_domain_id() -> Iterator[int]:
    with own_domain_id() as reserved:
        yield reserved


@pytest.fixture
def peer(domain_id: int) -> Iterator[RosPeer]:
    with RosPeer(domain_id) as node:
        yield node


@pytest.fixture
def version() -> str:
    """Give the version of VDA 5050 that the robot of ``bench`` speaks."""
    return "2.1.0"


@pytest.fixture
def bench(
    broker: Broker, interface_name: str, peer: RosPeer, domain_id: int, tmp_path: Path, *, version: str
) -> Iterator[Bench]:
    """Give what a test needs for a robot of its own, which nothing runs of yet."""
    made = Bench(broker, interface_name, ros=peer, domain_id=domain_id, folder=tmp_path, version=version)
    with made.mqtt:
        yield made


@pytest.fixture(autouse=True)
def _unmeasured(unmeasured: None) -> None:
    """Let agents and simulators that run as programs go at their own speed; others measure their code."""
