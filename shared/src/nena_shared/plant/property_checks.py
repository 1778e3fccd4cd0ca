"""Suspicious properties: misspelt keys, no value, text where a number is needed, names that lead nowhere."""

from collections.abc import Callable, Container, Iterator, Mapping
from difflib import get_close_matches
from math import isnan
from types import MappingProxyType
from typing import Final

from nena_shared.plant import property_keys as keys
from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.model import RECHARGE_OPERATION, PlantModel

_PREFIXES: Final = ("tcs:", "vda5050:", "nena:")
_NUMBERS: Final = frozenset(
    {
        keys.PARKING_POSITION_PRIORITY,
        keys.VDA5050_DEVIATION_XY,
        keys.VDA5050_DEVIATION_THETA,
    }
)
_TEXTS: Final = frozenset(
    {
        keys.PREFERRED_PARKING_POSITION,
        keys.ASSIGNED_PARKING_POSITION,
        keys.PREFERRED_RECHARGE_LOCATION,
        keys.ASSIGNED_RECHARGE_LOCATION,
        keys.ROUTING_GROUP,
        keys.BLOCK_ENTRY_DIRECTION,
        keys.VDA5050_INTERFACE_NAME,
        keys.VDA5050_MANUFACTURER,
        keys.VDA5050_SERIAL_NUMBER,
        keys.VDA5050_VERSION,
        keys.VDA5050_MAP_ID,
        keys.VDA5050_RECHARGE_OPERATION,
        keys.VEHICLE_TYPE,
        keys.ALLOWED_MAPS,
        keys.ACCEPTABLE_ORDER_TYPES,
    }
)
_COSTS: Final = (keys.ROUTING_COST_FORWARD, keys.ROUTING_COST_REVERSE)
_FAMILIES: Final = (*_COSTS, keys.MAP_TRANSFORM)
_KNOWN: Final = _NUMBERS | _TEXTS | frozenset(_COSTS)
_FOLDED: Final = MappingProxyType({key.casefold(): key for key in _KNOWN})
_SIMILARITY: Final = 0.9

_References = Mapping[str, Callable[[PlantModel], Container[str]]]
_REFERENCES: Final[_References] = MappingProxyType(
    {
        keys.PREFERRED_PARKING_POSITION: lambda model: model.points_by_name,
        keys.ASSIGNED_PARKING_POSITION: lambda model: model.points_by_name,
        keys.PREFERRED_RECHARGE_LOCATION: lambda model: model.locations_by_name,
        keys.ASSIGNED_RECHARGE_LOCATION: lambda model: model.locations_by_name,
        keys.VEHICLE_TYPE: lambda model: model.vehicle_types,
    }
)


def find_property_warnings(model: PlantModel) -> Iterator[Problem]:
    """Yield what is suspicious about the properties of all objects, and a missing charging place."""
    for kind, name, properties in _all_properties(model):
        for key, value in properties.items():
            for code, text in _findings(model, key, value):
                yield Problem(code, kind, name, text)
    if model.vehicles:
        yield from _recharging(model)


def _recharging(model: PlantModel) -> Iterator[Problem]:
    operations = {operation for each in model.location_types for operation in each.allowed_operations}
    if RECHARGE_OPERATION not in operations:
        similar = sorted(each for each in operations if each.casefold() == RECHARGE_OPERATION.casefold())
        hint = f" ({similar[0]!r} is another operation: case counts)" if similar else ""
        text = f"no location type allows {RECHARGE_OPERATION!r}, so no vehicle is sent to recharge{hint}"
        yield Problem("NO_RECHARGE_OPERATION", ObjectKind.MODEL, model.name, text)


def _all_properties(model: PlantModel) -> Iterator[tuple[ObjectKind, str, Mapping[str, str]]]:
    yield ObjectKind.MODEL, model.name, model.properties
    yield from ((ObjectKind.POINT, point.name, point.properties) for point in model.points)
    yield from ((ObjectKind.PATH, path.name, path.properties) for path in model.paths)
    yield from ((ObjectKind.LOCATION_TYPE, each.name, each.properties) for each in model.location_types)
    yield from ((ObjectKind.LOCATION, location.name, location.properties) for location in model.locations)
    yield from ((ObjectKind.BLOCK, block.name, block.properties) for block in model.blocks)
    yield from ((ObjectKind.VEHICLE, vehicle.name, vehicle.properties) for vehicle in model.vehicles)


def _findings(model: PlantModel, key: str, value: str) -> Iterator[tuple[str, str]]:
    if meant := _meant(key):
        yield "MISSPELT_PROPERTY", f"property {key!r} is not known; is {meant!r} meant?"
    if not value.strip():
        yield "EMPTY_PROPERTY", f"property {key!r} has no value"
    elif (key in _NUMBERS or key.startswith(_COSTS)) and not _is_number(value):
        yield "PROPERTY_NOT_A_NUMBER", f"property {key!r} is {value!r}, it must be a number, 0 or more"
    elif _names_nothing(model, key, value):
        yield "PROPERTY_NAMES_NOTHING", f"property {key!r} names {value!r}, which is not there"


def _names_nothing(model: PlantModel, key: str, value: str) -> bool:
    if key == keys.VEHICLE_TYPE and not model.vehicle_types:
        return False
    return key in _REFERENCES and value not in _REFERENCES[key](model)


def _meant(key: str) -> str | None:
    """Return the key that was probably meant, or None if this one is known or simply somebody else's."""
    if key in _KNOWN or key.startswith(_FAMILIES):
        return None
    if key != key.strip():
        return key.strip()
    if not key.casefold().startswith(_PREFIXES):
        return None
    similar = get_close_matches(key.casefold(), _FOLDED, n=1, cutoff=_SIMILARITY)
    return _FOLDED[similar[0]] if similar else None


def _is_number(value: str) -> bool:
    """Whether this is a number from 0 up; `Infinity` is one, for it is a cost that excludes a path."""
    try:
        number = float(value)
    except ValueError:
        return False
    return not isnan(number) and number >= 0
