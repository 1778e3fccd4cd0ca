"""Operations on the plant model: the model as a whole, its points, locations and paths, and zone sets."""

from __future__ import annotations

from typing import Final

from nena_shared.fleet_api.operations.operation import (
    LOCATIONS,
    PATHS,
    PLANT_MODEL,
    POINTS,
    ZONE_SETS,
    Operation,
)
from nena_shared.fleet_api.places import (
    LocationPage,
    LocationsQuery,
    LocationStatus,
    PointPage,
    PointsQuery,
    PointStatus,
)
from nena_shared.fleet_api.plant import (
    PathLockPreview,
    PathLockPreviewQuery,
    PathLockRequest,
    PathPage,
    PathsQuery,
    PathStatus,
    PlantModelChange,
    ZoneSetList,
    ZoneSetRequest,
    ZoneSetStatus,
)
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.plant_terms import MAX_BYTES

_ZONE_SET_CHANGE: Final = (Refusal.UNKNOWN_ZONE_SET, Refusal.NOT_SAVED)

LIST_POINTS = Operation(
    "points",
    "List the points, with the vehicles that stand there or for which they are reserved.",
    "GET",
    POINTS,
    PointPage,
    request=PointsQuery,
    result="points",
    refusals=(Refusal.UNKNOWN_POINT, Refusal.UNKNOWN_VEHICLE),
)
SHOW_POINT = Operation(
    "point",
    "Return a point, with the vehicles that stand there or for which it is reserved.",
    "GET",
    # `path`: names of points, locations and paths may contain a slash
    f"{POINTS}/{{name:path}}",
    PointStatus,
    result="point",
    refusals=(Refusal.UNKNOWN_POINT,),
)
LIST_LOCATIONS = Operation(
    "locations",
    "List the locations, with the operations that they offer and the points to which they are linked.",
    "GET",
    LOCATIONS,
    LocationPage,
    request=LocationsQuery,
    result="locations",
    refusals=(Refusal.UNKNOWN_LOCATION, Refusal.UNKNOWN_POINT),
)
SHOW_LOCATION = Operation(
    "location",
    "Return a location, with the operations that it offers and the points to which it is linked.",
    "GET",
    f"{LOCATIONS}/{{name:path}}",
    LocationStatus,
    result="location",
    refusals=(Refusal.UNKNOWN_LOCATION,),
)
LIST_PATHS = Operation(
    "paths",
    "List the paths, and which of them are locked.",
    "GET",
    PATHS,
    PathPage,
    request=PathsQuery,
    refusals=(Refusal.UNKNOWN_PATH,),
)

LOCK_PATH = Operation(
    "lockPath",
    "Lock or unlock a path. New routes avoid a locked path, also those of driving vehicles.",
    "PUT",
    f"{PATHS}/{{name:path}}/lock",
    PathStatus,
    request=PathLockRequest,
    result="path",
    refusals=(Refusal.UNKNOWN_PATH, Refusal.NOT_SAVED),
)

PREVIEW_PATH_LOCK = Operation(
    "previewPathLock",
    "Return which vehicles and orders would have no other route if a path were locked.",
    "GET",
    f"{PATHS}/{{name:path}}/lockPreview",
    PathLockPreview,
    request=PathLockPreviewQuery,
    result="preview",
    refusals=(Refusal.UNKNOWN_PATH,),
)

SHOW_PATH = Operation(
    "path",
    "Return a path.",
    "GET",
    f"{PATHS}/{{name:path}}",
    PathStatus,
    refusals=(Refusal.UNKNOWN_PATH,),
)

LIST_ZONE_SETS = Operation(
    "zoneSets",
    "List the zone sets and their status at the robots.",
    "GET",
    ZONE_SETS,
    ZoneSetList,
)

SHOW_ZONE_SET = Operation(
    "zoneSet",
    "Return a zone set's status at the robots.",
    "GET",
    f"{ZONE_SETS}/{{name}}",
    ZoneSetStatus,
    refusals=(Refusal.UNKNOWN_ZONE_SET,),
)

PUT_ZONE_SET = Operation(
    "putZoneSet",
    "Store a zone set (VDA 5050 3.0, 6.4) and send it, disabled, to all robots of version 3.0.",
    "POST",
    ZONE_SETS,
    ZoneSetStatus,
    admin=True,
    request=ZoneSetRequest,
    request_field="zone_set",
    result="zone_set",
    refusals=(Refusal.ZONE_SET_CHANGED, Refusal.NOT_SAVED),
)

ENABLE_ZONE_SET = Operation(
    "enableZoneSet",
    "Enable a zone set on the robots, and disable others of its map.",
    "POST",
    f"{ZONE_SETS}/{{name}}/enable",
    ZoneSetStatus,
    admin=True,
    result="zone_set",
    refusals=_ZONE_SET_CHANGE,
)

DELETE_ZONE_SET = Operation(
    "deleteZoneSet",
    "Delete a zone set on the robots. They keep an enabled one until another one is enabled.",
    "DELETE",
    f"{ZONE_SETS}/{{name}}",
    ZoneSetStatus,
    admin=True,
    result="zone_set",
    refusals=_ZONE_SET_CHANGE,
)

CHANGE_PLANT = Operation(
    "changePlantModel",
    "Replace the plant model: openTCS XML, LIF (strictly by its standard), or NeNa JSON.",
    "PUT",
    PLANT_MODEL,
    PlantModelChange,
    admin=True,
    max_body=MAX_BYTES,
    refusals=(Refusal.INVALID_PLANT, Refusal.PLANT_IN_USE, Refusal.NOT_SAVED),
)
"""The body is a file in one of several formats, so this route is written by hand."""
