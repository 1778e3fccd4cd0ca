"""Find errors and suspicious content (warnings) in plant models of any format."""

import re
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Container, Iterator, Mapping
from difflib import get_close_matches
from itertools import chain
from math import isnan
from types import MappingProxyType
from typing import Final

from nena_shared.fleet_api.topics import suits_all_brokers
from nena_shared.plant import driver_properties as driver
from nena_shared.plant import property_keys as keys
from nena_shared.plant.errors import ObjectKind, PlantProblem
from nena_shared.plant.geometry import parse_transform
from nena_shared.plant.model import NO_OPERATION, RECHARGE_OPERATION, PlantModel, action_of, transform_texts
from nena_shared.plant.track import BACKWARD_SUFFIX
from nena_shared.plant_terms import PointType

LONGEST_NAME: Final = 200
"""Maximum length of a name in requests, characters; objects with longer names cannot be addressed."""


def find_errors(model: PlantModel) -> tuple[PlantProblem, ...]:
    """Return all errors that make a model unusable, such as dangling references."""
    return (
        *_name_errors(model),
        *_reference_errors(model),
        *_member_errors(model),
        *_transform_errors(model),
    )


def find_warnings(model: PlantModel) -> tuple[PlantProblem, ...]:
    """Return all warnings: content that the author probably did not intend."""
    return (
        *_name_warnings(model),
        *_track_warnings(model),
        *_location_warnings(model),
        *find_property_warnings(model),
    )


def disconnected_points(model: PlantModel) -> tuple[str, ...]:
    """Return the points outside the strongly connected component of the point with the most edges.

    Empty if every point is reachable from every other one.
    """
    forward: defaultdict[str, list[str]] = defaultdict(list)
    backward: defaultdict[str, list[str]] = defaultdict(list)
    for edge in model.edges():
        if not edge.path.locked:
            forward[edge.source].append(edge.destination)
            backward[edge.destination].append(edge.source)
    names = [point.name for point in model.points]
    if not names:
        return ()
    # the best connected point is almost surely in the part that the author means to be the plant
    start = max(names, key=lambda name: min(len(forward[name]), len(backward[name])))
    connected = _reachable_from(start, forward) & _reachable_from(start, backward)
    return tuple(name for name in names if name not in connected)


def _reachable_from(start: str, neighbours: Mapping[str, list[str]]) -> set[str]:
    seen = {start}
    waiting = deque([start])
    while waiting:
        for name in neighbours[waiting.popleft()]:
            if name not in seen:
                seen.add(name)
                waiting.append(name)
    return seen


