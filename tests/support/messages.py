"""Hypothesis strategies for version-neutral VDA 5050 messages, made from the models' own fields."""

from __future__ import annotations

import types
from collections.abc import Callable
from datetime import UTC, datetime
from enum import Enum
from functools import cache
from math import pi
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from annotated_types import Ge, Le, MinLen
from hypothesis import strategies as st
from pydantic import JsonValue
from pydantic.fields import FieldInfo

from nena_shared.vda5050.action import Action
from nena_shared.vda5050.base import WireObject
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.order import ControlPoint, Edge, Node, Order
from nena_shared.vda5050.zone_set import REQUIRED, Zone, ZoneSet, ZoneType

M = TypeVar("M", bound=WireObject)

TEXT = st.text(max_size=6)
JSON = st.recursive(
    st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, st.none() | inner, max_size=3),
    max_leaves=4,
)
SIMPLE: dict[Any, st.SearchStrategy[Any]] = {
    type(None): st.none(),
    bool: st.booleans(),
    str: TEXT,
    datetime: st.datetimes(timezones=st.just(UTC)),
}
BY_FIELD: dict[str, st.SearchStrategy[Any]] = {
    "version": st.just("3.0.0"),
    "mobile_robot_kinematics": st.sampled_from(["DIFFERENTIAL", "OMNIDIRECTIONAL", "THREE_WHEEL"]),
    "mobile_robot_class": st.sampled_from(["FORKLIFT", "CONVEYOR", "TUGGER", "CARRIER"]),
    "weight": st.none() | st.floats(1e-6, 1e6),
    "degree": st.none() | st.integers(1, 2),
    "control_points": st.deferred(lambda: _enough_control_points()),  # noqa: PLW0108 - it stands below
    "type": st.sampled_from(["DRIVE", "CASTER", "FIXED", "MECANUM"]),
    "reference_key": st.sampled_from(["orderId", "parameter", "edges.maximumSpeed"]) | TEXT,
    "reference_value": st.sampled_from(["edges.corridor.corridorReferencePoint"]) | TEXT,
    "parameter": st.sampled_from(
        ["order.edges.maximumSpeed", "order.edges.corridor", "order.nodes.actions.retriable"]
    )
    | TEXT,
    "error_type": st.sampled_from([each.value for each in ErrorType]) | TEXT,
}
"""Fields of which the standard says more than their type does."""


@cache
def messages(kind: type[M]) -> st.SearchStrategy[M]:
    """Return valid objects of any neutral class; those of an order keep the rules of the graph."""
    fields = {name: _of_field(name, field) for name, field in kind.model_fields.items()}
    if kind is Order:
        fields |= {"nodes": st.just(()), "edges": st.just(())}
    elif kind is Zone:
        fields |= {"zone_type": st.sampled_from(ZoneType)}
        return st.fixed_dictionaries(fields).flatmap(_zones_of(fields)).map(lambda content: kind(**content))
    elif kind is ZoneSet:
        fields |= {"zones": st.lists(messages(Zone), max_size=3).map(_with_own_ids)}
    built = st.fixed_dictionaries(fields).map(lambda content: kind(**content))
    return _with_graph(built) if kind is Order else built  # type: ignore[arg-type, return-value] # M is Order


def _zones_of(
    fields: dict[str, st.SearchStrategy[Any]],
) -> Callable[[dict[str, Any]], st.SearchStrategy[dict[str, Any]]]:
    """Draw again what the type of a drawn zone needs and was left out."""

    def complete(content: dict[str, Any]) -> st.SearchStrategy[dict[str, Any]]:
        needed = REQUIRED.get(content["zone_type"], ())
        missing = {name: fields[name].filter(_is_given) for name in needed if content[name] is None}
        return st.fixed_dictionaries(missing).map(lambda more: content | more)

    return complete


def _is_given(value: object) -> bool:
    return value is not None


