"""The program: one robot, or a fleet of loopback robots."""

from __future__ import annotations

import asyncio
import gc
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

from nena_edge_agent.actions.builtin import MapTransforms, UseBehaviorTree, Wait, ZoneSetDownload
from nena_edge_agent.actions.plugin import ActionPlugin, PluginContext
from nena_edge_agent.actions.ready_made import ready_made
from nena_edge_agent.actions.registry import ActionRegistry, Installed, installed_plugins
from nena_edge_agent.actions.robot_ports import RobotPorts
from nena_edge_agent.actions.ros_port import PluginRos
from nena_edge_agent.actions.ros_session import SessionSwitch, session_actions, session_switch
from nena_edge_agent.actions.settings import OperationBase
from nena_edge_agent.agent import RobotAgent
from nena_edge_agent.drivers import driver_maker
from nena_edge_agent.extension import Core, Extension, Robot, installed, operation_kinds, settings_model
from nena_edge_agent.fleet import run_fleet
from nena_edge_agent.journal import lock_journal
from nena_edge_agent.loopback.actions import ChargingWatch, simulated_actions
from nena_edge_agent.loopback.control import ControlApi, SimulationControl
from nena_edge_agent.nav2.map_server import MapServer, MapUser
from nena_edge_agent.nav2.offers import NO_OFFERS, nav2_offers
from nena_edge_agent.nav2.session_control import NodeExtension
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.certificates import Certificates
from nena_shared.clock import Clock, SystemClock
from nena_shared.fleet_api.topics import suits_all_brokers
from nena_shared.log import get_logger
from nena_shared.loop_lag import LoopLag
from nena_shared.program import EXIT_FAILED, run
from nena_shared.settings import ConfigurationError, settings_of
from nena_shared.tasks import StartError, Supervisor, forever
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import codec_for, topics_for

PROGRAM = "nena-edge-agent"
DESCRIPTION = (
    "Run a ROS 2 robot with Nav2 as a VDA 5050 robot: execute orders and instant actions, publish states. "
    "Without a robot: nena-edge-agent --driver loopback. Find connection problems: nena-edge-agent doctor"
)

METRICS_PAUSE = 10.0
"""Seconds after which a failed metrics port is retried."""

log = get_logger(__name__)

ODD_NAMES_LOGGED = 10


async def serve(settings: EdgeAgentSettings, stop: asyncio.Event) -> None:
    """Run every robot of ``settings`` until ``stop`` is set."""
    gc.enable()  # off during the start
    if not settings.journal.enabled:
        await _serve_robots(settings, stop)
        return
    with lock_journal(settings.journal.folder, RobotKey(settings.manufacturer, settings.serial_number)):
        await _serve_robots(settings, stop)


@dataclass(frozen=True, slots=True)
class _RobotParts:
    """What outlasts a robot's agent."""

    robot: Robot
    ports: RobotPorts
    ros: PluginRos | None
    control: SimulationControl

    @classmethod
    def of_robot(cls, settings: EdgeAgentSettings, serial_number: str) -> Self:
        ros = PluginRos() if settings.driver == "nav2" else None
        ports, link = RobotPorts(ros, settings.actions), RobotLink()
        robot = Robot(RobotKey(settings.manufacturer, serial_number), link, ports.drive, ros)
        return cls(robot, ports, ros, SimulationControl(link.cut))


async def _serve_robots(settings: EdgeAgentSettings, stop: asyncio.Event) -> None:
    """Create the robots and the extensions, then run the agents beside what serves all of them."""
    keys = (RobotKey(settings.manufacturer, serial_number) for serial_number in settings.serial_numbers)
    if odd := [str(key) for key in keys if not suits_all_brokers(key)]:
        log.warning(
            "some MQTT brokers (RabbitMQ, NATS) refuse or change '.' and spaces in topics: rename the "
            "robots, or test the broker with nena-edge-agent doctor",
            robots=odd[:ODD_NAMES_LOGGED],
            number=len(odd),
        )
    clock = SystemClock()
    fleet = [_RobotParts.of_robot(settings, serial_number) for serial_number in settings.serial_numbers]
    core = Core(settings, clock, tuple(parts.robot for parts in fleet))
    extensions = [
        extension(settings_of(settings, name, extension), core) for name, extension in installed().items()
    ]
    agents: dict[RobotKey, RobotAgent] = {}
    makers = {
        str(parts.robot.key): _agent_maker(core, index, parts, extensions, agents)
        for index, parts in enumerate(fleet)
    }
    async with Supervisor() as supervisor:
        for extension in extensions:
            for name, work in extension.tasks().items():
                # 0061: an extension that fails loses its own work, not the robot.
                supervisor.start(name, forever(name, work), vital=False)
        if settings.metrics.port:
            _serve_metrics(settings, agents, clock, supervisor, extensions)
        if settings.driver == "loopback" and settings.loopback.control:
            topics = topics_for(settings.version, settings.interface_name)
            controls = {parts.robot.key: parts.control for parts in fleet}
            api = ControlApi(settings.mqtt, topics.interface_name, controls)
            supervisor.start("simulation control", forever("simulation control", api.run), vital=False)
        try:
            first = next(iter(makers))
            start_log = log.bind(robots=len(makers), driver=settings.driver, first=first)
            if len(makers) == 1:  # its failure ends the program, whose service manager starts it again
                agent = makers[first]()
                start_log.info("robots started")
                await agent.run(stop)
            else:
                start_log.info("robots start")
                loopback = settings.loopback
                await run_fleet(makers, stop, restarts=loopback.restarts, pause=loopback.restart_pause)
        finally:
            for extension in extensions:
                await extension.close()