_PREFIXES: Final = ("tcs:", "vda5050:", "nena:")
_OTHER_SIGN: Final = re.compile(r"(tcs|vda5050|nena)[.;/_-]", re.IGNORECASE)
"""Another sign where a key has its colon."""
_NUMBERS: Final = frozenset(
    {
        keys.PARKING_POSITION_PRIORITY,
        keys.VDA5050_DEVIATION_XY,
        keys.VDA5050_DEVIATION_THETA,
        keys.VDA5050_CORRIDOR_WIDTH,
    }
)
_COSTS: Final = (keys.ROUTING_COST_FORWARD, keys.ROUTING_COST_REVERSE)
_FAMILIES: Final = (*_COSTS, keys.MAP_TRANSFORM)
_DEVIATIONS: Final = (keys.VDA5050_DEVIATION_XY, keys.VDA5050_DEVIATION_THETA)
_DIRECTIONS: Final = ("forward", "reverse")
_HEEDED: Final = MappingProxyType(
    {
        ObjectKind.POINT: (keys.PARKING_POSITION_PRIORITY, keys.VDA5050_MAP_ID, *_DEVIATIONS),
        ObjectKind.PATH: (
            *_COSTS,
            keys.BLOCK_ENTRY_DIRECTION,
            driver.ACTION_TAGS,
            *(driver.ORIENTATION + direction for direction in _DIRECTIONS),
            *(driver.ROTATION_ALLOWED + direction for direction in _DIRECTIONS),
        ),
        ObjectKind.VEHICLE: (
            *_DEVIATIONS,
            keys.PREFERRED_PARKING_POSITION,
            keys.ASSIGNED_PARKING_POSITION,
            keys.PREFERRED_RECHARGE_LOCATION,
            keys.ASSIGNED_RECHARGE_LOCATION,
            keys.ROUTING_GROUP,
            keys.VDA5050_INTERFACE_NAME,
            keys.VDA5050_MANUFACTURER,
            keys.VDA5050_SERIAL_NUMBER,
            keys.VDA5050_VERSION,
            keys.VDA5050_MAP_ID,
            keys.VDA5050_CORRIDOR_WIDTH,
            keys.VDA5050_RECHARGE_OPERATION,
            keys.VDA5050_PARAMETERS_AS_TEXT,
            keys.VDA5050_INSTANT_ACTIONS_KEY,
            keys.VDA5050_KEEPS_LAST_NODE_STATES,
            keys.VEHICLE_TYPE,
            keys.ALLOWED_MAPS,
            keys.ACCEPTABLE_ORDER_TYPES,
            driver.ACTION_TAGS,
            driver.TOPIC_PREFIX,
            driver.MAX_STEPS_BASE,
            driver.MAX_DISTANCE_BASE,
            driver.LENGTH_LOADED,
            driver.LENGTH_UNLOADED,
        ),
    }
)
"""Properties that NeNa acts on, by kind of object, beside :data:`driver.FAMILIES`."""
_KNOWN: Final = frozenset(chain.from_iterable(_HEEDED.values()))
_FOLDED: Final = MappingProxyType({key.casefold(): key for key in _KNOWN})
_SIMILARITY: Final = 0.9
_SEGMENTS: Final = MappingProxyType({part.casefold(): part for part in driver.SEGMENTS})
_SIMILAR_SEGMENT: Final = 0.8
_OF_OTHER_SOFTWARE: Final = re.compile(
    r"tcs:(default\w+Symbol|preferredAdapterClass|modelFileLastModified|loopbackPeripheral)"
    r"|vda5050:(errors|information|paused)\b.*"
)
"""What openTCS's editor and kernel write for themselves: drawing, adapters, and states of vehicles."""
_MAY_BE_EMPTY: Final = (driver.ACTION_TAGS, driver.ACTION, driver.DESTINATION_ACTION)

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


def find_property_warnings(model: PlantModel) -> Iterator[PlantProblem]:
    """Yield suspicious properties of all objects, and missing recharge operations."""
    unheeded: defaultdict[tuple[ObjectKind, str], list[str]] = defaultdict(list)
    for kind, name, properties in _all_properties(model):
        for key, value in properties.items():
            if not _is_heeded(kind, key):
                unheeded[kind, key].append(name)
                continue
            for code, text in _check_property(model, key, value):
                yield PlantProblem(code, kind, name, text)
            if vain := _vain_reference(model, kind, name, key, properties):
                text = f"property {key!r} refers to {vain}"
                yield PlantProblem("PROPERTY_NAMES_NOTHING", kind, name, text)
    for (kind, key), names in unheeded.items():
        count = f"(found {len(names)} times)"
        if meant := _intended_key(kind, key):
            text = f"unknown property {key!r} {count}; did you mean {meant!r}?"
            yield PlantProblem("MISSPELT_PROPERTY", kind, names[0], text)
        elif key.startswith(_PREFIXES[:2]):
            text = f"property {key!r} {count}: kept, without effect"
            yield PlantProblem("NOT_HEEDED", kind, names[0], text)
    yield from _recharge_warnings(model)


def _recharge_warnings(model: PlantModel) -> Iterator[PlantProblem]:
    types = {location.type for location in model.locations}
    operations = {
        operation
        for kind in model.location_types
        if kind.name in types
        for operation in kind.allowed_operations
    }
    for wanted, name in {
        vehicle.properties.get(keys.VDA5050_RECHARGE_OPERATION, ""): vehicle.name
        for vehicle in reversed(model.vehicles)
    }.items():
        charge = action_of(RECHARGE_OPERATION)
        if wanted in operations or (not wanted and charge in map(action_of, operations)):
            continue
        # openTCS's operations are free texts, and names in other letters are often meant to recharge
        meant = (wanted or RECHARGE_OPERATION).casefold()
        similar = sorted(each for each in operations if each.casefold() == meant)
        hint = f" ({similar[0]!r} is a different operation: names are case-sensitive)" if similar else ""
        if wanted:
            text = f"no location allows its {keys.VDA5050_RECHARGE_OPERATION} {wanted!r}, so it is never"
            yield PlantProblem("NO_RECHARGE_OPERATION", ObjectKind.VEHICLE, name, f"{text} recharged{hint}")
        else:
            text = f"no location allows {RECHARGE_OPERATION!r}, so vehicles are never recharged{hint}"
            yield PlantProblem("NO_RECHARGE_OPERATION", ObjectKind.MODEL, model.name, text)


