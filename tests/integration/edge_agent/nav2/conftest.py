from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from nena_edge_agent.nav2 import action_client
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
    """Return the VDA 5050 version of the robot of ``bench``."""
    return "2.1.0"


@pytest.fixture
def bench(
    broker: Broker, interface_name: str, peer: RosPeer, domain_id: int, tmp_path: Path, *, version: str
) -> Iterator[Bench]:
    """Yield what a test needs for a separate robot, before anything of it runs."""
    made = Bench(broker, interface_name, ros=peer, domain_id=domain_id, folder=tmp_path, version=version)
    with made.mqtt:
        yield made


@pytest.fixture
def no_nav2_types(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the agent run where nav2_msgs is missing: without results and feedback."""
    monkeypatch.setattr(action_client, "action_type", lambda _navigation: None)


@pytest.fixture
def unstopped() -> Iterator[None]:
    """Check that the agent does not stop a robot that drives well."""
    with capture_logs() as logs:
        yield
    assert [each["event"] for each in logs if "cancelled the goals of controller" in each["event"]] == []
