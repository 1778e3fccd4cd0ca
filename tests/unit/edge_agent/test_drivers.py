from __future__ import annotations

import sys

import pytest

from nena_edge_agent.drivers import driver_maker
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import SystemClock
from nena_shared.program import StartError


def test_the_loopback_driver_is_made_without_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nena_edge_agent.ros.driver", None)
    settings = EdgeAgentSettings(driver="loopback")

    made = driver_maker(settings, 0, SystemClock())(lambda _: None)

    assert isinstance(made, LoopbackDriver)


def test_without_ros_the_nav2_driver_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nena_edge_agent.ros.driver", None)

    with pytest.raises(StartError, match=r"nena-edge-agent\[ros\]"):
        driver_maker(EdgeAgentSettings(driver="nav2"), 0, SystemClock())
