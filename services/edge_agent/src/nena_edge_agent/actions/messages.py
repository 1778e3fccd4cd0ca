"""ROS messages of configured actions: templates, shapes of message types, conversion and matching."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from importlib import import_module
from typing import Any, Final

from pydantic import JsonValue

from nena_edge_agent.nav2.session_control import prepare_environment
from nena_shared.vda5050.factsheet import ValueDataType

# 0020: templates only substitute, no formats or expressions, because the values come from a network.
_PART: Final = re.compile(r"\{\{|\}\}|\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)\}|(?P<lone>[{}])")
_WHOLE: Final = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*)\}")


def placeholder_name(text: str) -> str | None:
    """Return the parameter's name if ``text`` is one placeholder and nothing else, otherwise None."""
    match = _WHOLE.fullmatch(text)
    return match.group(1) if match else None


def template_problems(template: JsonValue, names: Collection[str], path: str) -> Iterator[str]:
    """Yield each problem of a template with its path; ``names`` are the known values."""
    match template:
        case str():
            for part in _PART.finditer(template):
                if part.group("lone"):
                    brace, name = part.group(), "{name}"
                    remedy = f"write {name} for a value, '{brace * 2}' for a brace"
                    yield f"{path}: a lone '{brace}' in '{template}'; {remedy}"
                elif (name := part.group("name")) and name not in names:
                    yield f"{path}: unknown parameter '{name}'; known: {', '.join(sorted(names))}"
        case dict():
            for key, value in template.items():
                yield from template_problems(value, names, f"{path}.{key}")
        case list():
            for number, value in enumerate(template):
                yield from template_problems(value, names, f"{path}.{number}")


def fill_template(template: JsonValue, values: Mapping[str, JsonValue]) -> JsonValue:
    """Insert ``values``; None removes a field, or is an empty string within a longer text."""
    match template:
        case str():
            name = placeholder_name(template)
            return (
                values.get(name) if name else _PART.sub(lambda found: _insert_value(found, values), template)
            )
        case dict():
            parts = {key: fill_template(value, values) for key, value in template.items()}
            return {key: value for key, value in parts.items() if value is not None}
        case list():
            items = (fill_template(item, values) for item in template)
            return [item for item in items if item is not None]
        case _:
            return template


def _insert_value(found: re.Match[str], values: Mapping[str, JsonValue]) -> str:
    name = found.group("name")
    if not name:
        return found.group()[0]
    value = values.get(name)
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else str(value)


class FieldError(Exception):
    """A value does not fit the field of a message; the message names both."""


class ScalarKind(StrEnum):
    """Kind of a single value; the values are words for error messages."""

    BOOLEAN = "true or false"
    INTEGER = "an integer"
    NUMBER = "a number"
    TEXT = "a string"


@dataclass(frozen=True, slots=True)
class Scalar:
    """One value; ``low`` and ``high`` limit an integer, ``longest`` the length of a string; None: no limit.

    ``octet``: an integer that ROS expects as a byte.
    """

    kind: ScalarKind
    low: int = 0
    high: int = 0
    longest: int | None = None
    octet: bool = False


@dataclass(frozen=True, slots=True)
class ArrayShape:
    """An array of values of one shape: ``exactly`` that many, or at ``most``; None: any number."""

    item: Shape
    exactly: int | None = None
    most: int | None = None

    def allows_count(self, count: int) -> bool:
        """Return whether ``count`` values are allowed."""
        return self.exactly in (None, count) and (self.most is None or count <= self.most)

    @property
    def words(self) -> str:
        """Return a description for error messages."""
        if self.exactly is not None:
            return f"an array of {self.exactly} values"
        return "an array" if self.most is None else f"an array of {self.most} values at most"


@dataclass(frozen=True, slots=True)
class Record:
    """A message: its fields by name. ``make`` returns an empty one."""

    type_name: str
    fields: Mapping[str, Shape]
    make: Callable[[], Any]


Shape = Scalar | ArrayShape | Record

_FITTING: Final[Mapping[ScalarKind, frozenset[ValueDataType]]] = {
    ScalarKind.BOOLEAN: frozenset({ValueDataType.BOOL}),
    ScalarKind.INTEGER: frozenset({ValueDataType.INTEGER}),
    ScalarKind.NUMBER: frozenset({ValueDataType.INTEGER, ValueDataType.NUMBER}),
    ScalarKind.TEXT: frozenset({ValueDataType.STRING}),
}
"""Types of parameters that can replace a whole value of each kind."""


