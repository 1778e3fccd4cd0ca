"""Zone sets at ``/v1/zoneSets`` (VDA 5050 3.0 section 6.4)."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import BeforeValidator
from pydantic_core import to_json

from nena_order_service.rest.responses import as_json
from nena_order_service.zone_sets import ZoneSets
from nena_shared.fleet_api.base import ObjectName
from nena_shared.fleet_api.plant import StoredZoneSet, ZoneSetList, ZoneSetStatus
from nena_shared.vda5050.zone_set import ZoneSet


def _from_json(value: object) -> ZoneSet:
    """Read it as it comes over MQTT: the standard's objects take JSON's types alone."""
    return ZoneSet.model_validate_json(to_json(value))


def make_router(zone_sets: ZoneSets) -> APIRouter:
    """Make the routes over zone sets."""
    router = APIRouter(prefix="/v1/zoneSets", tags=["zone sets"])

    @router.get("", response_model=ZoneSetList)
    async def list_zone_sets() -> Response:
        """List the zone sets, and how they stand at the robots."""
        return as_json(ZoneSetList(zone_sets=zone_sets.all()))

    @router.get("/{name}", response_model=ZoneSetStatus)
    async def show(name: ObjectName) -> Response:
        """Show how a zone set stands at the robots."""
        return as_json(zone_sets.get(name))

    @router.post("", response_model=ZoneSetStatus)
    async def put(zone_set: Annotated[StoredZoneSet, BeforeValidator(_from_json)]) -> Response:
        """Put a zone set here: the standard's zoneSet object; all robots of 3.0 get it, disabled."""
        return as_json(await zone_sets.put(zone_set))

    @router.post("/{name}/enable", response_model=ZoneSetStatus)
    async def enable(name: ObjectName) -> Response:
        """Have robots use a zone set, and no other one of its map."""
        return as_json(await zone_sets.enable(name))

    @router.delete("/{name}", response_model=ZoneSetStatus)
    async def delete(name: ObjectName) -> Response:
        """Have robots delete a zone set; one that is in use they keep until another one is enabled."""
        return as_json(await zone_sets.delete(name))

    return router
