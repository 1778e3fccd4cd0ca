"""What an extension of the edge agent is, adds and gets; see docs/extensions.md.

An extension is installed under the entry point group ``nena.edge_agent``. The program creates each one once,
before its robots start, and imports none of them itself. Plug-ins for actions alone are simpler:
docs/actions.md.
"""

# ruff: noqa: ARG002 - the methods return nothing unless an extension overrides them

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import BaseModel

from nena_edge_agent.actions.plugin import ActionPlugin, DrivePort, RosPort
from nena_edge_agent.actions.ready_made import OperationKind
from nena_edge_agent.nav2.map_server import MapServer, MapUser
from nena_edge_agent.nav2.session_control import NodeExtension
from nena_edge_agent.protocol.events import Effect, Event
from nena_edge_agent.protocol.robot_state import RobotState
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import EdgeAgentSettings, with_kinds
from nena_shared import extensions
from nena_shared.clock import Clock
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.settings import NoSettings, settings_with
from nena_shared.vda5050.topics import RobotKey

if TYPE_CHECKING:  # an extra of the edge agent
    from nena_shared.metrics import Section

GROUP = "nena.edge_agent"


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot of the program; it outlasts its agent, which is restarted after a failure."""

    key: RobotKey
    link: RobotLink
    """Its connection to the broker; subscribe while the extension is created."""
    drive: DrivePort
    ros: RosPort | None
    """None: a loopback robot."""


@dataclass(frozen=True, slots=True)
class Core:
    """What the program gives its extensions."""

    settings: EdgeAgentSettings
    """The agent's own settings."""
    clock: Clock
    robots: tuple[Robot, ...]
    """One, or a fleet of loopback robots."""


class Extension:
    """A part of the edge agent; every method may be left as it is.

    All of it but :meth:`on_record` runs in the event loop: what blocks belongs in ``asyncio.to_thread``.
    """

    Settings: ClassVar[type[BaseModel]] = NoSettings
    """Its group of settings, ``[NAME]`` in the file; or :class:`TopLevelSettings`, beside the agent's own."""

    kinds: ClassVar[Mapping[str, OperationKind]] = {}
    """Its kinds of ``[[operations]]``: actions that settings define."""

    def __init__(self, settings: Any, core: Core) -> None:  # noqa: ANN401 - of the class's own Settings
        """Prepare the extension; nothing is connected yet.

        Raises:
            ConfigurationError: its settings are invalid.
            StartError: it cannot start.
        """
        self.settings = settings
        self.core = core

    @classmethod
    def metrics(cls) -> Section[Any] | None:
        """Return its metrics, read from the extension at each scrape. Import ``nena_shared.metrics`` here."""
        return None

    def actions(self, robot: Robot) -> Iterable[ActionPlugin]:
        """Return actions of the robot, which its factsheet lists."""
        return ()

    def nodes(self, robot: Robot) -> Iterable[NodeExtension]:
        """Return what is set up on each ROS node of the robot, in the ROS thread."""
        return ()

    def map_server(self, robot: Robot, user: MapUser) -> MapServer | None:
        """Return Nav2's map_server if it loads a map of the extension; ``user`` is the robot's new driver."""
        return None

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return functions that run as long as the program, by name; one that fails is started again."""
        return {}

    def on_start(self, robot: Robot) -> Iterable[Event]:
        """Return events for the robot's protocol core, at each start of its agent."""
        return ()

    def on_connect(self, robot: Robot) -> Iterable[Outbound]:
        """Return messages to publish after connection and factsheet, on each connection to the broker."""
        return ()

    def on_event(self, robot: Robot, event: Event, effects: Iterable[Effect], state: RobotState) -> None:
        """Handle an order, a report of the driver or of an action, its effects, and the state after it."""

    def on_message(self, robot: Robot, message: Inbound | Outbound) -> None:
        """Handle a VDA 5050 message that the robot has received (before it is read) or sends."""

    def on_record(self, robot: Robot, record: bytes) -> None:
        """Handle a record of the robot's journal, in the thread that writes it."""

    def on_end(self, robot: Robot) -> None:
        """Handle the end of the robot's agent."""

    async def close(self) -> None:
        """Handle the end of the program, after that of all robots."""


@cache
def installed() -> Mapping[str, type[Extension]]:
    """Return the installed extensions by name; raises as :func:`nena_shared.extensions.installed`."""
    return extensions.installed(GROUP, Extension)


def operation_kinds() -> dict[str, OperationKind]:
    """Return the kinds of ``[[operations]]`` of all installed extensions."""
    return {name: kind for extension in installed().values() for name, kind in extension.kinds.items()}


def settings_model() -> type[EdgeAgentSettings]:
    """Return the agent's settings with those of the installed extensions."""
    kinds = {name: kind.settings for name, kind in operation_kinds().items()}
    return settings_with(with_kinds(EdgeAgentSettings, kinds), installed())
