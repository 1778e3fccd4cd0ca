"""What a LIF file has wrong in its form, and how a lenient reader puts it right."""

from collections import Counter
from collections.abc import Iterator
from math import pi, radians
from typing import Any, Final

from pydantic import ValidationError

from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.lif.document import (
    Edge,
    Layout,
    LifFile,
    MetaInformation,
    Node,
    Station,
    StationPosition,
)
from nena_shared.plant.record import PlantRecord
from nena_shared.plant.vehicle_type import (
    ActionParameter,
    LoadRestriction,
    Trajectory,
    TrajectoryPoint,
    TypeAction,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)

_RECORDS: Final[tuple[type[PlantRecord], ...]] = (
    LifFile,
    MetaInformation,
    Layout,
    Node,
    Edge,
    Station,
    StationPosition,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
    TypeAction,
    ActionParameter,
    LoadRestriction,
    Trajectory,
    TrajectoryPoint,
)
_KNOWN: Final = frozenset(field.alias for record in _RECORDS for field in record.model_fields.values())
_HEADINGS: Final = ("theta", "vehicleOrientation")


def faults(error: ValidationError) -> tuple[Problem, ...]:
    """Return what does not keep to the format; thousands of equal faults make one problem."""
    found: dict[tuple[str, str], list[str]] = {}
    for detail in error.errors(include_url=False, include_context=False, include_input=False):
        field = ".".join("*" if isinstance(part, int) else part for part in detail["loc"])
        found.setdefault((field, detail["msg"]), []).append(".".join(map(str, detail["loc"])))
    return tuple(
        warning("NOT_LIF", f"{field}: {message} (found {len(places)} times, first at {places[0]})")
        for (field, message), places in found.items()
    )


def put_right(raw: Any) -> tuple[Problem, ...]:  # noqa: ANN401 - whatever the JSON holds
    """Put known faults of the content right in place, and return those that validation would not show.

    Missing stations count as none; `required` of an action becomes its requirementType; where any heading is
    beyond 2 pi, all are taken for degrees.
    """
    objects = tuple(_objects(raw))
    odd: Counter[str] = Counter()
    in_degrees = any(abs(_heading(each, key)) > 2 * pi for each in objects for key in _HEADINGS)
    for each in objects:
        if "nodes" in each and "edges" in each:
            each.setdefault("stations", [])
        if isinstance(each.get("required"), bool):
            each.setdefault("requirementType", "REQUIRED" if each["required"] else "OPTIONAL")
        if in_degrees:
            each.update({key: radians(_heading(each, key)) for key in _HEADINGS if each.get(key) is not None})
        odd.update(key for key in each if key not in _KNOWN)
    unknown = [
        warning("IGNORED", f"field {key!r} is not known (found {odd[key]} times)") for key in sorted(odd)
    ]
    if in_degrees:
        unknown.append(
            warning("HEADINGS_IN_DEGREES", "there are headings beyond 2 pi; all are read as degrees")
        )
    return tuple(unknown)


def warning(code: str, text: str) -> Problem:
    """Return a problem of the file as a whole."""
    return Problem(code, ObjectKind.MODEL, "", text)


def _objects(raw: Any) -> Iterator[dict[str, Any]]:  # noqa: ANN401 - whatever the JSON holds
    waiting = [raw]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            yield value
            waiting.extend(value.values())
        elif isinstance(value, list):
            waiting.extend(value)


def _heading(each: dict[str, Any], key: str) -> float:
    """Return a heading, also one written as a text; 0 where there is none."""
    try:
        return float(each.get(key) or 0)
    except (OverflowError, TypeError, ValueError):
        return 0.0
