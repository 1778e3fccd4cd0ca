"""Read the properties of openTCS's driver for VDA 5050: actions, headings and limits (its documentation)."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import StrEnum
from math import isfinite, radians
from types import MappingProxyType
from typing import Final

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.geometry import normalized
from nena_shared.plant.track import (
    DirectedEdge,
    PlantBlockingType,
    RequirementType,
    TypeAction,
    TypeActionParameter,
)

DRIVER_PREFIX: Final = "vda5050:"
ACTION: Final = "vda5050:action."
"""Point, path, location: followed by an index. Vehicle: by an action type and `.blockingType`."""
ACTION_TAGS: Final = "vda5050:actionTags"
DESTINATION_ACTION: Final = "vda5050:destinationAction."
"""Location type, location: followed by an operation. Destination of an order: without one."""
ORIENTATION: Final = "vda5050:orientation."
ROTATION_ALLOWED: Final = "vda5050:rotationAllowed."
OPTIONAL_PARAMETERS: Final = "vda5050:optionalParams.order."
TOPIC_PREFIX: Final = "vda5050:topicPrefix"
MAX_STEPS_BASE: Final = "vda5050:maxStepsBase"
MAX_DISTANCE_BASE: Final = "vda5050:maxDistanceBase"
LENGTH_LOADED: Final = "vda5050:vehicleLengthLoaded"
LENGTH_UNLOADED: Final = "vda5050:vehicleLengthUnloaded"

OPTIONAL_FIELDS: Final = frozenset(
    {
        "zoneSetId",
        "nodes.nodeDescription",
        "nodes.nodePosition",
        "nodes.nodePosition.theta",
        "nodes.nodePosition.allowedDeviationXY",
        "nodes.nodePosition.allowedDeviationTheta",
        "nodes.nodePosition.mapDescription",
        "nodes.actions.actionDescription",
        "nodes.actions.actionParameters",
        "edges.edgeDescription",
        "edges.maxSpeed",
        "edges.maxHeight",
        "edges.minHeight",
        "edges.orientation",
        "edges.orientationType",
        "edges.direction",
        "edges.rotationAllowed",
        "edges.maxRotationSpeed",
        "edges.length",
        "edges.trajectory",
        "edges.trajectory.degree",
        "edges.trajectory.controlPoints.weight",
    }
)
"""Fields of orders that :data:`OPTIONAL_PARAMETERS` may name, by their names in VDA 5050 2.x."""

_PARAMETER: Final = "parameter."


class ActionTrigger(StrEnum):
    """Where on its way a vehicle executes an action of a point."""

    PASSING = "PASSING"
    ORDER_START = "ORDER_START"
    ORDER_END = "ORDER_END"


def find_actions(
    properties: Mapping[str, str], trigger: ActionTrigger | None = None, tags: Iterable[str | None] = ()
) -> Iterator[TypeAction]:
    """Yield the actions of a point, path, location or destination, ordered by index.

    ``trigger`` None: all. ``tags`` are the values of `vda5050:actionTags` that an action has to pass.
    """
    if not any(key.startswith(ACTION) for key in properties):
        return
    allowed = [_split(text) for text in tags if text is not None]
    for key in sorted(properties):
        prefix, own = f"{key}.", properties
        if not key.startswith(ACTION) or "." in key.removeprefix(ACTION) or not properties[key].strip():
            continue
        own_tags = _split(own.get(f"{prefix}tags", "default"))
        if (
            trigger is None or trigger in _split(own.get(f"{prefix}when", "|".join(ActionTrigger)).upper())
        ) and any(all({"*", tag} & passing for passing in allowed) for tag in own_tags):
            yield _action(own[key], prefix, own)


def find_destination_action(operation: str, *sources: Mapping[str, str]) -> TypeAction | None:
    """Return the action of an operation; None if no property defines it.

    Of ``sources`` (location type, location, destination), later ones take precedence.
    """
    prefix = f"{DESTINATION_ACTION}{operation}."
    found: dict[str, str] = {}
    for properties in sources:
        found |= {
            key: value
            for key, value in properties.items()
            if key.startswith(prefix) and (key != f"{prefix}blockingType" or read_blocking_type(value))
        }
    return _action(operation, prefix, found) if found else None


def read_blocking_types(properties: Mapping[str, str]) -> dict[str, PlantBlockingType]:
    """Return the blocking types that a vehicle's properties set, by action type."""
    return {
        key.removeprefix(ACTION).removesuffix(".blockingType"): blocking
        for key, value in properties.items()
        if key.startswith(ACTION)
        and key.endswith(".blockingType")
        and (blocking := read_blocking_type(value))
    }


def read_blocking_type(text: str) -> PlantBlockingType | None:
    """Return a blocking type; None if unknown."""
    return next((each for each in PlantBlockingType if each == text.strip().upper()), None)


def read_parameter(text: str) -> str | float | bool | None:
    """Return an action parameter's value, whose prefix names its type; None if it is not of that type."""
    kind, colon, rest = text.partition(":")
    if not colon or kind not in _TYPES:
        return text
    try:
        return _TYPES[kind](rest)
    except (KeyError, ValueError):
        return None


def _finite(text: str) -> float:
    if not isfinite(value := float(text)):
        raise ValueError(text)
    return value


_BOOLEANS: Final = MappingProxyType({"true": True, "false": False})
_TYPES: Final[Mapping[str, Callable[[str], str | float | bool]]] = MappingProxyType(
    {"float": _finite, "integer": int, "boolean": lambda text: _BOOLEANS[text.lower()], "string": str}
)


