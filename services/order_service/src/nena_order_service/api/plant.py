"""The plant model, and its points, locations and paths: operations of hosts."""

from __future__ import annotations

import asyncio
import hashlib
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Final, TypeVar

from fastapi import APIRouter, Query, Request, Response

from nena_order_service.api.audit import ChangingRequest, OpenRequest, Trail, origin_of, to_masked_json
from nena_order_service.api.operation_routes import known_query, refusals_of
from nena_order_service.api.operations import Handler, page_of
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.path_locks import PathLocks
from nena_order_service.engine.status import current_position
from nena_order_service.errors import UnknownError
from nena_order_service.plant_file import read_plant
from nena_shared.fleet_api.audit import AuditInterface
from nena_shared.fleet_api.operations import plant as table
from nena_shared.fleet_api.operations.operation import PLANT_MODEL
from nena_shared.fleet_api.operations.plant import CHANGE_PLANT
from nena_shared.fleet_api.places import (
    LocationLink,
    LocationPage,
    LocationsQuery,
    LocationStatus,
    PointPage,
    PointsQuery,
    PointStatus,
)
from nena_shared.fleet_api.plant import PathPage, PathsQuery, PathStatus, PlantModelChange
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.plant import Location, PlantModel, Point
from nena_shared.plant.model import NO_OPERATION

ChangePlant = Callable[..., Awaitable[None]]
"""Signature of :meth:`ServiceRunner.change_plant`."""

PLANT_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"type": "object"}},
            "application/xml": {"schema": {"type": "string"}},
        },
    }
}

_POINT: Final = {
    "name": "Packing stand",
    "type": "HALT_POSITION",
    "x": 23.0,
    "y": 7.0,
    "theta": 0.0,
    "mapId": "hall",
    "locations": ["Packing"],
    "occupiedBy": ["Robot-01"],
    "reservedBy": ["Robot-01"],
}
_LOCATION: Final = {
    "name": "Packing",
    "type": "Transfer station",
    "x": 23.6,
    "y": 7.0,
    "locked": False,
    "operations": ["Load cargo", "Unload cargo"],
    "peripheralOperations": [],
    "links": [{"point": "Packing stand", "operations": ["Load cargo", "Unload cargo"]}],
}

P = TypeVar("P", Point, Location, PathStatus)


class PlantOperations:
    """Executes requests about points, locations and paths; the plant model of an engine never changes."""

    def __init__(self, engine: Engine, locks: PathLocks) -> None:
        self._engine = engine
        self._plant = engine.plant
        self._locks = locks

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        locks = self._locks
        yield Handler(
            table.LIST_POINTS, self.list_points, answer={"points": [_POINT], "next": "Packing stand"}
        )
        yield Handler(table.SHOW_POINT, self.find_point_status, answer=_POINT)
        yield Handler(
            table.LIST_LOCATIONS, self.list_locations, answer={"locations": [_LOCATION], "next": "Packing"}
        )
        yield Handler(table.SHOW_LOCATION, self.find_location_status, answer=_LOCATION)
        yield Handler(table.LIST_PATHS, self.list_paths)
        yield Handler(table.PREVIEW_PATH_LOCK, lambda name, request: locks.preview((name, *request.also)))
        yield Handler(table.SHOW_PATH, locks.get)
        yield Handler(
            table.LOCK_PATH,
            lambda name, request, caller: locks.set(name, locked=request.locked, by=request.by or caller),
            {"locked": True, "by": "Anna"},
        )

    def list_points(self, request: PointsQuery) -> PointPage:
        """Return a page of points.

        Raises:
            UnknownError: no point has the name ``after``, or no vehicle the one that is asked for.
        """
        holders, vehicle = self._engine.traffic.scheduler.holders_of, request.vehicle
        if vehicle is not None and self._engine.registry.named(vehicle) is None:
            raise UnknownError(Refusal.UNKNOWN_VEHICLE, vehicle)
        if request.after is not None:
            self._find_point(request.after)
        occupants = self._vehicles_by_point()
        points = (
            point
            for point in _objects_behind(self._plant.points, request.after)
            if (not request.type or point.type in request.type)
            and request.map_id in (None, point.map_id)
            and (
                vehicle is None or vehicle in occupants.get(point.name, ()) or vehicle in holders(point.name)
            )
        )
        page, following = page_of(points, request.limit)
        statuses = (self._point_status(point, occupants.get(point.name, ())) for point in page)
        return PointPage(points=tuple(statuses), next=following)

    def find_point_status(self, name: str) -> PointStatus:
        """Return a point; raises UnknownError."""
        point = self._find_point(name)
        return self._point_status(point, self._vehicles_by_point().get(name, ()))

    def list_locations(self, request: LocationsQuery) -> LocationPage:
        """Return a page of locations.

        Raises:
            UnknownError: no location has the name ``after``, or no point the one that is asked for.
        """
        if request.after is not None:
            self.find_location_status(request.after)
        if request.point is not None:
            self._find_point(request.point)
        wanted = (
            location
            for location in _objects_behind(self._plant.locations, request.after)
            if self._fits_query(location, request)
        )
        page, following = page_of(wanted, request.limit)
        return LocationPage(locations=tuple(map(self._location_status, page)), next=following)

    def _fits_query(self, location: Location, query: LocationsQuery) -> bool:
        if query.type not in (None, location.type):
            return False
        if query.point is None and query.operation is None:
            return True
        points = self._plant.access_points(location.name, query.operation or NO_OPERATION)
        return bool(points) if query.point is None else query.point in points

    def find_location_status(self, name: str) -> LocationStatus:
        """Return a location; raises UnknownError."""
        location = self._plant.locations_by_name.get(name)
        if location is None:
            raise UnknownError(Refusal.UNKNOWN_LOCATION, name)
        return self._location_status(location)

    def list_paths(self, request: PathsQuery) -> PathPage:
        """Return a page of paths; raises UnknownError if none has the name ``after``."""
        if request.after is not None:
            self._locks.get(request.after)
        paths = _objects_behind(self._locks.all(), request.after)
        page, following = page_of(
            (path for path in paths if request.locked in (None, path.locked)), request.limit
        )
        return PathPage(paths=page, next=following)

    def _find_point(self, name: str) -> Point:
        point = self._plant.points_by_name.get(name)
        if point is None:
            raise UnknownError(Refusal.UNKNOWN_POINT, name)
        return point

    def _vehicles_by_point(self) -> Mapping[str, Sequence[str]]:
        """Return the vehicles by the point that is their current position."""
        vehicles: defaultdict[str, list[str]] = defaultdict(list)
        for vehicle in self._engine.registry:
            state = self._engine.view(vehicle).state
            point = current_position(vehicle, state, self._plant) if state else None
            if point is not None:
                vehicles[point].append(vehicle.name)
        return vehicles

    def _point_status(self, point: Point, occupied_by: Iterable[str]) -> PointStatus:
        return PointStatus(
            name=point.name,
            type=point.type,
            x=point.x_m,
            y=point.y_m,
            theta=point.heading_rad,
            map_id=point.map_id,
            locations=tuple(self._locations_by_point.get(point.name, ())),
            occupied_by=tuple(sorted(occupied_by)),
            reserved_by=tuple(sorted(self._engine.traffic.scheduler.holders_of(point.name))),
        )

    @cached_property
    def _locations_by_point(self) -> Mapping[str, Sequence[str]]:
        """Names of locations by the points to which they are linked."""
        names: defaultdict[str, list[str]] = defaultdict(list)
        for location in self._plant.locations:
            for link in location.links:
                names[link.point].append(location.name)
        return names

    def _location_status(self, location: Location) -> LocationStatus:
        kind = self._plant.location_type(location.type)
        return LocationStatus(
            name=location.name,
            type=location.type,
            x=location.x_m,
            y=location.y_m,
            locked=location.locked,
            operations=kind.allowed_operations,
            peripheral_operations=kind.allowed_peripheral_operations,
            links=tuple(
                LocationLink(point=link.point, operations=self._plant.link_operations(location, link))
                for link in location.links
            ),
        )


