"""The actions downloadMap, enableMap and deleteMap (VDA 5050 3.0 section 6.2.3)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from functools import partial

from nena_edge_agent.actions.plugin import (
    ActionPlugin,
    BackgroundAction,
    DriveError,
    DrivePort,
    Report,
    RunningAction,
    WorkFailedError,
)
from nena_edge_agent.download import DownloadError, DownloadSettings, download
from nena_edge_agent.driver.port import Pose
from nena_edge_agent.extensions.maps.store import DuplicateMapError, MapRefusedError, MapStore, find_map
from nena_edge_agent.protocol.declaration import (
    DELETE_MAP,
    DOWNLOAD_MAP,
    ENABLE_MAP,
    ActionDeclaration,
    Parameter,
)
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load

MAP_LINK = "mapDownloadLink"
MAP_HASH = "mapHash"
_MAP_PARAMETERS = (Parameter("mapId", ValueDataType.STRING), Parameter("mapVersion", ValueDataType.STRING))

# Not in the standard: with them, one action of an order changes the floor; else the robot waits for
# initPosition.
_POSITION_PARAMETERS = tuple(
    Parameter(key, ValueDataType.NUMBER, required=False, description=f"{unit}, robot's position on the map")
    for key, unit in (("x", "m"), ("y", "m"), ("theta", "rad"))
)

Change = Callable[[str, str, Action], Awaitable[None]]
"""Applies an action to the store, for a mapId and mapVersion."""


def map_actions(
    store: MapStore, settings: DownloadSettings, drive: DrivePort | None = None
) -> Iterable[ActionPlugin]:
    """Return the three actions on one robot's ``store`` (VDA 5050 3.0 section 6.2.3).

    They change the store one after the other. With ``drive``, enableMap can set the robot's position.
    """
    lock = asyncio.Lock()

    async def fetch(map_id: str, map_version: str, action: Action) -> None:
        # Already before the download; the store checks again, because downloads run at the same time.
        if find_map(store.maps, map_id, map_version):
            raise DuplicateMapError(map_id, map_version)
        digest = action.parameter(MAP_HASH)
        link = str(action.parameter(MAP_LINK))
        content = await download(link, None if digest is None else str(digest), settings)
        async with lock:
            await store.install(map_id, map_version, content)

    async def enable(map_id: str, map_version: str, action: Action) -> None:
        position = None if drive is None else _position_on_map(action, map_id)
        async with lock:
            await store.enable(map_id, map_version)
        if drive is not None and position is not None:
            await drive.initialize_position(position)

    async def delete(map_id: str, map_version: str, _: Action) -> None:
        async with lock:
            await store.delete(map_id, map_version)

    instant, on_nodes = (ActionScope.INSTANT,), (ActionScope.INSTANT, ActionScope.NODE)
    link = Parameter(MAP_LINK, ValueDataType.STRING, description="http or https")
    digest = Parameter(MAP_HASH, ValueDataType.STRING, required=False, description="SHA-256, hexadecimal")
    return (
        _MapAction(store, fetch, _make_declaration(DOWNLOAD_MAP, instant, "Downloads a map.", link, digest)),
        _MapAction(
            store,
            enable,
            _make_declaration(
                ENABLE_MAP, on_nodes, "Enables a map.", *(_POSITION_PARAMETERS if drive else ())
            ),
        ),
        _MapAction(
            store, delete, _make_declaration(DELETE_MAP, instant, "Deletes a map that is not enabled.")
        ),
    )


def _position_on_map(action: Action, map_id: str) -> Pose | None:
    """Return the robot's pose on the enabled map, None if the action has no parameters for it."""
    found = [action.parameter(parameter.key) for parameter in _POSITION_PARAMETERS]
    if found == [None, None, None]:
        return None
    numbers = [float(each) for each in found if isinstance(each, int | float)]
    if len(numbers) < len(_POSITION_PARAMETERS):
        raise MapRefusedError("specify x, y and theta together, or none of them")
    x, y, theta = numbers
    return Pose(x, y, theta, map_id)


def _make_declaration(
    action_type: str, scopes: tuple[ActionScope, ...], description: str, *more: Parameter
) -> ActionDeclaration:
    return ActionDeclaration(
        action_type,
        scopes=scopes,
        parameters=(*_MAP_PARAMETERS, *more),
        restartable=True,
        description=description,
    )


class _MapAction:
    """One of the three map actions."""

    def __init__(self, store: MapStore, change: Change, declaration: ActionDeclaration) -> None:
        self._store = store
        self._change = change
        self.declaration = declaration

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Start the change; its final report has the resulting maps."""
        return BackgroundAction(action.action_id, partial(self._change_map, action), report)

    async def _change_map(self, action: Action) -> ActionReport:
        map_id, version = str(action.parameter("mapId")), str(action.parameter("mapVersion"))
        try:
            await self._change(map_id, version, action)
        except DuplicateMapError as problem:
            raise WorkFailedError(
                str(problem), _report_duplicate(action, map_id, version, problem)
            ) from problem
        except (MapRefusedError, DownloadError) as problem:
            raise WorkFailedError(str(problem)) from problem
        except DriveError as problem:
            message = f"the map is enabled, but the position is not set: {problem}"
            report = ActionReport(action.action_id, ActionStatus.FAILED, message, maps=self._store.maps)
            raise WorkFailedError(message, report) from problem
        return ActionReport(action.action_id, ActionStatus.FINISHED, maps=self._store.maps)


def _report_duplicate(action: Action, map_id: str, version: str, problem: DuplicateMapError) -> ActionReport:
    entry = error(
        ErrorType.DUPLICATE_MAP,
        str(problem),
        hint="enable it, or send the map with another version",
        action_id=action.action_id,
        map_id=map_id,
        map_version=version,
    )
    return ActionReport(action.action_id, ActionStatus.FAILED, str(problem), error=entry)