def shape_problems(  # noqa: C901, PLR0912 - a case for each kind of field
    template: JsonValue, shape: Shape, types: Mapping[str, ValueDataType], path: str
) -> Iterator[str]:
    """Yield what can never fit, whatever the values of parameters; ``types`` are their types by name."""
    match template, shape:
        case str(), Scalar() if name := placeholder_name(template):
            if types.get(name) not in _FITTING[shape.kind] and name in types:
                kind = shape.kind.value
                yield f"{path}: must be {kind}, but the parameter '{name}' is of type {types[name]}"
        case str(), Scalar(kind=ScalarKind.TEXT):
            return
        case dict(), Record():
            for key, value in template.items():
                if field := shape.fields.get(key):
                    yield from shape_problems(value, field, types, f"{path}.{key}")
                else:
                    yield _no_such_field(key, shape, path)
        case list(), ArrayShape():
            if not shape.allows_count(len(template)):
                yield f"{path}: {template!r} is not {shape.words}"
            for number, item in enumerate(template):
                yield from shape_problems(item, shape.item, types, f"{path}.{number}")
        case str(), ArrayShape() if placeholder_name(template):
            return  # a whole array, whose items are checked when the value is known
        case _:
            try:
                conform_value(template, shape, path)
            except FieldError as error:
                yield str(error)


def conform_value(value: JsonValue, shape: Shape, path: str) -> Any:  # noqa: ANN401 - a value of any field
    """Convert ``value`` to the type of a field; raises FieldError if ``value`` does not fit."""
    match shape:
        case Scalar():
            return _read_scalar(value, shape, path)
        case ArrayShape():
            if not isinstance(value, list) or not shape.allows_count(len(value)):
                raise FieldError(f"{path}: {value!r} is not {shape.words}")
            return [conform_value(item, shape.item, f"{path}.{number}") for number, item in enumerate(value)]
        case Record():
            if not isinstance(value, dict):
                raise FieldError(f"{path}: {value!r} is not a table of the fields {_list_fields(shape)}")
            if unknown := next((key for key in value if key not in shape.fields), None):
                raise FieldError(_no_such_field(unknown, shape, path))
            return {
                key: conform_value(part, shape.fields[key], f"{path}.{key}") for key, part in value.items()
            }


def make_message(values: Mapping[str, Any], record: Record) -> Any:  # noqa: ANN401 - rclpy carries no types
    """Build a message from the result of :func:`conform_value`."""
    built = record.make()
    for name, value in values.items():
        setattr(built, name, _message_value(value, record.fields[name]))
    return built


def _message_value(value: Any, shape: Shape) -> Any:  # noqa: ANN401
    match shape:
        case Record():
            return make_message(value, shape)
        case ArrayShape():
            return [_message_value(item, shape.item) for item in value]
        # rosidl's Python type of a byte field is bytes of length 1.
        case Scalar(octet=True):
            return bytes((value,))
        case _:
            return value


def _read_scalar(value: JsonValue, scalar: Scalar, path: str) -> Any:  # noqa: ANN401
    match scalar.kind, value:
        case ScalarKind.BOOLEAN, bool():
            return value
        # Before the numbers: bool is a subclass of int.
        case ((ScalarKind.INTEGER | ScalarKind.NUMBER), bool()):
            pass
        case ScalarKind.INTEGER, int() if scalar.low <= value <= scalar.high:
            return value
        # Measured (rclpy 7.1.6): an int in a float field is sent as 5e-324 or the like, and NaN as it is;
        # Nav2's navigators check neither.
        case ScalarKind.NUMBER, int() | float() if math.isfinite(value):
            return float(value)
        case ScalarKind.TEXT, str() if scalar.longest is None or len(value) <= scalar.longest:
            return value
    limits = "" if scalar.longest is None else f" of {scalar.longest} characters at most"
    if scalar.kind is ScalarKind.INTEGER:
        limits = f" from {scalar.low} to {scalar.high}"
    raise FieldError(f"{path}: {value!r} is not {scalar.kind.value}{limits}")


def _no_such_field(key: str, record: Record, path: str) -> str:
    return f"{path}.{key}: {record.type_name} has no such field, only {_list_fields(record)}"


def _list_fields(record: Record) -> str:
    return ", ".join(record.fields) or "none"


_NAME: Final = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Z][A-Za-z0-9]*)")
_SEQUENCE: Final = re.compile(r"sequence<(?P<item>.+?)(?:, (?P<most>\d+))?>")
_ARRAY: Final = re.compile(r"(?P<item>.+)\[(?P<exactly>\d+)\]")
_TEXT: Final = re.compile(r"w?string(?:<=?(?P<longest>\d+)>?)?")
PADDING: Final = "structure_needs_at_least_one_member"
"""Field that some ROS distributions add to a message without fields."""


EXAMPLES: Final = {
    "msg": "std_msgs/msg/String",
    "srv": "std_srvs/srv/Trigger",
    "action": "nav2_msgs/action/Spin",
}


class UnknownTypeError(Exception):
    """The ROS type is not installed here; the message names it and what to do."""


@lru_cache(maxsize=200)
def message_type(name: str) -> Record:
    """Return the shape of a message type, such as ``geometry_msgs/msg/PoseStamped``.

    Raises:
        UnknownTypeError: it is not installed, or not the name of a message type.
    """
    return _record_of(_load_type(name, "msg"), name)


