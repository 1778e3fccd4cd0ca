"""Fleet control of a robot with separate topics; `nav2` has fixtures with the same names for ROS."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl


@pytest.fixture
def peer(broker: Broker, interface_name: str) -> Iterator[MqttPeer]:
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        yield peer


@pytest.fixture
def fleet(peer: MqttPeer, interface_name: str) -> FleetControl:
    return FleetControl(peer, interface_name)
