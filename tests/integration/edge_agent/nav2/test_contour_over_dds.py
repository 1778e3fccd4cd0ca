"""The factsheet has the footprint of Nav2's costmap."""

from __future__ import annotations

import json
from typing import Any

import pytest

from nena_shared.vda5050.topics import Topic
from support.action_types import needs_nav2_types
from support.nav2_agent import Bench, ready
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]

TRIANGLE = "[[0.7, 0.0], [-0.3, 0.4], [-0.3, -0.4]]"


async def test_the_factsheet_has_the_footprint_of_the_costmap(bench: Bench) -> None:
    def corners() -> list[tuple[float, float]]:
        payloads = bench.mqtt.payloads(bench.fleet.topic(Topic.FACTSHEET))
        sheet: dict[str, Any] = json.loads(payloads[-1])
        (envelope,) = sheet["agvGeometry"]["envelopes2d"]
        return [(each["x"], each["y"]) for each in envelope["polygonPoints"]]

    with bench.simulator(footprint=TRIANGLE):
        async with bench.agent() as fleet:
            await fleet.state(ready)
            await until(lambda: corners() == [(0.7, 0.0), (-0.3, 0.4), (-0.3, -0.4)], what="the footprint")