def _all_properties(model: PlantModel) -> Iterator[tuple[ObjectKind, str, Mapping[str, str]]]:
    yield ObjectKind.MODEL, model.name, model.properties
    yield from ((ObjectKind.POINT, point.name, point.properties) for point in model.points)
    yield from ((ObjectKind.PATH, path.name, path.properties) for path in model.paths)
    yield from ((ObjectKind.LOCATION_TYPE, kind.name, kind.properties) for kind in model.location_types)
    yield from ((ObjectKind.LOCATION, location.name, location.properties) for location in model.locations)
    yield from ((ObjectKind.BLOCK, block.name, block.properties) for block in model.blocks)
    yield from ((ObjectKind.VEHICLE, vehicle.name, vehicle.properties) for vehicle in model.vehicles)


def _is_heeded(kind: ObjectKind, key: str) -> bool:
    """Return whether NeNa acts on a property, or it belongs to other software."""
    # openTCS: properties are free, and other programs have their own
    if not key.strip().casefold().startswith(_PREFIXES):
        return _with_colon(kind, key) is None
    if key in _HEEDED.get(kind, ()) or _OF_OTHER_SOFTWARE.fullmatch(key):
        return True
    if key.startswith(_FAMILIES):
        return kind is (ObjectKind.MODEL if key.startswith(keys.MAP_TRANSFORM) else ObjectKind.PATH)
    if key.startswith(driver.OPTIONAL_PARAMETERS):
        field = key.removeprefix(driver.OPTIONAL_PARAMETERS)
        return kind is ObjectKind.VEHICLE and field in driver.OPTIONAL_FIELDS
    return kind in driver.FAMILIES and bool(driver.FAMILIES[kind].fullmatch(key))


def _vain_reference(
    model: PlantModel, kind: ObjectKind, name: str, key: str, properties: Mapping[str, str]
) -> str | None:
    if kind is ObjectKind.VEHICLE or not key.startswith((driver.ACTION, driver.DESTINATION_ACTION)):
        return None
    type_name = model.locations_by_name[name].type if kind is ObjectKind.LOCATION else name
    own_type = model.location_types_by_name.get(type_name)
    return driver.names_nothing(key, properties, own_type.allowed_operations if own_type else ())


def _check_property(model: PlantModel, key: str, value: str) -> Iterator[tuple[str, str]]:
    if not value.strip():
        if not key.startswith(_MAY_BE_EMPTY):
            yield "EMPTY_PROPERTY", f"property {key!r} has no value"
    elif (key in _NUMBERS or key.startswith(_COSTS)) and not _is_number(value):
        yield "PROPERTY_NOT_A_NUMBER", f"property {key!r} is {value!r}; it must be a number of at least 0"
    elif wanted := driver.find_fault(key, value):
        yield "PROPERTY_UNREADABLE", f"property {key!r} is {value!r}; it must be {wanted}: it has no effect"
    elif key == keys.VEHICLE_TYPE and not model.vehicle_types:
        return  # a type that no point or path names may use them all, as in models without LIF
    elif key in _REFERENCES and value not in _REFERENCES[key](model):
        yield "PROPERTY_NAMES_NOTHING", f"property {key!r} refers to unknown {value!r}"


def _with_colon(kind: ObjectKind, key: str) -> str | None:
    """Return the known key that a key with another sign stands for."""
    if sign := _OTHER_SIGN.match(key):
        meant = f"{sign[1].lower()}:{key[sign.end() :]}"
        meant = _FOLDED.get(meant.casefold(), meant)
        return meant if _is_heeded(kind, meant) else None
    return None


