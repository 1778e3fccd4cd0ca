"""Creation of a robot's driver from its settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nena_edge_agent.actions.ros_session import SessionSwitch
from nena_edge_agent.agent import DriverMaker
from nena_edge_agent.driver.plant_frame import PlantFrame
from nena_edge_agent.driver.port import Driver, Emit, Pose
from nena_edge_agent.loopback.control import SimulationControl
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.nav2.map_server import MakeMapServer, no_map_server
from nena_edge_agent.nav2.offers import nav2_offers
from nena_edge_agent.nav2.session_control import NodeExtension
from nena_edge_agent.nav2.speed_limit import SpeedLimiter
from nena_edge_agent.protocol.events import Event
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import Clock
from nena_shared.tasks import StartError


def driver_maker(
    settings: EdgeAgentSettings,
    index: int,
    clock: Clock,
    control: SimulationControl,
    switch: SessionSwitch,
    *,
    extensions: Sequence[NodeExtension] = (),
    make_map_server: MakeMapServer = no_map_server,
) -> DriverMaker:
    """Return a factory for the driver of robot ``index``, counted from 0.

    A loopback robot is attached to ``control``. A robot with Nav2 has its ROS session attached to ``switch``,
    ``extensions`` on its nodes, and its maps in the server of ``make_map_server``.

    Raises:
        StartError: ROS 2 for Python is required and missing.
    """
    if settings.driver == "loopback":

        def make_loopback(put: Callable[[Event], None], last_place: Pose | None) -> Driver:
            start = settings.loopback.start(index)
            place = last_place or Pose(start.x, start.y, start.theta, settings.map_id)
            driver = LoopbackDriver(settings.loopback, place, emit=put, clock=clock, speed=start.speed)
            control.use_driver(driver, put)
            return driver

        return make_loopback
    try:
        from nena_edge_agent.nav2.driver import Nav2Driver  # noqa: PLC0415 - the loopback needs no ROS
    except ImportError as error:
        raise StartError(
            f"ROS 2 for Python is missing ({error.name}); install nena-edge-agent[ros], or source the "
            "robot's ROS 2 Jazzy, or try without a robot: --driver loopback"
        ) from error

    def make_nav2(emit: Emit, _: Pose | None) -> Driver:
        limiter = None
        if nav2_offers(settings.ros).limits_speed:
            limiter = SpeedLimiter(settings.ros.names.speed_limit, settings.description.maximum_speed)
        driver = Nav2Driver(
            switch.address.applied(settings.ros),
            settings.map_id,
            emit,
            clock,
            frame=PlantFrame.of(settings.map_transforms),
            extensions=extensions,
            limiter=limiter,
            make_map_server=make_map_server,
        )
        switch.use_session(driver.session)
        return driver

    return make_nav2
