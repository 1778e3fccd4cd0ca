"""Plant models of openTCS's web API: the content of its XML, in JSON."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterable, Mapping
from http import HTTPStatus
from typing import Annotated, Any, Final
from xml.etree.ElementTree import Element, SubElement, tostring

from fastapi import Body as RequestBody
from fastapi import FastAPI, Query, Response
from pydantic import JsonValue
from starlette.exceptions import HTTPException

from nena_order_service.api.opentcs_answers import Body, done
from nena_order_service.engine.path_locks import PathLocks
from nena_order_service.errors import InvalidPlantError, UnknownVehicleError
from nena_order_service.plant_file import read_plant
from nena_plant_formats.opentcs_xml.writer import VERSION
from nena_shared.plant import (
    BoundingBox,
    EnergyThresholds,
    Location,
    ObjectKind,
    Path,
    PlantModel,
    PlantModelError,
    PlantProblem,
    Point,
    Vehicle,
    VisualLayout,
)
from nena_shared.plant.track import Envelope, LabelLayout

EditPlant = Callable[[PlantModel], PlantModel]
"""Returns the changed plant model; the same object if nothing changes."""
ChangePlant = Callable[[PlantModel | EditPlant], Awaitable[None]]
Json = dict[str, Any]


def plant_json(model: PlantModel) -> Json:
    """Return a plant model in the form of ``GET /plantModel``, without the rules of LIF."""
    layout = model.visual_layout
    return {
        "name": model.name,
        "points": [_point(each) for each in model.points],
        "paths": [_path(each, layout.scale_x_mm_per_px, layout.scale_y_mm_per_px) for each in model.paths],
        "locationTypes": [
            {
                "name": each.name,
                "allowedOperations": list(each.allowed_operations),
                "allowedPeripheralOperations": list(each.allowed_peripheral_operations),
                "layout": {"locationRepresentation": each.representation or "NONE"},
                "properties": _properties(each.properties),
            }
            for each in model.location_types
        ],
        "locations": [_location(each) for each in model.locations],
        "blocks": [
            {
                "name": each.name,
                "type": each.type.value,
                "memberNames": list(each.members),
                "layout": {"color": each.color or "#FF0000"},
                "properties": _properties(each.properties),
            }
            for each in model.blocks
        ],
        "vehicles": [_vehicle(each) for each in model.vehicles],
        "visualLayout": _visual_layout(layout),
        "properties": _properties(model.properties),
    }


def _point(each: Point) -> Json:
    return {
        "name": each.name,
        "position": _triple(each.x_mm, each.y_mm, each.z_mm),
        "vehicleOrientationAngle": "NaN" if each.orientation_deg is None else each.orientation_deg,
        "type": each.type.value,
        "vehicleEnvelopes": _envelopes(each.envelopes),
        "maxVehicleBoundingBox": _box(each.max_vehicle_bounding_box),
        "layout": {"position": {"x": each.x_mm, "y": each.y_mm}, **_label(each.layout)},
        "properties": _properties(each.properties),
    }


def _vehicle(each: Vehicle) -> Json:
    return {
        "name": each.name,
        "length": each.bounding_box.length_mm,
        "boundingBox": _box(each.bounding_box),
        "energyLevelCritical": each.energy_thresholds.critical,
        "energyLevelGood": each.energy_thresholds.good,
        "energyLevelFullyRecharged": each.energy_thresholds.fully_recharged,
        "energyLevelSufficientlyRecharged": each.energy_thresholds.sufficiently_recharged,
        "maxVelocity": each.max_velocity_mm_s,
        "maxReverseVelocity": each.max_reverse_velocity_mm_s,
        "envelopeKey": each.envelope_key,
        "layout": {"routeColor": each.color or "#00FF00"},
        "properties": _properties(each.properties),
    }


def _visual_layout(layout: VisualLayout) -> Json:
    return {
        "name": layout.name,
        "scaleX": layout.scale_x_mm_per_px,
        "scaleY": layout.scale_y_mm_per_px,
        "layers": [
            {
                "id": each.id,
                "ordinal": each.ordinal,
                "visible": each.visible,
                "name": each.name,
                "groupId": each.group_id,
            }
            for each in layout.layers
        ],
        "layerGroups": [
            {"id": each.id, "name": each.name, "visible": each.visible} for each in layout.layer_groups
        ],
        "properties": _properties(layout.properties),
    }


def _path(path: Path, scale_x: float, scale_y: float) -> Json:
    return {
        "name": path.name,
        "srcPointName": path.source,
        "destPointName": path.destination,
        "length": path.length_mm,
        "maxVelocity": path.max_velocity_mm_s,
        "maxReverseVelocity": path.max_reverse_velocity_mm_s,
        "peripheralOperations": [
            {
                "operation": each.name,
                "locationName": each.location,
                "executionTrigger": each.execution_trigger.value,
                "completionRequired": each.completion_required,
            }
            for each in path.peripheral_operations
        ],
        "locked": path.locked,
        "vehicleEnvelopes": _envelopes(path.envelopes),
        "layout": {
            "connectionType": path.layout.connection_type.value,
            "controlPoints": [  # pixels, y downwards
                {"x": round(each.x_mm / scale_x), "y": round(-each.y_mm / scale_y)}
                for each in path.layout.control_points
            ],
            "layerId": path.layout.layer_id,
        },
        "properties": _properties(path.properties),
    }


def _location(location: Location) -> Json:
    layout = location.layout
    drawn = layout.position
    return {
        "name": location.name,
        "typeName": location.type,
        "position": _triple(location.x_mm, location.y_mm, location.z_mm),
        "links": [
            {"pointName": each.point, "allowedOperations": list(each.allowed_operations)}
            for each in location.links
        ],
        "locked": location.locked,
        "layout": {
            "position": {
                "x": drawn.x_mm if drawn else location.x_mm,
                "y": drawn.y_mm if drawn else location.y_mm,
            },
            "locationRepresentation": layout.representation or "DEFAULT",
            **_label(layout),
        },
        "properties": _properties(location.properties),
    }


def _triple(x: int, y: int, z: int) -> Json:
    return {"x": x, "y": y, "z": z}


def _label(label: LabelLayout) -> Json:
    offset = {"x": label.label_offset_x_px, "y": label.label_offset_y_px}
    return {"labelOffset": offset, "layerId": label.layer_id}


def _box(box: BoundingBox) -> Json:
    offset = {"x": box.reference_offset_x_mm, "y": box.reference_offset_y_mm}
    return {
        "length": box.length_mm,
        "width": box.width_mm,
        "height": box.height_mm,
        "referenceOffset": offset,
    }


def _envelopes(envelopes: Iterable[Envelope]) -> list[Json]:
    return [
        {"envelopeKey": each.key, "vertices": [{"x": v.x_mm, "y": v.y_mm} for v in each.vertices]}
        for each in envelopes
    ]


def _properties(properties: Mapping[str, str]) -> list[Json]:
    return [{"name": key, "value": value} for key, value in properties.items()]


# From JSON to the XML document of the same content, whose reader checks it.


def plant_xml(content: JsonValue) -> bytes:
    """Return the XML of a plant model in the form of ``PUT /plantModel``.

    Raises:
        PlantModelError: the content does not have that form.
    """
    try:
        return tostring(_model(_object(content)))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        what = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else str(error)
        text = f"the plant model does not have the form of openTCS's web API: {what}"
        raise PlantModelError([PlantProblem("BAD_VALUE", ObjectKind.MODEL, "", text)]) from error


_BOX: Final = {"length": 1000, "width": 1000, "height": 1000}


def _model(content: Json) -> Element:
    root = Element("model", version=VERSION, name=str(content["name"]))
    for each in _list(content, "points"):
        position = each.get("position") or {}
        made = _add(
            root,
            "point",
            name=each["name"],
            **{f"position{axis.upper()}": position.get(axis, 0) for axis in "xyz"},
            vehicleOrientationAngle=each.get("vehicleOrientationAngle", "NaN"),
            type=each.get("type", "HALT_POSITION"),
        )
        _add_box(made, "maxVehicleBoundingBox", each.get("maxVehicleBoundingBox"))
        _add_envelopes(made, each)
        _add_properties(made, each)
        _add(made, "pointLayout", **_label_of(each))
    for each in _list(content, "paths"):
        _add_path(root, each)
    for each in _list(content, "vehicles"):
        _add_vehicle(root, each)
    for each in _list(content, "locationTypes"):
        made = _add(root, "locationType", name=each["name"])
        _add_names(made, "allowedOperation", each.get("allowedOperations"))
        _add_names(made, "allowedPeripheralOperation", each.get("allowedPeripheralOperations"))
        _add_properties(made, each)
        drawn = (each.get("layout") or {}).get("locationRepresentation")
        _add(made, "locationTypeLayout", locationRepresentation=drawn or "NONE")
    for each in _list(content, "locations"):
        _add_location(root, each)
    for each in _list(content, "blocks"):
        made = _add(root, "block", name=each["name"], type=each.get("type", "SINGLE_VEHICLE_ONLY"))
        _add_names(made, "member", each.get("memberNames"))
        _add_properties(made, each)
        _add(made, "blockLayout", color=(each.get("layout") or {}).get("color") or "#FF0000")
    _add_visual_layout(root, content.get("visualLayout") or {"name": "VLayout"})
    _add_properties(root, content)
    return root


def _add_path(root: Element, path: Json) -> None:
    made = _add(
        root,
        "path",
        name=path["name"],
        sourcePoint=path["srcPointName"],
        destinationPoint=path["destPointName"],
        length=path.get("length", 1),
        maxVelocity=path.get("maxVelocity", 0),
        maxReverseVelocity=path.get("maxReverseVelocity", 0),
        locked=path.get("locked", False),
    )
    for each in _list(path, "peripheralOperations"):
        _add(
            made,
            "peripheralOperation",
            name=each["operation"],
            locationName=each["locationName"],
            executionTrigger=each.get("executionTrigger", "AFTER_ALLOCATION"),
            completionRequired=each.get("completionRequired", False),
        )
    _add_envelopes(made, path)
    _add_properties(made, path)
    layout = path.get("layout") or {}
    drawn = _add(
        made,
        "pathLayout",
        connectionType=layout.get("connectionType", "DIRECT"),
        layerId=layout.get("layerId", 0),
    )
    for each in _list(layout, "controlPoints"):
        _add(drawn, "controlPoint", x=each["x"], y=each["y"])


def _add_vehicle(root: Element, vehicle: Json) -> None:
    levels = {"Critical": 30, "Good": 90, "FullyRecharged": 90, "SufficientlyRecharged": 30}
    key = vehicle.get("envelopeKey")
    made = _add(
        root,
        "vehicle",
        name=vehicle["name"],
        **{f"energyLevel{name}": vehicle.get(f"energyLevel{name}", usual) for name, usual in levels.items()},
        maxVelocity=vehicle.get("maxVelocity", 1000),
        maxReverseVelocity=vehicle.get("maxReverseVelocity", 1000),
        **({} if key is None else {"envelopeKey": key}),
    )
    length = vehicle.get("length", _BOX["length"])
    _add_box(made, "boundingBox", vehicle.get("boundingBox") or {**_BOX, "length": length})
    _add_properties(made, vehicle)
    _add(made, "vehicleLayout", color=(vehicle.get("layout") or {}).get("routeColor") or "#00FF00")


def _add_location(root: Element, location: Json) -> None:
    position = location.get("position") or {}
    made = _add(
        root,
        "location",
        name=location["name"],
        **{f"position{axis.upper()}": position.get(axis, 0) for axis in "xyz"},
        type=location["typeName"],
        locked=location.get("locked", False),
    )
    for each in _list(location, "links"):
        _add_names(
            _add(made, "link", point=each["pointName"]), "allowedOperation", each.get("allowedOperations")
        )
    _add_properties(made, location)
    drawn = (location.get("layout") or {}).get("locationRepresentation")
    _add(made, "locationLayout", locationRepresentation=drawn or "DEFAULT", **_label_of(location))


def _add_visual_layout(root: Element, layout: Json) -> None:
    made = _add(
        root,
        "visualLayout",
        name=layout["name"],
        scaleX=layout.get("scaleX", 50.0),
        scaleY=layout.get("scaleY", 50.0),
    )
    for each in _list(layout, "layers") or [
        {"id": 0, "ordinal": 0, "visible": True, "name": "Layer 0", "groupId": 0}
    ]:
        _add(made, "layer", **{key: each[key] for key in ("id", "ordinal", "visible", "name", "groupId")})
    for each in _list(layout, "layerGroups") or [{"id": 0, "name": "Group 0", "visible": True}]:
        _add(made, "layerGroup", **{key: each[key] for key in ("id", "name", "visible")})
    _add_properties(made, layout)


def _label_of(thing: Json) -> Json:
    layout = thing.get("layout") or {}
    offset = layout.get("labelOffset") or {}
    return {
        "labelOffsetX": offset.get("x", -10),
        "labelOffsetY": offset.get("y", -20),
        "layerId": layout.get("layerId", 0),
    }


def _add(parent: Element, tag: str, **attributes: Any) -> Element:  # noqa: ANN401 - JSON
    texts = {
        name: str(value).lower() if isinstance(value, bool) else str(value)
        for name, value in attributes.items()
    }
    return SubElement(parent, tag, texts)


def _add_names(parent: Element, tag: str, names: Iterable[str] | None) -> None:
    for name in names or ():
        _add(parent, tag, name=name)


def _add_box(parent: Element, tag: str, box: Json | None) -> None:
    sizes = {name: (box or _BOX).get(name, usual) for name, usual in _BOX.items()}
    offset = (box or {}).get("referenceOffset") or {}
    _add(parent, tag, **sizes, referenceOffsetX=offset.get("x", 0), referenceOffsetY=offset.get("y", 0))


def _add_envelopes(parent: Element, thing: Json) -> None:
    for each in _list(thing, "vehicleEnvelopes"):
        made = _add(parent, "vehicleEnvelope", key=each["envelopeKey"])
        for vertex in _list(each, "vertices"):
            _add(made, "vertex", x=vertex["x"], y=vertex["y"])


def _add_properties(parent: Element, thing: Json) -> None:
    for each in _list(thing, "properties"):
        _add(parent, "property", name=each.get("name", each.get("key")), value=each["value"])


def _list(thing: Json, name: str) -> list[Json]:
    found = thing.get(name) or []
    if not isinstance(found, list):
        message = f"{name} is not a list"
        raise TypeError(message)
    return [_object(each) for each in found]


def _object(value: Any) -> Json:  # noqa: ANN401 - JSON
    if not isinstance(value, dict):
        message = f"{str(value)[:60]!r} is not an object"
        raise TypeError(message)
    return value


# Routes


class TopologyUpdate(Body):
    """The paths whose locks should affect routes; empty: all."""

    paths: tuple[str, ...] = ()


def _add_model(app: FastAPI, plant: PlantModel, locks: PathLocks, change_plant: ChangePlant) -> None:
    @app.get("/v1/plantModel")
    async def show() -> Response:
        return Response(json.dumps(plant_json(plant)), media_type="application/json")

    @app.put("/v1/plantModel", response_class=Response)
    async def replace(body: Annotated[JsonValue, RequestBody()]) -> Response:
        try:
            report = await asyncio.to_thread(lambda: read_plant(plant_xml(body), strict=False))
        except PlantModelError as error:
            raise InvalidPlantError([str(each) for each in error.problems]) from error
        await change_plant(report.model)
        return done()

    @app.post("/v1/plantModel/topologyUpdateRequest", response_class=Response)
    async def update(body: TopologyUpdate | None = None) -> Response:
        """Do nothing: locks affect routes at once."""
        for name in body.paths if body else ():
            locks.get(name)
        return done()

    @app.put("/v1/locations/{name:path}/locked", response_class=Response)
    async def lock_location(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> Response:
        def lock(present: PlantModel) -> PlantModel:
            known = present.locations_by_name.get(name)
            if known is None or known.locked is new_value:
                return present
            made = known.model_copy(update={"locked": new_value})
            locations = tuple(made if each is known else each for each in present.locations)
            return _changed(present, locations=locations)

        if name not in plant.locations_by_name:
            raise HTTPException(HTTPStatus.NOT_FOUND, f"Could not find location {name!r}.")
        await change_plant(lock)
        return done()


def _changed(plant: PlantModel, **fields: object) -> PlantModel:
    """Return a plant model with changed fields; pydantic's model_copy would keep indexes cached by name."""
    present = {name: getattr(plant, name) for name in PlantModel.model_fields}
    return PlantModel.model_construct(**{**present, **fields})


