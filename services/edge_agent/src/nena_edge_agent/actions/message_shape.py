"""What the fields of a ROS message take: checked when the program starts, and once more when they are sent.

ROS itself takes any object into a field and may send its memory as garbage; so values become exactly what
their field takes here, or are refused with the path of the field.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from pydantic import JsonValue

from nena_edge_agent.actions.template import whole
from nena_shared.vda5050.factsheet import ValueDataType


class FieldError(Exception):
    """A value does not fit the field of a message; the text names both."""


class ScalarKind(StrEnum):
    """What a single value is."""

    TRUTH = "true or false"
    INTEGER = "an integer"
    NUMBER = "a number"
    TEXT = "a text"


@dataclass(frozen=True, slots=True)
class Scalar:
    """One value; ``low`` and ``high`` of an integer, ``longest`` of a text, None: no limit.

    ``octet``: an integer that ROS wants as a byte.
    """

    kind: ScalarKind
    low: int = 0
    high: int = 0
    longest: int | None = None
    octet: bool = False


@dataclass(frozen=True, slots=True)
class Listing:
    """Many values of one shape; ``exactly`` so many, or ``most``, None: no limit."""

    item: Shape
    exactly: int | None = None
    most: int | None = None

    def holds(self, count: int) -> bool:
        """Tell whether there may be so many values."""
        return self.exactly in (None, count) and (self.most is None or count <= self.most)

    @property
    def words(self) -> str:
        """What it is, for people."""
        if self.exactly is not None:
            return f"an array of {self.exactly} values"
        return "an array" if self.most is None else f"an array of {self.most} values at most"


@dataclass(frozen=True, slots=True)
class Record:
    """A message: its fields by name. ``make`` gives an empty one."""

    type_name: str
    fields: Mapping[str, Shape]
    make: Callable[[], Any]


Shape = Scalar | Listing | Record

_FITTING: Final[Mapping[ScalarKind, frozenset[ValueDataType]]] = {
    ScalarKind.TRUTH: frozenset({ValueDataType.BOOL}),
    ScalarKind.INTEGER: frozenset({ValueDataType.INTEGER}),
    ScalarKind.NUMBER: frozenset({ValueDataType.INTEGER, ValueDataType.NUMBER}),
    ScalarKind.TEXT: frozenset({ValueDataType.STRING}),
}
"""Which types of parameters may be put whole into which values."""


def problems(
    template: JsonValue, shape: Shape, types: Mapping[str, ValueDataType], path: str
) -> Iterator[str]:
    """Say what cannot be, whatever the values of the parameters, whose ``types`` are given by name."""
    match template, shape:
        case str(), Scalar() if name := whole(template):
            if types.get(name) not in _FITTING[shape.kind] and name in types:
                yield f"{path}: takes {shape.kind.value}, and the parameter '{name}' is of type {types[name]}"
        case str(), Scalar(kind=ScalarKind.TEXT):
            return
        case dict(), Record():
            for key, value in template.items():
                yield from _field_problems(key, value, shape, types, path)
        case list(), Listing():
            yield from _item_problems(template, shape, types, path)
        case str(), Listing() if whole(template):
            return  # an array as a whole; its items are looked at when it is there
        case _:
            try:
                conformed(template, shape, path)
            except FieldError as error:
                yield str(error)


def conformed(value: JsonValue, shape: Shape, path: str) -> Any:  # noqa: ANN401 - a value of any field
    """Make ``value`` what a field takes.

    Raises:
        FieldError: it is something else.

    """
    match shape:
        case Scalar():
            return _scalar(value, shape, path)
        case Listing():
            return _listing(value, shape, path)
        case Record():
            return _record(value, shape, path)


def message(values: Mapping[str, Any], record: Record) -> Any:  # noqa: ANN401 - rclpy carries no types
    """Make a message of what :func:`conformed` has given."""
    made = record.make()
    for name, value in values.items():
        setattr(made, name, _sent(value, record.fields[name]))
    return made


def _sent(value: Any, shape: Shape) -> Any:  # noqa: ANN401
    match shape:
        case Record():
            return message(value, shape)
        case Listing():
            return [_sent(each, shape.item) for each in value]
        case Scalar(octet=True):
            return bytes((value,))
        case _:
            return value


def _field_problems(
    key: str, value: JsonValue, record: Record, types: Mapping[str, ValueDataType], path: str
) -> Iterator[str]:
    shape = record.fields.get(key)
    if shape is None:
        yield f"{path}.{key}: {record.type_name} has no such field, only {_listed(record)}"
    else:
        yield from problems(value, shape, types, f"{path}.{key}")


def _item_problems(
    items: list[JsonValue], listing: Listing, types: Mapping[str, ValueDataType], path: str
) -> Iterator[str]:
    if not listing.holds(len(items)):
        yield f"{path}: {items!r} is not {listing.words}"
    for number, value in enumerate(items):
        yield from problems(value, listing.item, types, f"{path}.{number}")


def _scalar(value: JsonValue, scalar: Scalar, path: str) -> Any:  # noqa: ANN401
    match scalar.kind, value:
        case ScalarKind.TRUTH, bool():
            return value
        case ((ScalarKind.INTEGER | ScalarKind.NUMBER), bool()):
            pass
        case ScalarKind.INTEGER, int() if scalar.low <= value <= scalar.high:
            return value
        case ScalarKind.NUMBER, int() | float() if math.isfinite(value):
            return float(value)
        case ScalarKind.TEXT, str() if scalar.longest is None or len(value) <= scalar.longest:
            return value
    text = f"{path}: {value!r} is not {scalar.kind.value}{_limits(scalar)}"
    raise FieldError(text)


def _limits(scalar: Scalar) -> str:
    if scalar.kind is ScalarKind.INTEGER:
        return f" from {scalar.low} to {scalar.high}"
    return "" if scalar.longest is None else f" of {scalar.longest} characters at most"


def _listing(value: JsonValue, listing: Listing, path: str) -> list[Any]:
    if not isinstance(value, list) or not listing.holds(len(value)):
        text = f"{path}: {value!r} is not {listing.words}"
        raise FieldError(text)
    return [conformed(each, listing.item, f"{path}.{number}") for number, each in enumerate(value)]


def _record(value: JsonValue, record: Record, path: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        text = f"{path}: {value!r} is not a table of the fields {_listed(record)}"
        raise FieldError(text)
    if unknown := next((key for key in value if key not in record.fields), None):
        text = f"{path}.{unknown}: {record.type_name} has no such field, only {_listed(record)}"
        raise FieldError(text)
    return {key: conformed(each, record.fields[key], f"{path}.{key}") for key, each in value.items()}


def _listed(record: Record) -> str:
    return ", ".join(record.fields) or "none"