def _with_own_ids(zones: list[Zone]) -> tuple[Zone, ...]:
    return tuple(zone.model_copy(update={"zone_id": f"z{index}"}) for index, zone in enumerate(zones))


def _with_graph(orders: st.SearchStrategy[Order]) -> st.SearchStrategy[Order]:
    return st.builds(
        _graph,
        orders,
        st.lists(messages(Node), min_size=1, max_size=3),
        st.lists(messages(Edge), min_size=2, max_size=2),
        first=st.integers(0, 5).map(lambda half: 2 * half),
        base=st.integers(1, 3),
    )


def _graph(order: Order, nodes: list[Node], edges: list[Edge], *, first: int, base: int) -> Order:
    """Number ``nodes`` from ``first`` on with an edge after each but the last; release so many nodes."""
    content = {
        "nodes": tuple(
            node.model_copy(update={"sequence_id": first + 2 * index, "released": index < base})
            for index, node in enumerate(nodes)
        ),
        "edges": tuple(
            edge.model_copy(update={"sequence_id": first + 2 * index + 1, "released": index + 1 < base})
            for index, edge in enumerate(edges[: len(nodes) - 1])
        ),
    }
    return with_own_action_ids(order.model_copy(update=content))


def _enough_control_points() -> st.SearchStrategy[tuple[ControlPoint, ...]]:
    return st.lists(messages(ControlPoint), min_size=3, max_size=5).map(tuple)


def with_own_action_ids(order: Order) -> Order:
    """Number the actions of ``order``, so that all IDs are unique."""
    number = iter(range(10_000))

    def renamed(actions: tuple[Action, ...]) -> dict[str, tuple[Action, ...]]:
        return {
            "actions": tuple(each.model_copy(update={"action_id": f"a{next(number)}"}) for each in actions)
        }

    nodes = tuple(node.model_copy(update=renamed(node.actions)) for node in order.nodes)
    edges = tuple(edge.model_copy(update=renamed(edge.actions)) for edge in order.edges)
    return order.model_copy(update={"nodes": nodes, "edges": edges})


def _of_field(name: str, field: FieldInfo) -> st.SearchStrategy[Any]:
    return BY_FIELD[name] if name in BY_FIELD else _of_type(field.annotation, field.metadata)


def _of_type(kind: Any, limits: list[Any]) -> st.SearchStrategy[Any]:
    origin = get_origin(kind)
    if kind is JsonValue:
        return JSON
    if origin is Annotated:
        inner, *more = get_args(kind)
        return _of_type(inner, limits + _flat(more))
    if origin in (Union, types.UnionType):
        return st.one_of(*(_of_type(each, limits) for each in get_args(kind)))
    if origin is tuple:
        least = next((each.min_length for each in limits if isinstance(each, MinLen)), 0)
        return st.lists(_of_type(get_args(kind)[0], []), min_size=least, max_size=least + 2).map(tuple)
    if origin is dict:
        return st.dictionaries(TEXT, st.none() | JSON, max_size=3)
    return _of_class(kind, limits)


def _flat(metadata: list[Any]) -> list[Any]:
    return [part for each in metadata for part in (each.metadata if isinstance(each, FieldInfo) else [each])]


def _of_class(kind: Any, limits: list[Any]) -> st.SearchStrategy[Any]:
    if kind in SIMPLE:
        return SIMPLE[kind]
    if kind in (int, float):
        low = next((each.ge for each in limits if isinstance(each, Ge)), None)
        high = next((each.le for each in limits if isinstance(each, Le)), None)
        return st.integers(low, high) if kind is int else _floats(low, high)  # type: ignore[arg-type] # numbers
    return st.sampled_from(kind) if issubclass(kind, Enum) else messages(kind)


def _floats(low: float | None, high: float | None) -> st.SearchStrategy[float]:
    """Return finite numbers; angles without the little that a reader tolerates (see ``Angle``)."""
    if high is not None and pi <= high < pi + 1e-3:
        low, high = low and -pi, pi
    return st.floats(low, high, allow_nan=False, allow_infinity=False)
