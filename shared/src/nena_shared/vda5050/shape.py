"""Field descriptions of a version's messages, derived from their pydantic forms.

The forms define each field once; records and repairs use the descriptions made here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, MaxLen
from pydantic import AliasChoices, BeforeValidator
from pydantic.fields import FieldInfo

from nena_shared.vda5050.base import WireObject
from nena_shared.vda5050.wire_names import Reads


@dataclass(frozen=True, slots=True)
class Shape:
    """A value: its Python type, limits, and accepted alternative names."""

    kind: type
    """str, int, float, bool, datetime, an enumeration, tuple, a form, or object for anything else."""
    least: float | None = None
    above: float | None = None
    most: float | None = None
    longest: int | None = None
    pattern: str | None = None
    item: Shape | None = None
    """For a tuple: its elements."""
    names: Mapping[str, str] | None = None


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a form."""

    name: str
    """Name in Python."""
    wire: tuple[str, ...]
    """Names on the wire; the first one is written."""
    shape: Shape
    required: bool
    nullable: bool


@cache
def fields_of(form: type[WireObject]) -> tuple[Field, ...]:
    """Return the fields that ``form`` reads."""
    fields = []
    for name, info in form.model_fields.items():
        if info.exclude:  # a field that the version does not have
            continue
        alias = info.validation_alias or info.alias or name
        fields.append(
            Field(
                name=name,
                wire=tuple(map(str, alias.choices)) if isinstance(alias, AliasChoices) else (str(alias),),
                shape=_shape_of(info.annotation, list(_flatten_metadata(info.metadata))),
                required=info.is_required(),
                nullable=type(None) in _members_of(info.annotation),
            )
        )
    return tuple(fields)


def _members_of(annotation: Any) -> tuple[Any, ...]:  # noqa: ANN401 - any type annotation
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)


def _flatten_metadata(metadata: list[Any]) -> Iterator[Any]:
    for item in metadata:
        if isinstance(item, FieldInfo):
            yield from _flatten_metadata(item.metadata)
        else:
            yield item


def _shape_of(annotation: Any, metadata: list[Any]) -> Shape:  # noqa: ANN401 - any type annotation
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *more = get_args(annotation)
        return _shape_of(inner, [*metadata, *_flatten_metadata(more)])
    if origin in (Union, UnionType):
        kinds = [arg for arg in get_args(annotation) if arg is not type(None)]
        return _shape_of(kinds[0], metadata) if len(kinds) == 1 else Shape(object)
    if any(isinstance(item, BeforeValidator) and not isinstance(item, Reads) for item in metadata):
        return Shape(object)  # read by the version's own code
    if origin is tuple:
        return Shape(tuple, item=_shape_of(get_args(annotation)[0], []))
    if isinstance(annotation, type) and issubclass(
        annotation, (str, int, float, datetime, StrEnum, WireObject)
    ):
        return _limited_shape(annotation, metadata)
    return Shape(object)


def _limited_shape(kind: type, metadata: list[Any]) -> Shape:
    limits = {type(item): item for item in metadata}
    least, above, most, longest = limits.get(Ge), limits.get(Gt), limits.get(Le), limits.get(MaxLen)
    reads = limits.get(Reads)
    return Shape(
        kind,
        least=None if least is None else float(least.ge),
        above=None if above is None else float(above.gt),
        most=None if most is None else float(most.le),
        longest=None if longest is None else longest.max_length,
        # pydantic has no public type for a pattern
        pattern=next((item.pattern for item in metadata if getattr(item, "pattern", None)), None),
        names=None if reads is None else reads.names,
    )