def _objects_behind(objects: Iterable[P], name: str | None) -> Iterator[P]:
    """Yield the objects behind the one of this name; None: all."""
    passed = name is None
    for item in objects:
        if passed:
            yield item
        passed = passed or item.name == name


def plant_model_router(plant_json: bytes, change: ChangePlant | None, trail: Trail) -> APIRouter:
    """Create the routes of the plant model; without ``change`` it is read-only."""
    router = APIRouter(tags=[CHANGE_PLANT.noun.tag])

    @router.get(PLANT_MODEL, operation_id="plantModel", dependencies=[known_query()])
    async def show() -> Response:
        """Return the plant model; lengths in mm, angles in degrees."""
        return Response(plant_json, media_type="application/json")

    if change is None:
        return router

    @router.put(
        PLANT_MODEL,
        operation_id=CHANGE_PLANT.name,
        summary=CHANGE_PLANT.summary,
        response_model=CHANGE_PLANT.answer,
        responses=refusals_of(CHANGE_PLANT.refusals),
        openapi_extra=PLANT_BODY,
        dependencies=[known_query("check")],
    )
    async def put(request: Request, *, check: Annotated[bool, Query()] = False) -> Response:
        """Refused while orders or vehicles use objects that the new model lacks; `check` changes nothing."""
        body = await request.body()
        if check:
            return await _replace_plant(change, body, None)
        origin = origin_of(request, AuditInterface.REST)

        def describe_body() -> str:
            # A plant model has megabytes: its digest proves which one it was.
            return to_masked_json({"bytes": len(body), "sha256": hashlib.sha256(body).hexdigest()})

        asked = ChangingRequest(origin, CHANGE_PLANT.name, "plantModel", "", describe_body)
        with trail.record_request(asked) as open_request:
            return await _replace_plant(change, body, open_request)

    return router


def change_of(model: PlantModel, warnings: Iterable[object], *, changed: bool) -> PlantModelChange:
    """Return the answer to a change of the plant model; not ``changed``: it was only checked."""
    return PlantModelChange(
        name=model.name,
        changed=changed,
        points=len(model.points),
        paths=len(model.paths),
        locations=len(model.locations),
        blocks=len(model.blocks),
        vehicles=len(model.vehicles),
        warnings=tuple(map(str, warnings)),
    )


async def _replace_plant(change: ChangePlant, body: bytes, asked: OpenRequest | None) -> Response:
    """Replace the plant model, or only check whether it can be replaced if nothing is ``asked``."""
    report = await asyncio.to_thread(read_plant, body, strict=True)
    model = report.model
    result = change_of(model, report.warnings, changed=asked is not None)
    if asked:
        asked.name = model.name
        asked.after = to_masked_json({"name": model.name, "points": result.points, "paths": result.paths})
    await change(model, check_only=asked is None)
    return Response(result.model_dump_json(by_alias=True), media_type="application/json")
