"""Plant models of openTCS's web API: the content of its XML, in JSON.

What hosts send becomes the XML document of the same content, whose reader checks it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from operator import attrgetter
from typing import Annotated, Any, Final
from xml.etree.ElementTree import Element, tostring

from fastapi import Body as RequestBody
from fastapi import FastAPI, Query, Response
from pydantic import JsonValue
from starlette.exceptions import HTTPException

from nena_order_service.engine.path_locks import PathLocks
from nena_order_service.errors import InvalidPlantError, UnknownError
from nena_order_service.extension import EditPlant
from nena_order_service.extensions.opentcs.answers import Body
from nena_order_service.plant_file import read_plant
from nena_plant_formats.opentcs_xml.names import NEEDED, PARTS, VALUES, WITH_PROPERTIES, Value
from nena_plant_formats.opentcs_xml.writer import VERSION, add
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.plant import EnergyThresholds, ObjectKind, PlantModel, PlantModelError, PlantProblem

ChangePlant = Callable[[PlantModel | EditPlant], Awaitable[None]]
Json = dict[str, Any]


def plant_json(model: PlantModel) -> Json:
    """Return a plant model in the form of ``GET /plantModel``, without the rules of LIF."""
    shown, layout = json_of("model", model), model.visual_layout
    for point, body in zip(model.points, shown["points"], strict=True):
        body["layout"]["position"] = {"x": point.x_mm, "y": point.y_mm}
    for location, body in zip(model.locations, shown["locations"], strict=True):
        drawn = location.layout.position or location
        body["layout"]["position"] = {"x": drawn.x_mm, "y": drawn.y_mm}
    for point in (point for path in shown["paths"] for point in path["layout"]["controlPoints"]):
        # As in the XML file, control points are in pixels, y downwards.
        point["x"] = round(point["x"] / layout.scale_x_mm_per_px)
        point["y"] = round(-point["y"] / layout.scale_y_mm_per_px)
    for body in shown["vehicles"]:
        body["length"] = body["boundingBox"]["length"]
    return shown


def json_of(tag: str, shown: Any) -> Json:  # noqa: ANN401 - an object of the plant model
    """Return an object of the plant model, by the tag of its XML element."""
    body: Json = {}
    for value in VALUES[tag]:
        *way, key = value.json.split(".")
        holder = body
        for step in way:
            holder = holder.setdefault(step, {})
        content = attrgetter(value.model)(shown)
        holder[key] = value.default if content is None else content
    for part in PARTS.get(tag, ()):
        content = getattr(shown, part.model) if part.model else shown
        if part.kind is dict:
            body[part.json] = json_of(part.tag, content)
        else:
            body[part.json] = (
                [*content] if part.kind is str else [json_of(part.tag, item) for item in content]
            )
    if tag in WITH_PROPERTIES:
        body["properties"] = [{"name": key, "value": value} for key, value in shown.properties.items()]
    return body


ONE_LAYER: Final = {
    "layers": [{"id": 0, "ordinal": 0, "visible": True, "name": "Layer 0", "groupId": 0}],
    "layerGroups": [{"id": 0, "name": "Group 0", "visible": True}],
}


def plant_xml(content: JsonValue) -> bytes:
    """Return the XML of a plant model in the form of ``PUT /plantModel``.

    Raises:
        PlantModelError: the content does not have that form.
    """
    try:
        body = _as_object(content)
        layout = _as_object(body.get("visualLayout") or {"name": "VLayout"})
        layers = {name: layout.get(name) or default for name, default in ONE_LAYER.items()}
        vehicles = [
            {**vehicle, "boundingBox": vehicle.get("boundingBox") or {"length": vehicle.get("length")}}
            for vehicle in _objects_in(body, "vehicles")
        ]
        root = Element("model", version=VERSION, name=str(body["name"]))
        _add_parts(root, {**body, "vehicles": vehicles, "visualLayout": layout | layers})
        return tostring(root)
    except (KeyError, TypeError, ValueError) as error:
        what = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else str(error)
        text = f"the plant model does not have the form of openTCS's web API: {what}"
        raise PlantModelError([PlantProblem("BAD_VALUE", ObjectKind.MODEL, "", text)]) from error


def _add_parts(element: Element, body: Json) -> None:
    """Add the objects within an object to its element."""
    for part in PARTS.get(element.tag, ()):
        if part.kind is str:
            for name in body.get(part.json) or ():
                add(element, part.tag, name=name)
        else:
            single = part.kind is dict
            for inner in [_as_object(body.get(part.json) or {})] if single else _objects_in(body, part.json):
                values = {value.xml or value.json: _value_in(inner, value) for value in VALUES[part.tag]}
                _add_parts(add(element, part.tag, **values), inner)
    for item in _objects_in(body, "properties") if element.tag in WITH_PROPERTIES else ():
        add(element, "property", name=item.get("name", item.get("key")), value=item["value"])


def _value_in(body: Json, value: Value) -> Any:  # noqa: ANN401 - JSON
    """Return a value of an object, or its default."""
    *way, key = value.json.split(".")
    for step in way:
        body = _as_object(body.get(step) or {})
    content = body.get(key)
    if content is None and value.default is NEEDED:
        raise KeyError(key)
    return value.default if content is None else content


def _objects_in(body: Json, name: str) -> list[Json]:
    objects = body.get(name) or []
    if not isinstance(objects, list):
        raise TypeError(f"{name} is not a list")
    return [_as_object(item) for item in objects]


def _as_object(value: Any) -> Json:  # noqa: ANN401 - JSON
    if not isinstance(value, dict):
        raise TypeError(f"{str(value)[:60]!r} is not an object")
    return value


class TopologyUpdate(Body):
    """The paths whose locks should affect routes; empty: all."""

    paths: tuple[str, ...] = ()


class Thresholds(Body):
    """Energy levels in percent."""

    energy_level_critical: int
    energy_level_good: int
    energy_level_sufficiently_recharged: int
    energy_level_fully_recharged: int


def add_routes(app: FastAPI, plant: PlantModel, locks: PathLocks, change_plant: ChangePlant) -> None:
    """Add the routes that show the plant model and change its locations and vehicles."""
    _add_vehicle_data(app, plant, change_plant)

    @app.get("/v1/plantModel", response_model=None)
    async def show() -> Json:
        return plant_json(plant)

    @app.put("/v1/plantModel", response_class=Response)
    async def replace(body: Annotated[JsonValue, RequestBody()]) -> None:
        try:
            # 0110: by way of XML, so that the checks of its reader exist only once.
            report = await asyncio.to_thread(lambda: read_plant(plant_xml(body), strict=False))
        except PlantModelError as error:
            raise InvalidPlantError([str(problem) for problem in error.problems]) from error
        await change_plant(report.model)

    @app.post("/v1/plantModel/topologyUpdateRequest", response_class=Response)
    async def update(body: TopologyUpdate | None = None) -> None:
        """Do nothing: locks affect routes at once."""
        for name in body.paths if body else ():
            locks.get(name)  # raises an error if there is no such path

    @app.put("/v1/locations/{name:path}/locked", response_class=Response)
    async def lock_location(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> None:
        if name not in plant.locations_by_name:
            raise HTTPException(HTTPStatus.NOT_FOUND, f"Could not find location {name!r}.")
        await change_plant(lambda present: _change_object(present, "locations", name, locked=new_value))


def _add_vehicle_data(app: FastAPI, plant: PlantModel, change_plant: ChangePlant) -> None:
    async def change_vehicle(name: str, **fields: object) -> None:
        if name not in plant.vehicles_by_name:
            raise UnknownError(Refusal.UNKNOWN_VEHICLE, name)
        await change_plant(lambda present: _change_object(present, "vehicles", name, **fields))

    @app.put("/v1/vehicles/{name:path}/energyLevelThresholdSet", response_class=Response)
    async def set_thresholds(name: str, body: Thresholds) -> None:
        levels = EnergyThresholds(
            critical=body.energy_level_critical,
            good=body.energy_level_good,
            sufficiently_recharged=body.energy_level_sufficiently_recharged,
            fully_recharged=body.energy_level_fully_recharged,
        )
        await change_vehicle(name, energy_thresholds=levels)

    @app.put("/v1/vehicles/{name:path}/envelopeKey", response_class=Response)
    async def set_envelope(name: str, key: Annotated[str | None, Query(alias="newValue")] = None) -> None:
        await change_vehicle(name, envelope_key=key)


def _change_object(plant: PlantModel, kind: str, name: str, **fields: object) -> PlantModel:
    """Return a plant model with other fields of one of its objects; the same one if nothing changes."""
    objects = getattr(plant, kind)
    changed = tuple(item.model_copy(update=fields) if item.name == name else item for item in objects)
    if changed == objects:
        return plant
    # pydantic's model_copy would keep the plant model's cached indexes by name
    present = {field: getattr(plant, field) for field in PlantModel.model_fields}
    return PlantModel.model_construct(**{**present, kind: changed})