class Thresholds(Body):
    """Energy levels in percent."""

    energy_level_critical: int
    energy_level_good: int
    energy_level_sufficiently_recharged: int
    energy_level_fully_recharged: int


def _add_vehicle_data(app: FastAPI, plant: PlantModel, change_plant: ChangePlant) -> None:
    """Add the routes that change vehicles in the plant model."""

    async def change(name: str, **fields: object) -> Response:
        def edit(present: PlantModel) -> PlantModel:
            known = present.vehicles_by_name.get(name)
            if known is None or (made := known.model_copy(update=fields)) == known:
                return present
            vehicles = tuple(made if each is known else each for each in present.vehicles)
            return _changed(present, vehicles=vehicles)

        if name not in plant.vehicles_by_name:
            raise UnknownVehicleError(name)
        await change_plant(edit)
        return done()

    @app.put("/v1/vehicles/{name}/energyLevelThresholdSet", response_class=Response)
    async def set_thresholds(name: str, body: Thresholds) -> Response:
        levels = EnergyThresholds(
            critical=body.energy_level_critical,
            good=body.energy_level_good,
            sufficiently_recharged=body.energy_level_sufficiently_recharged,
            fully_recharged=body.energy_level_fully_recharged,
        )
        return await change(name, energy_thresholds=levels)

    @app.put("/v1/vehicles/{name}/envelopeKey", response_class=Response)
    async def set_envelope(name: str, key: Annotated[str | None, Query(alias="newValue")] = None) -> Response:
        return await change(name, envelope_key=key)


def add_routes(app: FastAPI, plant: PlantModel, locks: PathLocks, change_plant: ChangePlant) -> None:
    """Add the routes that show the plant model and change its locations and vehicles."""
    _add_model(app, plant, locks, change_plant)
    _add_vehicle_data(app, plant, change_plant)