@lru_cache(maxsize=200)
def service_type(name: str) -> tuple[Record, Record]:
    """Return the shapes of the request and the response of a service type, such as ``std_srvs/srv/Trigger``.

    Raises:
        UnknownTypeError: it is not installed, or not the name of a service type.
    """
    kind = _load_type(name, "srv")
    return _record_of(kind.Request, f"{name} request"), _record_of(kind.Response, f"{name} response")


def action_type(name: str) -> tuple[Record, Any]:
    """Return the goal's shape of an action type, and the type.

    Raises:
        UnknownTypeError: it is not installed, or not the name of a type.
    """
    kind = _load_type(name, "action")
    return _record_of(kind.Goal, name), kind


def class_of(name: str) -> Any:  # noqa: ANN401 - rclpy carries no types
    """Return the class of a message or service type.

    Raises:
        UnknownTypeError: it is not installed, or not the name of a type.
    """
    return _load_type(name, "srv" if "/srv/" in name else "msg")


def read_fields(message: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return the fields of a received message as plain data."""
    return {name: _plain_value(getattr(message, name)) for name in message.get_fields_and_field_types()}


def _plain_value(value: Any) -> Any:  # noqa: ANN401
    if hasattr(value, "get_fields_and_field_types"):
        return read_fields(value)
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else list(value)
    if isinstance(value, str | bool | int | float):
        return value
    return (
        [_plain_value(item) for item in value.tolist()]
        if hasattr(value, "tolist")
        else [*map(_plain_value, value)]
    )


def _load_type(name: str, kind: str) -> Any:  # noqa: ANN401
    match = _NAME.fullmatch(name)
    if match is None or match.group(2) != kind:
        example = EXAMPLES[kind]
        raise UnknownTypeError(f"'{name}' is not a type name such as {example}")
    prepare_environment()
    try:
        return getattr(import_module(f"{match.group(1)}.{kind}"), match.group(3))
    except (ImportError, AttributeError) as error:
        raise UnknownTypeError(
            f"type '{name}' is not installed ({error}); source its workspace before the start"
        ) from error


def _record_of(kind: Any, name: str) -> Record:  # noqa: ANN401
    fields: Mapping[str, str] = kind.get_fields_and_field_types()
    shapes = {field: _shape_of(type_name) for field, type_name in fields.items() if field != PADDING}
    return Record(name, shapes, kind)


def _shape_of(name: str) -> Shape:
    if sequence := _SEQUENCE.fullmatch(name):
        most = sequence.group("most")
        return ArrayShape(_shape_of(sequence.group("item")), most=int(most) if most else None)
    if array := _ARRAY.fullmatch(name):
        return ArrayShape(_shape_of(array.group("item")), exactly=int(array.group("exactly")))
    if scalar := _SCALARS.get(name):
        return scalar
    if text := _TEXT.fullmatch(name):
        longest = text.group("longest")
        return Scalar(ScalarKind.TEXT, longest=int(longest) if longest else None)
    package, _, kind = name.partition("/")
    return message_type(f"{package}/msg/{kind}")


def _integer_shape(bits: int, *, signed: bool) -> Scalar:
    if signed:
        return Scalar(ScalarKind.INTEGER, low=-(2 ** (bits - 1)), high=2 ** (bits - 1) - 1)
    return Scalar(ScalarKind.INTEGER, low=0, high=2**bits - 1)


_SCALARS: Final[Mapping[str, Scalar]] = {
    "boolean": Scalar(ScalarKind.BOOLEAN),
    "octet": Scalar(ScalarKind.INTEGER, low=0, high=255, octet=True),
    "char": _integer_shape(8, signed=False),
    **{name: Scalar(ScalarKind.NUMBER) for name in ("float", "double", "long double")},
    **{f"int{bits}": _integer_shape(bits, signed=True) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": _integer_shape(bits, signed=False) for bits in (8, 16, 32, 64)},
}


RELATIVE_TOLERANCE = 1e-6
"""Relative difference up to which two numbers are equal: a float32 differs from the configured number."""


def matches(value: Any, wanted: JsonValue) -> bool:  # noqa: ANN401 - a value of any field
    """Return whether ``value`` matches ``wanted``: the listed fields of a table, or any item of an array.

    If ``value`` is an array itself, it is compared as a whole.
    """
    if isinstance(wanted, dict):
        return isinstance(value, Mapping) and all(
            key in value and matches(value[key], part) for key, part in wanted.items()
        )
    if isinstance(wanted, list) and not isinstance(value, list):
        return any(matches(value, item) for item in wanted)
    if isinstance(value, list):
        return isinstance(wanted, list) and len(value) == len(wanted) and all(map(matches, value, wanted))
    if isinstance(value, float) and isinstance(wanted, int | float):
        return math.isclose(value, wanted, rel_tol=RELATIVE_TOLERANCE)
    # By type, too: to Python, 1 equals True.
    return type(value) is type(wanted) and bool(value == wanted)


def value_at(message: Mapping[str, Any], path: str) -> Any:  # noqa: ANN401
    """Return the value at a path such as ``status.text``, None if there is none."""
    value: Any = message
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
