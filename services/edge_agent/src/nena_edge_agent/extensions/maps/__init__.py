"""The robot's maps: the actions that change them (VDA 5050 3.0 section 6.2.3), and its map for displays."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import ClassVar
from urllib.parse import quote

from pydantic import Field

from nena_edge_agent.actions.plugin import ActionPlugin
from nena_edge_agent.driver.plant_frame import PlantFrame
from nena_edge_agent.extension import Core, Extension, Robot
from nena_edge_agent.extensions.maps.actions import map_actions
from nena_edge_agent.extensions.maps.map_image import MapWatch
from nena_edge_agent.extensions.maps.nav2_store import Nav2MapStore
from nena_edge_agent.extensions.maps.store import FolderMapStore, MapStore
from nena_edge_agent.nav2.map_server import MapServer, MapUser
from nena_edge_agent.nav2.offers import LOAD_MAP, interface
from nena_edge_agent.nav2.session_control import NodeExtension
from nena_edge_agent.protocol.events import Event, MapsReport
from nena_shared.fleet_api.plant import MapImage
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Outbound
from nena_shared.settings import ConfigurationError, SettingsGroup
from nena_shared.vda5050.state import Map, MapStatus
from nena_shared.vda5050.topics import RobotKey

GROUP = "nena.maps"


class MapSettings(SettingsGroup):
    """Storage of the robot's maps."""

    store: str = Field(
        "fixed",
        min_length=1,
        description="fixed: only the configured map; folder: maps that fleet control sends; "
        "nav2: as folder, and Nav2's map_server loads the enabled map; or the name of a plug-in "
        "(entry points nena.maps).",
    )
    folder: Path = Field(
        Path("~/.local/state/nena/maps"), description="Folder of the maps, with a subfolder per robot."
    )
    maximum: int = Field(20, ge=1, le=1000, description="Maximum number of stored maps.")


class Maps(Extension):
    """Stores the maps that fleet control sends, and publishes the map that a robot with Nav2 uses."""

    Settings: ClassVar[type[SettingsGroup]] = MapSettings

    def __init__(self, settings: MapSettings, core: Core) -> None:
        super().__init__(settings, core)
        self._stores = {robot.key: self._open_store(robot.key) for robot in core.robots}
        self._images: dict[RobotKey, Outbound] = {}

    def _open_store(self, robot: RobotKey) -> MapStore | None:
        """Return the configured map store, None if the robot has a single, fixed map.

        A plug-in is called with the agent's settings and the robot, and returns a :class:`MapStore`.

        Raises:
            ConfigurationError: no plug-in has that name, or 'nav2' cannot be used here.
            StartError: the folder cannot be used.
        """
        settings, agent = self.settings, self.core.settings
        if settings.store == "fixed":
            return None
        first = Map(map_id=agent.map_id, map_version=agent.map_version, map_status=MapStatus.ENABLED)
        folder: Path = settings.folder / quote(str(robot), safe=" :").replace(".", "%2E")
        if settings.store == "nav2":
            if agent.driver != "nav2" or interface(LOAD_MAP) is None:
                message = (
                    "maps.store: 'nav2' needs driver = nav2 and nav2_msgs; "
                    "source the robot's ROS installation"
                )
                raise ConfigurationError([message])
            make_server = partial(MapServer, agent.ros)
            return Nav2MapStore(folder, first, maximum=settings.maximum, make_server=make_server)
        if settings.store == "folder":
            return FolderMapStore(folder, first, maximum=settings.maximum)
        entry = next(iter(entry_points(group=GROUP, name=settings.store)), None)
        if entry is None:
            message = f"maps.store: unknown plug-in '{settings.store}' of the entry points {GROUP}"
            raise ConfigurationError([message])
        store: MapStore = entry.load()(agent, robot)
        return store

    def actions(self, robot: Robot) -> Iterable[ActionPlugin]:
        """Return downloadMap, enableMap and deleteMap."""
        store = self._stores[robot.key]
        if store is None:
            return ()
        drive = robot.drive if isinstance(store, Nav2MapStore) else None
        return map_actions(store, self.core.settings.download, drive)

    def nodes(self, robot: Robot) -> Iterable[NodeExtension]:
        """Return what reads the map that Nav2 uses."""
        agent, store = self.core.settings, self._stores[robot.key]

        def map_id() -> str:
            return store.map_id if isinstance(store, Nav2MapStore) else agent.map_id

        def publish(image: MapImage) -> None:
            self._images[robot.key] = self._map_message(robot.key, image)
            robot.link.publish(self._images[robot.key])

        return (MapWatch(agent.ros.names.map, map_id, PlantFrame.of(agent.map_transforms), publish),)

    def _map_message(self, robot: RobotKey, image: MapImage) -> Outbound:
        """Return the message with the robot's map, retained; it is queued until the link can send it."""
        # 0026: not below the robot's VDA 5050 topics: some fleet controls fail at unknown messages there.
        topic = FleetTopics(self.core.settings.topic_prefix).robot_map(robot)
        return Outbound(topic, image.model_dump_json(by_alias=True).encode(), retain=True)

    def map_server(self, robot: Robot, user: MapUser) -> MapServer | None:
        """Return Nav2's map_server if it loads the enabled map."""
        store = self._stores[robot.key]
        return store.make_server_client(user) if isinstance(store, Nav2MapStore) else None

    def on_start(self, robot: Robot) -> Iterable[Event]:
        """Report the maps that the robot can enable."""
        store = self._stores[robot.key]
        return (MapsReport(store.maps),) if store else ()

    def on_connect(self, robot: Robot) -> Iterable[Outbound]:
        """Publish the map again: the broker may have lost it."""
        return (self._images[robot.key],) if robot.key in self._images else ()
