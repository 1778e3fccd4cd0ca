"""Requests of hosts about the points, locations and paths of the plant model, and who uses them."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import islice
from typing import TypeVar

from nena_order_service.engine.engine import Engine
from nena_order_service.engine.path_locks import PathLocks
from nena_order_service.engine.status import current_position
from nena_order_service.errors import UnknownLocationError, UnknownPointError, UnknownVehicleError
from nena_shared.fleet_api.places import (
    LocationLink,
    LocationPage,
    LocationsQuery,
    LocationStatus,
    PointPage,
    PointsQuery,
    PointStatus,
)
from nena_shared.fleet_api.plant import PathPage, PathsQuery, PathStatus
from nena_shared.plant import Location, Point
from nena_shared.plant.model import NO_OPERATION

LOOKED_AT_ONCE = 100
"""Number of vehicles located before other tasks run; each takes up to 0.1 ms."""

P = TypeVar("P", Point, Location, PathStatus)


class PlaceRequests:
    """Returns points and locations; the plant model of an engine never changes."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._plant = engine.plant

    async def points(self, query: PointsQuery) -> PointPage:
        """Return a page of points.

        Raises:
            UnknownPointError: no point has the name ``after``.
            UnknownVehicleError: no vehicle has the name that is asked for.

        """
        if query.vehicle is not None and self._engine.registry.named(query.vehicle) is None:
            raise UnknownVehicleError(query.vehicle)
        if query.after is not None:
            self._point(query.after)
        occupants = await self._occupants()
        holders, vehicle = self._engine.traffic.holders, query.vehicle
        points = (
            each
            for each in _behind(self._plant.points, query.after)
            if (not query.type or each.type in query.type)
            and query.map_id in (None, each.map_id)
            and (vehicle is None or vehicle in occupants.get(each.name, ()) or vehicle in holders(each.name))
        )
        page, following = _page(points, query.limit)
        statuses = (self._point_status(each, occupants.get(each.name, ())) for each in page)
        return PointPage(points=tuple(statuses), next=following)

    async def point(self, name: str) -> PointStatus:
        """Return a point; raises UnknownPointError."""
        point = self._point(name)
        return self._point_status(point, (await self._occupants()).get(name, ()))

    def locations(self, query: LocationsQuery) -> LocationPage:
        """Return a page of locations.

        Raises:
            UnknownLocationError: no location has the name ``after``.
            UnknownPointError: no point has the name that is asked for.

        """
        if query.after is not None:
            self.location(query.after)
        if query.point is not None:
            self._point(query.point)
        wanted = (each for each in _behind(self._plant.locations, query.after) if self._fits(each, query))
        page, following = _page(wanted, query.limit)
        return LocationPage(locations=tuple(map(self._location_status, page)), next=following)

    def _fits(self, location: Location, query: LocationsQuery) -> bool:
        if query.type not in (None, location.type):
            return False
        if query.point is None and query.operation is None:
            return True
        points = self._plant.access_points(location.name, query.operation or NO_OPERATION)
        return bool(points) if query.point is None else query.point in points

    def location(self, name: str) -> LocationStatus:
        """Return a location; raises UnknownLocationError."""
        location = self._plant.locations_by_name.get(name)
        if location is None:
            raise UnknownLocationError(name)
        return self._location_status(location)

    def _point(self, name: str) -> Point:
        point = self._plant.points_by_name.get(name)
        if point is None:
            raise UnknownPointError(name)
        return point

    async def _occupants(self) -> Mapping[str, Sequence[str]]:
        """Return the vehicles by the point that is their current position; other tasks run in between."""
        found: defaultdict[str, list[str]] = defaultdict(list)
        for number, vehicle in enumerate(tuple(self._engine.registry), 1):
            state = self._engine.view(vehicle).state
            point = current_position(vehicle, state, self._plant) if state else None
            if point is not None:
                found[point].append(vehicle.name)
            if number % LOOKED_AT_ONCE == 0:
                await asyncio.sleep(0)
        return found

    def _point_status(self, point: Point, occupied_by: Iterable[str]) -> PointStatus:
        return PointStatus(
            name=point.name,
            type=point.type,
            x=point.x_m,
            y=point.y_m,
            theta=point.heading_rad,
            map_id=point.map_id,
            locations=tuple(self._linked.get(point.name, ())),
            occupied_by=tuple(sorted(occupied_by)),
            reserved_by=tuple(sorted(self._engine.traffic.holders(point.name))),
        )

    @cached_property
    def _linked(self) -> Mapping[str, Sequence[str]]:
        """Names of locations by the points to which they are linked."""
        found: defaultdict[str, list[str]] = defaultdict(list)
        for location in self._plant.locations:
            for link in location.links:
                found[link.point].append(location.name)
        return found

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


def path_page(locks: PathLocks, query: PathsQuery) -> PathPage:
    """Return a page of paths.

    Raises:
        UnknownPathError: no path has the name ``after``.

    """
    if query.after is not None:
        locks.get(query.after)
    wanted = (each for each in _behind(locks.all(), query.after) if query.locked in (None, each.locked))
    page, following = _page(wanted, query.limit)
    return PathPage(paths=tuple(page), next=following)


def _behind(objects: Iterable[P], name: str | None) -> Iterator[P]:
    """Yield the objects behind the one of this name; None: all."""
    passed = name is None
    for each in objects:
        if passed:
            yield each
        passed = passed or each.name == name


def _page(objects: Iterable[P], limit: int | None) -> tuple[list[P], str | None]:
    """Return the first ``limit`` objects, and the name of the last of them if there are more; None: all."""
    if limit is None:
        return list(objects), None
    found = list(islice(objects, limit + 1))
    return found[:limit], found[limit - 1].name if len(found) > limit else None
