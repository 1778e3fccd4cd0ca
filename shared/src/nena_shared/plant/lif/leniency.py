"""What a LIF file has wrong in its form, and how a lenient reader puts it right."""

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from math import pi, radians
from typing import Any, Final

from pydantic import ValidationError

from nena_shared.misfits import path_of, words_of
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
        found.setdefault((field, words_of(detail)), []).append(path_of(detail["loc"]))
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
    found = Counter(_put_each_right(objects))
    headings = [(each, key, heading) for each in objects for key, heading in _headings(each)]
    if any(abs(heading) > 2 * pi for _, _, heading in headings):
        found["HEADINGS_IN_DEGREES", "headings beyond 2 pi: all of the file are read as degrees"] = 1
        for each, key, heading in headings:
            each[key] = radians(heading)
    return tuple(
        warning(code, f"{text} (found {times} times)") for (code, text), times in sorted(found.items())
    )


def _put_each_right(objects: Iterable[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    """Put right what is not of this format, and yield the code and text of each fault."""
    for each in objects:
        if "nodes" in each and "edges" in each:
            each.setdefault("stations", [])
        if isinstance(required := each.get("required"), bool):
            del each["required"]
            each.setdefault("requirementType", "REQUIRED" if required else "OPTIONAL")
            yield "NOT_LIF", "'required' of actions is read as their requirementType"
        for key in each.keys() - _KNOWN:
            yield "IGNORED", f"field {key!r} is not known"


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


def _headings(each: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield the headings of an object, also those written as texts, and leave what is no number as it is."""
    for key in _HEADINGS:
        with suppress(KeyError, OverflowError, TypeError, ValueError):
            yield key, float(each[key])