def _intended_key(kind: ObjectKind, key: str) -> str | None:
    """Return the key that was probably intended; None: unknown, or one of other objects."""
    if meant := _with_colon(kind, key):
        return meant
    if key != key.strip():
        return key.strip()
    if key in _KNOWN or key.startswith(_FAMILIES):
        return None
    if similar := get_close_matches(key.casefold(), _FOLDED, n=1, cutoff=_SIMILARITY):
        return _FOLDED[similar[0]]
    close = (
        get_close_matches(part.casefold(), _SEGMENTS, n=1, cutoff=_SIMILAR_SEGMENT) for part in key.split(".")
    )
    meant = ".".join(
        _SEGMENTS[found[0]] if found else part for found, part in zip(close, key.split("."), strict=True)
    )
    return meant if meant != key and _is_heeded(kind, meant) else None


def _is_number(value: str) -> bool:
    """Return whether this is a number of at least 0, or `Infinity`: a cost that excludes a path."""
    try:
        number = float(value)
    except ValueError:
        return False
    return not isnan(number) and number >= 0


_NAMES_SHOWN = 10


def _all_names(model: PlantModel) -> Iterator[tuple[ObjectKind, str]]:
    yield from ((ObjectKind.POINT, point.name) for point in model.points)
    yield from ((ObjectKind.PATH, path.name) for path in model.paths)
    yield from ((ObjectKind.LOCATION_TYPE, location_type.name) for location_type in model.location_types)
    yield from ((ObjectKind.LOCATION, location.name) for location in model.locations)
    yield from ((ObjectKind.BLOCK, block.name) for block in model.blocks)
    yield from ((ObjectKind.VEHICLE, vehicle.name) for vehicle in model.vehicles)


def _name_errors(model: PlantModel) -> Iterator[PlantProblem]:
    # openTCS, too, keeps all kinds of objects under one set of names
    times = Counter(name for _, name in _all_names(model))
    for kind, name in dict.fromkeys(_all_names(model)):
        if times[name] > 1:
            text = f"{times[name]} objects have this name; rename all but one, even if their kinds differ"
            yield PlantProblem("DUPLICATE_NAME", kind, name, text)
    for path in model.paths:
        if path.max_reverse_velocity_mm_s and path.name + BACKWARD_SUFFIX in times:
            text = f"rename {path.name + BACKWARD_SUFFIX!r}: the path's backward edge needs this name"
            yield PlantProblem("DUPLICATE_NAME", ObjectKind.PATH, path.name, text)


def _reference_errors(model: PlantModel) -> Iterator[PlantProblem]:
    for path in model.paths:
        for end in (path.source, path.destination):
            if end not in model.points_by_name:
                yield _dangling_reference(ObjectKind.PATH, path.name, ObjectKind.POINT, end)
        for operation in path.peripheral_operations:
            if operation.location not in model.locations_by_name:
                yield _dangling_reference(ObjectKind.PATH, path.name, ObjectKind.LOCATION, operation.location)
    for location in model.locations:
        if location.type not in model.location_types_by_name:
            yield _dangling_reference(
                ObjectKind.LOCATION, location.name, ObjectKind.LOCATION_TYPE, location.type
            )
        for link in location.links:
            if link.point not in model.points_by_name:
                yield _dangling_reference(ObjectKind.LOCATION, location.name, ObjectKind.POINT, link.point)


def _member_errors(model: PlantModel) -> Iterator[PlantProblem]:
    resources = {*model.points_by_name, *model.paths_by_name, *model.locations_by_name}
    for block in model.blocks:
        for member in block.members:
            if member not in resources:
                text = f"member {member!r} is not a point, path or location"
                yield PlantProblem("UNKNOWN_REFERENCE", ObjectKind.BLOCK, block.name, text)


def _transform_errors(model: PlantModel) -> Iterator[PlantProblem]:
    """Yield invalid map transforms: robots would drive to wrong positions."""
    for map_id, text in transform_texts(model):
        try:
            parse_transform(text)
        except ValueError as error:
            problem = f"invalid transform to map {map_id!r}: {error}"
            yield PlantProblem("BAD_VALUE", ObjectKind.MODEL, model.name, problem)


