"""Nav2's map_server has the map that is enabled: within an order, and after restarts of each side."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from nav_msgs.msg import OccupancyGrid

from nena_shared.vda5050.order import NodePosition, Order
from support.action_types import needs_nav2_types
from support.edge_agent import FleetControl, ended, error_types, status_of
from support.http_files import served_files
from support.map_archives import RESOLUTION, attic
from support.nav2_agent import Bench, ready
from support.robot_core import MAP, action, order, position
from support.ros import LATCHED
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]

WHICH = {"mapId": "attic", "mapVersion": "1"}


def enabled(state: dict[str, Any]) -> list[str]:
    return [each["mapId"] for each in state["maps"] if each["mapStatus"] == "ENABLED"]


def lost(state: dict[str, Any]) -> bool:
    return not state["agvPosition"]["positionInitialized"]


def up_and_on() -> Order:
    """Drive to the lift on one floor, and out of it on the next one, where the lift lies elsewhere."""
    up = action("up", "HARD", "enableMap", retriable=None, x=2.0, y=1.0, theta=0.0, **WHICH)
    above = {f"n{number}": NodePosition(x=x, y=1.0, map_id="attic") for number, x in ((2, 2.0), (3, 5.0))}
    places = {"n0": position(0.0), "n1": position(3.0), **above}
    return order("n0", "n1", "n2", "n3", positions=places, node_actions={"n1": [up]})


@asynccontextmanager
async def robot(bench: Bench, tmp_path: Path) -> AsyncIterator[FleetControl]:
    """Run an agent whose maps go to map_server."""
    async with bench.agent(maps={"store": "nav2", "folder": str(tmp_path / "maps")}) as fleet:
        yield fleet


async def bring(fleet: FleetControl) -> None:
    with served_files() as files:
        link = files.put("/attic", attic())
        digest = sha256(attic()).hexdigest()
        fleet.instant(
            action("d", "NONE", "downloadMap", retriable=None, mapDownloadLink=link, mapHash=digest, **WHICH)
        )
        await fleet.state(lambda state: len(state["maps"]) == 2)


@pytest.mark.clause("6.3", "6.2.3/enableMap")
async def test_robot_changes_floors_within_an_order_and_keeps_the_map_after_restarts(
    bench: Bench, tmp_path: Path
) -> None:
    grids = bench.ros.subscribe(OccupancyGrid, "map", LATCHED)

    def loaded() -> bool:
        return bool(grids.messages) and grids.messages[-1].info.resolution == RESOLUTION

    with bench.simulator():
        async with robot(bench, tmp_path) as fleet:
            await fleet.state(ready)
            await bring(fleet)
            assert enabled(fleet.states[-1]) == [MAP]
            fleet.send(up_and_on())
            done = await fleet.state(ended("o1"))
            assert (done["lastNodeId"], error_types(done)) == ("n3", [])
            assert done["agvPosition"]["mapId"] == "attic"
            assert abs(done["agvPosition"]["x"] - 5.0) < 0.5
            assert enabled(done) == ["attic"]
            assert loaded()

            before, seen = len(grids.messages), len(fleet.states)
            bench.fault("server_died", server="map_server")
            bench.fault("server_died", server="map_server", active=False)
            # Its own map, with which it comes up, may be replaced before this subscriber has found it.
            await until(lambda: len(grids.messages) > before and loaded(), what="the map again")
            # Its lifecycle manager has started the localisation again, too, which knows no pose then.
            await until(lambda: any(map(lost, fleet.states[seen:])), what="a robot without a position")
            place: dict[str, Any] = {"x": 5.0, "y": 1.0, "theta": 0.0, "mapId": "attic", "lastNodeId": "n3"}
            fleet.instant(action("p", "NONE", "initPosition", retriable=None, **place))
            await until(lambda: ready(fleet.states[-1]), what="a robot that knows where it is")

        bench.fleet.peer.clear()
        async with robot(bench, tmp_path) as fleet:
            again = await fleet.state(ready)
            assert again["agvPosition"]["mapId"] == "attic"
            assert enabled(again) == ["attic"]


async def test_a_map_that_map_server_cannot_load_changes_nothing(bench: Bench, tmp_path: Path) -> None:
    with bench.simulator():
        async with robot(bench, tmp_path) as fleet:
            await fleet.state(ready)
            await bring(fleet)
            (image,) = (tmp_path / "maps").rglob("image.pgm")
            image.unlink()
            fleet.instant(action("e", "NONE", "enableMap", retriable=None, **WHICH))
            state = await fleet.state(lambda state: status_of(state, "e") == "FAILED")
            assert enabled(state) == [MAP]
            assert state["agvPosition"]["mapId"] == MAP
            (told,) = (each for each in state["actionStates"] if each["actionId"] == "e")
            assert "the image is not a map" in told["resultDescription"]


async def test_without_a_position_the_robot_waits_for_one_on_the_new_map(
    bench: Bench, tmp_path: Path
) -> None:
    with bench.simulator():
        async with robot(bench, tmp_path) as fleet:
            await fleet.state(ready)
            await bring(fleet)
            fleet.instant(action("e", "NONE", "enableMap", retriable=None, **WHICH))
            state = await fleet.state(lambda state: status_of(state, "e") == "FINISHED")
            await fleet.state(lambda state: "localizationError" in error_types(state))
            place: dict[str, Any] = {"x": 1.0, "y": 1.0, "theta": 0.0, "mapId": "attic", "lastNodeId": "n1"}
            fleet.instant(action("p", "NONE", "initPosition", retriable=None, **place))
            await until(lambda: ready(fleet.states[-1]), what="a robot that knows where it is")
            assert fleet.states[-1]["agvPosition"]["mapId"] == "attic"
            assert state["maps"]
