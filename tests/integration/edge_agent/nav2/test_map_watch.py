"""The map of a simulated robot, as published for displays."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from math import pi

import pytest

from nena_edge_agent.driver.plant_frame import PlantFrame
from nena_edge_agent.extension import Core
from nena_edge_agent.extensions.maps import Maps, MapSettings
from nena_edge_agent.extensions.maps.map_image import MapWatch
from nena_edge_agent.nav2.session import RosSession
from nena_edge_agent.settings import EdgeAgentSettings
from nena_robot_simulator.messages import map_message
from nena_robot_simulator.motion import GridMap
from nena_shared.fleet_api.plant import MapImage
from nena_shared.plant.geometry import MapTransform
from support.clocks import ManualClock
from support.edge_agent import make_robot
from support.robot_maps import room
from support.ros_port import ScriptedRos
from support.simulator import HALL, simulated_robot
from support.waiting import until

pytestmark = pytest.mark.ros

SAME = PlantFrame({})


@asynccontextmanager
async def watched(watch: MapWatch, domain_id: int) -> AsyncIterator[None]:
    """Run the watch on a separate node."""
    session = RosSession(node_name="watch", namespace="/", domain_id=domain_id)
    await session.start(lambda node: watch.enter(session, node))
    yield
    await session.stop()


async def test_map_published_before_the_agent_started(domain_id: int) -> None:
    told: list[MapImage] = []
    watch = MapWatch("map", lambda: "hall", SAME, told.append)
    with simulated_robot(domain_id):
        async with watched(watch, domain_id):
            await until(lambda: bool(told), what="the map")
        assert told[0].size == (HALL.width, HALL.height)
        assert told[0].map_id == "hall"
        assert told[0].resolution == pytest.approx(0.2)
        assert (told[0].x, told[0].y) == pytest.approx((HALL.origin_x, HALL.origin_y))


def grid(*, origin_x: float = -1.0, cells: bytes | None = None) -> GridMap:
    return GridMap(
        width=40, height=20, resolution=0.5, origin_x=origin_x, origin_y=2.0, cells=cells or room()
    )


def test_only_changed_maps_or_positions_are_reported_again() -> None:
    watch = MapWatch("map", lambda: "hall", SAME)
    looks = [grid(), grid(), grid(origin_x=0.0), grid(cells=bytes(800)), grid(cells=bytes(800)), grid()]
    told = [watch.read(map_message(each, "map", stamp)) for stamp, each in enumerate(looks)]
    assert [each is not None for each in told] == [True, False, True, True, False, True]
    assert len({each.digest for each in told if each}) == 3


def test_map_is_placed_in_plant_coordinates() -> None:
    """The plant is drawn half as large as the map and turned by a right angle."""
    watch = MapWatch("map", lambda: "hall", PlantFrame({"hall": MapTransform(2.0, pi / 2, 1.0, 0.0)}))
    found = watch.read(map_message(grid(), "map", 0))
    assert found is not None
    assert (found.x, found.y) == pytest.approx((1.0, 1.0))
    assert found.theta == pytest.approx(-pi / 2)
    assert found.resolution == pytest.approx(0.25)


def test_grid_with_too_few_cells_is_refused_and_the_next_one_reported() -> None:
    watch = MapWatch("map", lambda: "hall", SAME)
    with pytest.raises(ValueError, match="do not make a grid"):
        watch.read(map_message(grid(cells=bytes(7)), "map", 0))
    assert watch.read(map_message(grid(), "map", 0)) is not None


def test_settings_name_the_map_topic_and_the_plant_transform() -> None:
    settings = EdgeAgentSettings.model_validate({"map_id": "hall", "map_transforms": {"hall": "scale=2"}})
    robot = make_robot(ros=ScriptedRos())
    (watch,) = Maps(MapSettings(), Core(settings, ManualClock(), (robot,))).nodes(robot)
    assert isinstance(watch, MapWatch)
    found = watch.read(map_message(grid(), "map", 0))
    assert found is not None
    assert (found.map_id, found.resolution) == ("hall", 0.25)
