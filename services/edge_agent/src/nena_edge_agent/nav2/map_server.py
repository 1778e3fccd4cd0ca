"""Loads maps into Nav2's map_server: when they are enabled, and after a restart of map_server."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from nena_edge_agent.nav2.offers import CLEAR_COSTMAP, LOAD_MAP, interface
from nena_edge_agent.nav2.settings import RosSettings
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from pathlib import Path

    from nena_edge_agent.nav2.session import RosSession

log = get_logger(__name__)

LOAD_TIMEOUT = 30.0
"""Timeout of map_server for loading a map, seconds."""
PROBLEMS = {
    1: "file not found: do agent and map_server see the same folder?",
    2: "the image is not a map",
    3: "the YAML file does not describe a map",
}
"""Meanings of load_map's results."""


class MapNotLoadedError(Exception):
    """map_server did not load the map; the text says why."""


class MapUser(Protocol):
    """A driver that uses the loaded map."""

    @property
    def drives(self) -> bool:
        """Return whether the robot is driving, or has a goal that it may start."""
        ...

    def await_map(self, reason: str) -> None:
        """Start no goal until Nav2 has the map being loaded."""
        ...

    def use_map(self, map_id: str) -> None:
        """Use another map."""
        ...


class MapServer:
    """Nav2's map_server, and the costmaps built from its map.

    ``map_id`` is the current map, or the one being loaded. The file "" is that of map_server's own settings.
    """

    def __init__(
        self,
        settings: RosSettings,
        map_id: str,
        file: str = "",
        *,
        mark: Path | None = None,
        user: MapUser | None = None,
    ) -> None:
        """Expect ``map_id`` and ``file``, which are enabled; ``user`` is the driver that drives on the map.

        The file ``mark`` exists while the robot's pose on the enabled map is unknown.
        """
        self._settings = settings
        self.map_id = map_id
        self._file = file
        self._own_file = ""
        self._publishers: frozenset[bytes] = frozenset()
        self._problem = f"map_server has not loaded the map '{map_id}'" if file else ""
        self._change = ""
        """The awaited map while another one is being enabled."""
        self._user = user
        self._mark = mark
        self._session: RosSession | None = None
        self._node: Any = None
        self._turn = asyncio.Lock()
        """Held while map_server loads a map: it loads one at a time."""

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Create the clients on a new node."""
        from rcl_interfaces.srv import GetParameters  # noqa: PLC0415 - the loopback needs no ROS

        names = self._settings.names
        self._session, self._node = session, node
        self._publishers = frozenset()
        self._load = node.create_client(interface(LOAD_MAP), f"{names.map_server}/load_map")
        self._parameters = session.late_client(node, GetParameters, f"{names.map_server}/get_parameters")
        kind: Any = interface(CLEAR_COSTMAP)
        self._clear = [
            (costmap, session.late_client(node, kind, costmap)) for costmap in names.clear_costmaps
        ]
        self._clear_request = kind.Request

    @property
    def problem(self) -> str:
        """Return why Nav2 does not have the enabled map; empty if it does."""
        return self._change or self._problem

    @property
    def unplaced(self) -> bool:
        """Return whether a map was enabled, even in an earlier run, and no position on it was set since."""
        return self._mark is not None and self._mark.exists()

    def record_placed(self) -> None:
        """Record that the robot's pose on the map is known."""
        if self._mark is None:
            return
        try:
            self._mark.unlink(missing_ok=True)
        except OSError as error:
            log.warning(
                "cannot record that the position is set; set it again after a restart", error=str(error)
            )

    async def use(self, map_id: str, file: str) -> None:
        """Switch Nav2 and the driver to another map.

        Raises:
            MapNotLoadedError: map_server refuses, or the robot drives; nothing is changed.
        """
        # Nav2 itself would load it in the middle of a drive, and the goal would go on (Jazzy, 1.3.13).
        if self._user is not None and self._user.drives:
            raise MapNotLoadedError("the robot is moving: enable the map at standstill")
        self._change = f"map_server loads the map '{map_id}'"
        before, self.map_id = self.map_id, map_id
        try:
            if self._user is not None:
                self._user.await_map(self._change)
            async with self._turn:
                await self._load_in_turn(file)
                self._file, self._problem = file, ""
        except MapNotLoadedError:
            self.map_id = before
            raise
        finally:
            self._change = ""
        if self._user is not None and map_id != before:
            self._user.use_map(map_id)

    def needs_load(self) -> bool:
        """Return whether :meth:`load_again` is due: a map_server has appeared, with its own map.

        While a map is being loaded, it is not due.
        """
        if self._turn.locked():
            return False
        if self._session is None or not self._load.service_is_ready():
            self._publishers = frozenset()
            return False
        found = self._node.get_publishers_info_by_topic(self._settings.names.map)
        publishers = frozenset(bytes(publisher.endpoint_gid) for publisher in found)
        appeared, self._publishers = bool(publishers - self._publishers), publishers
        if not self._file or not (appeared or self._problem):
            return False
        self._problem = self._problem or f"map_server loads the map '{self.map_id}'"
        return True

    async def load_again(self) -> None:
        """Load the enabled map; if that fails, it is due again at the next check."""
        async with self._turn:
            if not self._problem:
                return  # another map was enabled meanwhile, and map_server has it
            try:
                await self._load_in_turn(self._file)
            except MapNotLoadedError as error:
                self._problem = str(error)
            else:
                self._problem = ""

    async def _load_in_turn(self, file: str) -> None:
        """Make map_server load a file, and clear the costmaps of the previous map."""
        from rcl_interfaces.srv import GetParameters  # noqa: PLC0415 - the loopback needs no ROS

        session = self._session
        if session is None:
            raise MapNotLoadedError("the robot's ROS session is not active")
        if not self._own_file:  # the map of its own settings, to which "" switches back
            own = GetParameters.Request(names=["yaml_filename"])
            own_answer = await self._parameters.call(own, seconds=self._settings.call_timeout)
            if own_answer is not None and own_answer.values:
                self._own_file = str(own_answer.values[0].string_value)
        path = file or self._own_file
        if not path:
            raise MapNotLoadedError("map_server has no file for the robot's own map (yaml_filename)")
        request = self._load.srv_type.Request(map_url=path)
        answer = await session.call(self._load, request, seconds=LOAD_TIMEOUT)
        if answer is None:
            raise MapNotLoadedError(f"{self._load.srv_name} does not answer: is map_server running?")
        if answer.result:
            reason = PROBLEMS.get(answer.result, f"result {answer.result}")
            raise MapNotLoadedError(f"map_server did not load {path}: {reason}")
        log.info("map loaded", map_id=self.map_id, file=path)
        # Costmaps take the new map by themselves. One that rolls, or whose size and origin stay, would keep
        # the obstacles seen on the previous map (nav2_costmap_2d, StaticLayer::processMap).
        for name, client in self._clear:
            if await client.call(self._clear_request(), seconds=self._settings.call_timeout) is None:
                log.warning("a costmap was not cleared", service=name)


MakeMapServer = Callable[[MapUser], MapServer | None]
"""Returns the map server of a driver; None: Nav2 keeps the map of its own settings."""


def no_map_server(_: MapUser) -> None:
    """Let Nav2 keep the map of its own settings."""
