"""Points and locations in the API: where they are, who uses them, and how they are linked."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.fleet_api.base import ObjectName, PageSize, Resource
from nena_shared.plant_terms import PointType


class PointsQuery(Resource):
    """Filter and page of points."""

    type: list[PointType] | None = None
    map_id: ObjectName | None = None
    vehicle: ObjectName | None = None
    """Only points at which this vehicle stands, or which are reserved for it."""
    limit: PageSize = 100
    after: ObjectName | None = None


class LocationsQuery(Resource):
    """Filter and page of locations."""

    type: ObjectName | None = None
    """Name of the location type."""
    point: ObjectName | None = None
    """Only locations that are linked to this point."""
    operation: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Only locations at which an order may request this operation."""
    limit: PageSize = 100
    after: ObjectName | None = None


class PointStatus(Resource):
    """A point of the plant model, and the vehicles that use it."""

    name: str
    type: PointType
    x: float
    """m in the plant frame."""
    y: float
    theta: float | None = None
    """Heading of a vehicle that ends its drive here, rad; None: any."""
    map_id: str | None = None
    """None: the map of each vehicle."""
    locations: tuple[str, ...]
    """Locations that are linked to it."""
    occupied_by: tuple[str, ...]
    """Vehicles of which it is the current position, also those that reserve nothing."""
    reserved_by: tuple[str, ...]
    """Vehicles for which traffic control holds it."""


class PointPage(Resource):
    """A page of points, in the order of the plant model."""

    points: tuple[PointStatus, ...]
    next: str | None = None
    """Value of ``after`` for the next page; None: this is the last one."""


class LocationLink(Resource):
    """A point from which a location is served, and what can be done there."""

    point: str
    operations: tuple[str, ...]
    """Operations that an order may request at this point; NOP, which only drives there, is always allowed."""


class LocationStatus(Resource):
    """A location of the plant model: what it offers, and where."""

    name: str
    type: str
    """Name of the location type."""
    x: float
    """m in the plant frame."""
    y: float
    locked: bool
    """Whether no vehicle may be sent there."""
    operations: tuple[str, ...]
    """Operations of vehicles, at any of its points."""
    peripheral_operations: tuple[str, ...]
    """Operations of its peripheral device."""
    links: tuple[LocationLink, ...]


class LocationPage(Resource):
    """A page of locations, in the order of the plant model."""

    locations: tuple[LocationStatus, ...]
    next: str | None = None
    """Value of ``after`` for the next page; None: this is the last one."""