def _serve_metrics(
    settings: EdgeAgentSettings,
    agents: Mapping[RobotKey, RobotAgent],
    clock: Clock,
    supervisor: Supervisor,
    extensions: Sequence[Extension] = (),
) -> None:
    """Serve the metrics of all robots and extensions.

    Raises:
        ConfigurationError: the extra ``metrics`` is not installed.
    """
    try:
        from nena_edge_agent.metrics import MetricsServer, Program  # noqa: PLC0415 - an extra
    except ImportError as error:
        message = f"metrics.port: {error}; install the extra nena-edge-agent[metrics]"
        raise ConfigurationError([message]) from error
    lag = LoopLag(clock)
    journal = settings.journal.folder.expanduser() if settings.journal.enabled else None
    supervisor.start("loop lag", lag.run())
    certificates = Certificates(mqtt=settings.mqtt.tls.certificate)
    server = MetricsServer(settings.metrics, Program(agents, clock, lag, journal, certificates), extensions)
    supervisor.start("metrics", forever("metrics", server.run, pause=METRICS_PAUSE), vital=False)


def _agent_maker(
    core: Core,
    index: int,
    parts: _RobotParts,
    extensions: Sequence[Extension],
    agents: dict[RobotKey, RobotAgent],
) -> Callable[[], RobotAgent]:
    """Return a factory of the agent of robot ``index``, which is also put into ``agents``."""
    settings, robot, control = core.settings, parts.robot, parts.control
    journal = settings.journal.folder if settings.journal.enabled else None
    switch = session_switch(settings.ros, journal, robot.key)
    nodes: list[NodeExtension] = []
    if parts.ros:
        nodes = [parts.ros, *(node for extension in extensions for node in extension.nodes(robot))]

    def map_server(user: MapUser) -> MapServer | None:
        servers = (extension.map_server(robot, user) for extension in extensions)
        return next((server for server in servers if server), None)

    driver = driver_maker(
        settings, index, core.clock, control, switch, extensions=nodes, make_map_server=map_server
    )
    registry = make_registry(settings, control, robot, extensions, switch=switch)

    def make_agent() -> RobotAgent:
        agent = RobotAgent(
            settings,
            robot,
            parts.ports.observe_driver(driver),
            registry,
            clock=core.clock,
            offers=nav2_offers(settings.ros) if parts.ros else NO_OFFERS,
            extensions=extensions,
        )
        agents[robot.key] = agent
        return agent

    return make_agent


def effective_operations(external: Installed, settings: EdgeAgentSettings) -> tuple[OperationBase, ...]:
    """Return the robot's operations; installed plug-ins replace default ones of the same action type."""
    # 0020: settings take precedence over plug-ins, and plug-ins over default operations.
    if "operations" in settings.model_fields_set:
        return settings.operations
    return tuple(
        operation for operation in settings.operations if operation.action_type not in external.action_types
    )


def make_registry(
    settings: EdgeAgentSettings,
    control: SimulationControl,
    robot: Robot,
    extensions: Sequence[Extension] = (),
    *,
    switch: SessionSwitch | None = None,
) -> ActionRegistry:
    """Return the actions of one robot, for loopback robots with simulated ones if enabled."""
    context = PluginContext(robot.key, robot.drive, robot.ros)
    external = installed_plugins(context, settings.actions)
    operations = effective_operations(external, settings)
    plugins: list[ActionPlugin] = [
        *ready_made(operations, context, settings.actions, operation_kinds()),
        Wait(),
    ]
    plugins.append(ZoneSetDownload(codec_for(settings.version), settings.download))
    for extension in extensions:
        plugins += extension.actions(robot)
    trees = nav2_offers(settings.ros).behavior_trees if settings.driver == "nav2" else ()
    if trees:
        plugins.append(UseBehaviorTree(trees))
    if settings.driver == "nav2" and switch:
        plugins.extend(session_actions(switch))
    if settings.driver == "nav2" and settings.map_transforms:
        plugins.append(MapTransforms(settings.map_transforms))
    if settings.driver == "loopback":
        plugins = [ChargingWatch(plugin, control.set_charging) for plugin in plugins]
        external = replace(
            external,
            plugins=tuple(ChargingWatch(plugin, control.set_charging) for plugin in external.plugins),
        )
        if settings.loopback.rehearsal:
            plugins.extend(simulated_actions())
    return ActionRegistry(plugins, external)


def main(arguments: Sequence[str]) -> int:
    """Run the robots; return the exit status as ``__main__`` describes."""
    try:
        model = settings_model()
    except StartError as error:
        sys.stderr.write(f"{PROGRAM}: {error}\n")
        return EXIT_FAILED
    return run(model, serve, program=PROGRAM, description=DESCRIPTION, argv=arguments)