def _action(action_type: str, prefix: str, properties: Mapping[str, str]) -> TypeAction:
    values = {
        key.removeprefix(prefix).removeprefix(_PARAMETER): read_parameter(text)
        for key, text in properties.items()
        if key.startswith(prefix + _PARAMETER)
    }
    return TypeAction(
        action_type=action_type,
        blocking_type=read_blocking_type(properties.get(f"{prefix}blockingType", ""))
        or PlantBlockingType.NONE,
        requirement_type=RequirementType.REQUIRED,
        action_parameters=tuple(
            TypeActionParameter(key=key, value=value)
            if isinstance(value, str)
            else TypeActionParameter(key=key, value=repr(value).lower(), is_json=True)
            for key, value in values.items()
            if value is not None
        ),
    )


def _split(text: str) -> frozenset[str]:
    return frozenset(part.strip() for part in text.split("|"))


def find_edge_fields(edge: DirectedEdge) -> dict[str, object]:
    """Return orientation, rad, and rotation of an edge in VDA 5050 3.0; empty if no property sets them."""
    direction = "forward" if edge.is_forward else "reverse"
    fields: dict[str, object] = {}
    degrees = read_number(edge.path.properties.get(ORIENTATION + direction, ""))
    if degrees is not None:
        # the driver sends no orientationType: for robots it is TANGENTIAL (7.3), so no map's frame applies
        fields |= {"orientation": normalized(radians(degrees)), "orientation_type": None}
    rotation = _BOOLEANS.get(edge.path.properties.get(ROTATION_ALLOWED + direction, "").lower())
    if rotation is not None:
        fields["reach_orientation_before_entering"] = not rotation
    return fields


def read_number(text: str) -> float | None:
    """Return a finite number; None if the text is none."""
    try:
        return _finite(text)
    except ValueError:
        return None


def read_count(text: str) -> int | None:
    """Return a whole number of at least 1; None if the text is none."""
    return int(text) or None if text.isascii() and text.isdecimal() else None


_INDEXED = r"vda5050:action\.[^.]+"
_PARTS = rf"(\.(blockingType|when|tags|{_PARAMETER}.+))?"
_OF_DESTINATION = rf"{DESTINATION_ACTION}.+\.(blockingType|{_PARAMETER}.+)"
FAMILIES: Final[Mapping[ObjectKind, re.Pattern[str]]] = MappingProxyType(
    {
        ObjectKind.POINT: re.compile(_INDEXED + _PARTS),
        ObjectKind.PATH: re.compile(_INDEXED + _PARTS),
        ObjectKind.LOCATION: re.compile(f"{_INDEXED}{_PARTS}|{_OF_DESTINATION}"),
        ObjectKind.LOCATION_TYPE: re.compile(_OF_DESTINATION),
        ObjectKind.VEHICLE: re.compile(rf"{ACTION}.+\.blockingType|{OPTIONAL_PARAMETERS}.+"),
    }
)
"""Patterns of the keys, by kind of object, that contain a name or an index."""
_PREFIXES: Final = (
    ACTION,
    DESTINATION_ACTION,
    ORIENTATION,
    ROTATION_ALLOWED,
    OPTIONAL_PARAMETERS,
    _PARAMETER,
)
SEGMENTS: Final = frozenset({"blockingType", "when", "tags", "forward", "reverse"}).union(
    *(key.split(".") for key in (*_PREFIXES, *OPTIONAL_FIELDS))
) - {""}
"""The words in keys between dots, beside names and indices."""


NOT_SUPPORTED: Final = "NOT_SUPPORTED"
_SUPPORT: Final = ("REQUIRED", "SUPPORTED", NOT_SUPPORTED)
_COUNTS: Final = (MAX_STEPS_BASE, MAX_DISTANCE_BASE, LENGTH_LOADED, LENGTH_UNLOADED)
_VALUES: Final[tuple[tuple[re.Pattern[str], Callable[[str], bool], str], ...]] = (
    (
        re.compile(rf"vda5050:(action|destinationAction)\..+\.{_PARAMETER}.+"),
        lambda text: read_parameter(text) is not None,
        "of the type before its colon",
    ),
    (
        re.compile(r"vda5050:(action|destinationAction)\..+\.blockingType"),
        lambda text: read_blocking_type(text) is not None,
        f"one of {', '.join(PlantBlockingType)}",
    ),
    (
        re.compile(r"vda5050:action\..+\.when"),
        lambda text: _split(text.upper()) <= set(ActionTrigger),
        f"one or several of {', '.join(ActionTrigger)}, separated by |",
    ),
    (
        re.compile(f"{ORIENTATION}.+"),
        lambda text: read_number(text) is not None,
        "a number (degrees)",
    ),
    (re.compile(f"{ROTATION_ALLOWED}.+"), lambda text: text.lower() in _BOOLEANS, "true or false"),
    (re.compile(f"{OPTIONAL_PARAMETERS}.+"), _SUPPORT.__contains__, f"one of {', '.join(_SUPPORT)}"),
    (
        re.compile("|".join(_COUNTS)),
        lambda text: read_count(text) is not None,
        "a whole number of at least 1",
    ),
)


def find_fault(key: str, text: str) -> str | None:
    """Return what a property's value must be if it is something else; None if it is readable."""
    rule = next((rule for rule in _VALUES if rule[0].fullmatch(key)), None)
    return rule[2] if rule and not rule[1](text) else None


def names_nothing(key: str, properties: Mapping[str, str], operations: Iterable[str]) -> str | None:
    """Return what a key refers to in vain: the action of its index, or one of the ``operations``."""
    if key.startswith(DESTINATION_ACTION):
        named = any(key.startswith(f"{DESTINATION_ACTION}{operation}.") for operation in operations)
        return None if named else "an operation that the location type does not allow"
    action = ACTION + key.removeprefix(ACTION).partition(".")[0]
    return f"the action {action!r}, which is not set" if action not in properties else None
