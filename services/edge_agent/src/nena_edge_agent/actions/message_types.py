"""Types of ROS messages and services by name, such as ``std_msgs/msg/String``; rclpy itself is not needed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from typing import Any, Final

from nena_edge_agent.actions.message_shape import Listing, Record, Scalar, ScalarKind, Shape
from nena_edge_agent.ros.environment import prepare_environment

_NAME: Final = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv)/([A-Z][A-Za-z0-9]*)")
_SEQUENCE: Final = re.compile(r"sequence<(?P<item>.+?)(?:, (?P<most>\d+))?>")
_ARRAY: Final = re.compile(r"(?P<item>.+)\[(?P<exactly>\d+)\]")
_TEXT: Final = re.compile(r"w?string(?:<=?(?P<longest>\d+)>?)?")
PADDING: Final = "structure_needs_at_least_one_member"
"""The field that some distributions show in a message without fields."""


class UnknownTypeError(Exception):
    """There is no such message or service type here; the text says so, and what to do."""


@lru_cache(maxsize=200)
def message_type(name: str) -> Record:
    """Give the shape of a message type, such as ``geometry_msgs/msg/PoseStamped``.

    Raises:
        UnknownTypeError: it is not installed, or no name of a message type.

    """
    return _record(_load(name, "msg"), name)


@lru_cache(maxsize=200)
def service_type(name: str) -> tuple[Record, Record]:
    """Give the shapes of the request and the response of a service type, such as ``std_srvs/srv/Trigger``.

    Raises:
        UnknownTypeError: it is not installed, or no name of a service type.

    """
    kind = _load(name, "srv")
    return _record(kind.Request, f"{name} request"), _record(kind.Response, f"{name} response")


def class_of(name: str) -> Any:  # noqa: ANN401 - rclpy carries no types
    """Give the class of a message or service type.

    Raises:
        UnknownTypeError: it is not installed, or no name of a type.

    """
    return _load(name, "srv" if "/srv/" in name else "msg")


def read(message: Any) -> dict[str, Any]:  # noqa: ANN401
    """Give the fields of a message that has come, as plain data."""
    return {name: _plain(getattr(message, name)) for name in message.get_fields_and_field_types()}


def _plain(value: Any) -> Any:  # noqa: ANN401
    if hasattr(value, "get_fields_and_field_types"):
        return read(value)
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else list(value)
    if isinstance(value, str | bool | int | float):
        return value
    return [_plain(each) for each in value.tolist()] if hasattr(value, "tolist") else [*map(_plain, value)]


def _load(name: str, kind: str) -> Any:  # noqa: ANN401
    found = _NAME.fullmatch(name)
    if found is None or found.group(2) != kind:
        example = "std_msgs/msg/String" if kind == "msg" else "std_srvs/srv/Trigger"
        text = f"'{name}' is no name of a type such as {example}"
        raise UnknownTypeError(text)
    prepare_environment()
    try:
        return getattr(import_module(f"{found.group(1)}.{kind}"), found.group(3))
    except (ImportError, AttributeError) as error:
        text = f"there is no type '{name}' here ({error}); source the workspace that has it before the start"
        raise UnknownTypeError(text) from error


def _record(kind: Any, name: str) -> Record:  # noqa: ANN401
    fields: Mapping[str, str] = kind.get_fields_and_field_types()
    shapes = {field: _shape(each) for field, each in fields.items() if field != PADDING}
    return Record(name, shapes, kind)


def _shape(name: str) -> Shape:
    if found := _SEQUENCE.fullmatch(name):
        most = found.group("most")
        return Listing(_shape(found.group("item")), most=int(most) if most else None)
    if found := _ARRAY.fullmatch(name):
        return Listing(_shape(found.group("item")), exactly=int(found.group("exactly")))
    scalar = _SCALARS.get(name) or _text(name)
    if scalar:
        return scalar
    package, _, kind = name.partition("/")
    return message_type(f"{package}/msg/{kind}")


def _text(name: str) -> Scalar | None:
    found = _TEXT.fullmatch(name)
    longest = found.group("longest") if found else None
    return Scalar(ScalarKind.TEXT, longest=int(longest) if longest else None) if found else None


def _integer(bits: int, *, signed: bool) -> Scalar:
    if signed:
        return Scalar(ScalarKind.INTEGER, low=-(2 ** (bits - 1)), high=2 ** (bits - 1) - 1)
    return Scalar(ScalarKind.INTEGER, low=0, high=2**bits - 1)


_SCALARS: Final[Mapping[str, Scalar]] = {
    "boolean": Scalar(ScalarKind.TRUTH),
    "octet": Scalar(ScalarKind.INTEGER, low=0, high=255, octet=True),
    "char": _integer(8, signed=False),
    **{name: Scalar(ScalarKind.NUMBER) for name in ("float", "double", "long double")},
    **{f"int{bits}": _integer(bits, signed=True) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": _integer(bits, signed=False) for bits in (8, 16, 32, 64)},
}
