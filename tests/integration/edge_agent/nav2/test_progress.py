"""Progress of a drive as fleet control sees it, with a simulator process that publishes its plan."""

from __future__ import annotations

import json
from typing import Any

import pytest

from nena_shared.vda5050.topics import Topic
from support.edge_agent import FleetControl, ended
from support.nav2_agent import Bench
from support.robot_core import order
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]


LENGTH = pytest.approx(20, abs=2)
"""Of the first goal's route, m."""


@pytest.fixture
def version() -> str:
    return "3.0.0"


def progress(state: dict[str, Any]) -> dict[str, float]:
    """Return the numbers of the information ``progress``."""
    found = [each for each in state["information"] if each["infoType"] == "progress"]
    return {
        each["referenceKey"]: float(each["referenceValue"])
        for information in found
        for each in information["infoReferences"]
    }


def driven_and_left(state: dict[str, Any]) -> float:
    """Return the length of the goal's route, m: driven so far, by odometry, and left, by Nav2."""
    return float(state["distanceSinceLastNode"]) + progress(state)["goalDistanceLeft"]


def visualizations(fleet: FleetControl) -> list[dict[str, Any]]:
    return [json.loads(each) for each in fleet.peer.payloads(fleet.topic(Topic.VISUALIZATION))]


@pytest.mark.clause("6.6.2", "6.7")
async def test_state_and_visualization_show_the_progress(bench: Bench) -> None:
    async with bench.robot(interval={"state_maximum": 0.2, "visualization": 0.1}) as fleet:
        fleet.send(order("n0", "n2", "n3"))
        await bench.moves()
        shown = await until(
            lambda: next((each for each in visualizations(fleet) if each.get("intermediatePath")), None),
            what="a plan in the visualization",
        )
        end = shown["intermediatePath"]["polyline"][-1]
        assert (end["x"], end["y"]) == pytest.approx((20.0, 0.0), abs=0.75)
        # Odometry and Nav2's feedback arrive apart: on a busy machine not every state has both of one moment.
        half = await fleet.state(
            lambda state: progress(state).get("goalPercent", 0) >= 50 and driven_and_left(state) == LENGTH
        )
        assert progress(half)["orderDistanceLeft"] - progress(half)["goalDistanceLeft"] == pytest.approx(10)
        assert half["intermediatePath"]["polyline"]
        done = await fleet.state(ended("o1"))
        assert progress(done) == {}
        assert max(each["distanceSinceLastNode"] for each in fleet.states if each["orderId"]) > 12