def _dangling_reference(kind: ObjectKind, name: str, wanted: ObjectKind, reference: str) -> PlantProblem:
    return PlantProblem("UNKNOWN_REFERENCE", kind, name, f"refers to unknown {wanted} {reference!r}")


def _name_warnings(model: PlantModel) -> Iterator[PlantProblem]:
    for kind, name in _all_names(model):
        if name != name.strip() or not name.isprintable():
            # unchanged, as it becomes the nodeId or edgeId by which robots may know the place
            text = "the name has leading or trailing spaces or invisible characters; it is kept unchanged"
            yield PlantProblem("SUSPICIOUS_NAME", kind, name, text)
        if len(name) > LONGEST_NAME:
            text = f"the name has {len(name)} characters; requests can name objects of up to {LONGEST_NAME}"
            yield PlantProblem("LONG_NAME", kind, name, text)
    for vehicle in model.vehicles:
        said = {"manufacturer": vehicle.manufacturer, "serial number": vehicle.serial_number}
        odd = [f"{what} {text!r}" for what, text in said.items() if text and not suits_all_brokers([text])]
        if odd:
            text = f"{' and '.join(odd)} must be exactly the robot's, and some brokers refuse or change it"
            yield PlantProblem("SUSPICIOUS_NAME", ObjectKind.VEHICLE, vehicle.name, text)


_SHORT_MM: Final = 100
_LONG_MM: Final = 2_000_000
"""A plant without a path between these lengths is probably in another unit."""


def _track_warnings(model: PlantModel) -> Iterator[PlantProblem]:
    used = {end for path in model.paths for end in (path.source, path.destination)}
    for point in model.points:
        if point.name not in used:
            yield PlantProblem(
                "POINT_WITHOUT_PATH", ObjectKind.POINT, point.name, "no path starts or ends here"
            )
    for path in model.paths:
        if path.locked:
            yield PlantProblem(
                "PATH_LOCKED", ObjectKind.PATH, path.name, "locked, so no vehicle is routed over it"
            )
        if not any(path.edges()):
            text = "both maximum speeds are 0, so no vehicle can use it"
            yield PlantProblem("PATH_NOT_DRIVABLE", ObjectKind.PATH, path.name, text)
    longest = max((path.length_mm for path in model.paths), default=_SHORT_MM)
    if not _SHORT_MM <= longest <= _LONG_MM:
        text = f"the longest path has {longest} mm: check the unit of lengths (openTCS: mm, LIF: m)"
        yield PlantProblem("IMPLAUSIBLE_LENGTHS", ObjectKind.MODEL, model.name, text)
    if not any(point.type is PointType.PARK_POSITION for point in model.points):
        text = "no parking position (PARK_POSITION), so idle vehicles stay where they are"
        yield PlantProblem("NO_PARK_POSITION", ObjectKind.MODEL, model.name, text)
    if cut_off := disconnected_points(model):
        names = ", ".join(map(repr, cut_off[:_NAMES_SHOWN])) + (" ..." if len(cut_off) > _NAMES_SHOWN else "")
        text = f"not every point is reachable from every other; disconnected: {names}"
        yield PlantProblem("NOT_STRONGLY_CONNECTED", ObjectKind.MODEL, model.name, text)


def _location_warnings(model: PlantModel) -> Iterator[PlantProblem]:
    for location in model.locations:
        kind, name, its_type = ObjectKind.LOCATION, location.name, model.location_type(location.type)
        if not location.links and (its_type.allowed_operations or not its_type.allowed_peripheral_operations):
            text = "no link, so no vehicle can be sent there"
            yield PlantProblem("LOCATION_WITHOUT_LINK", kind, name, text)
        if location.locked:
            yield PlantProblem("LOCATION_LOCKED", kind, name, "locked, so orders to it are refused")
        allowed = its_type.allowed_operations
        for link in location.links:
            if unknown := set(link.allowed_operations) - {*allowed, NO_OPERATION}:
                text = f"the link to {link.point!r} allows {sorted(unknown)}, but the location type does not"
                yield PlantProblem("OPERATION_NOT_OF_TYPE", kind, name, text)
        if len({link.point for link in location.links}) < len(location.links):
            yield PlantProblem("DUPLICATE_LINK", kind, name, "two links to the same point")
