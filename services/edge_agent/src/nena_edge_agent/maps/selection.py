"""Which map store a robot gets."""

from __future__ import annotations

from importlib.metadata import entry_points
from urllib.parse import quote

from nena_edge_agent.maps.folder_store import FolderMapStore
from nena_edge_agent.maps.store import MapStore
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.state import Map, MapStatus
from nena_shared.vda5050.topics import RobotKey

GROUP = "nena.maps"


def map_store(settings: EdgeAgentSettings, robot: RobotKey) -> MapStore | None:
    """Give the store that the settings name, None: the robot has its one map and no other.

    A plug-in is called with the settings and the robot, and gives a :class:`MapStore`.

    Raises:
        ConfigurationError: no plug-in has that name.
        StartError: the folder cannot be used.

    """
    maps = settings.maps
    if maps.store == "fixed":
        return None
    first = Map(map_id=settings.map_id, map_version=settings.map_version, map_status=MapStatus.ENABLED)
    if maps.store == "folder":
        name = quote(str(robot), safe=" :").replace(".", "%2E")
        return FolderMapStore(maps.folder / name, first, maximum=maps.maximum)
    found = next(iter(entry_points(group=GROUP, name=maps.store)), None)
    if found is None:
        message = f"maps.store: there is no plug-in '{maps.store}' of the entry points {GROUP}"
        raise ConfigurationError([message])
    store: MapStore = found.load()(settings, robot)
    return store
