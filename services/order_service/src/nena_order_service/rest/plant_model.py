"""The plant model at ``/v1/plantModel``: hosts read it, and admins put another one in use."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from nena_order_service.plant_file import read_plant
from nena_order_service.rest.responses import as_json
from nena_order_service.serving import ChangePlant
from nena_shared.fleet_api.plant import PlantModelChange
from nena_shared.plant.exchange import JSON_LIMITS

PATH = "/v1/plantModel"
MAX_BYTES = JSON_LIMITS.size_bytes

BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"type": "object"}},
            "application/xml": {"schema": {"type": "string"}},
        },
    }
}


def make_router(plant_json: bytes, change: ChangePlant | None) -> APIRouter:
    """Make the routes over a plant model; without ``change`` it is only read."""
    router = APIRouter(tags=["plant model"])

    @router.get(PATH)
    async def show() -> Response:
        """Give the plant model; lengths in mm, angles in degrees."""
        return Response(plant_json, media_type="application/json")

    if change is not None:
        _add_change(router, change)
    return router


def _add_change(router: APIRouter, change: ChangePlant) -> None:
    @router.put(PATH, response_model=PlantModelChange, openapi_extra=BODY)
    async def put(request: Request, *, check: Annotated[bool, Query()] = False) -> Response:
        """Put another plant model in use: openTCS's XML, LIF by its standard, or NeNa's own JSON.

        Refused where orders or vehicles use what it does not have; with ``check`` it is only looked at.
        """
        data = await request.body()
        report = await asyncio.to_thread(read_plant, data, strict=True)
        model = report.model
        await change(model, check_only=check)
        return as_json(
            PlantModelChange(
                name=model.name,
                changed=not check,
                points=len(model.points),
                paths=len(model.paths),
                locations=len(model.locations),
                blocks=len(model.blocks),
                vehicles=len(model.vehicles),
                warnings=tuple(map(str, report.warnings)),
            )
        )
