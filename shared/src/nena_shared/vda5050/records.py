"""States and visualizations as read-only records, read several times as fast as by the codecs.

A record has the attributes of its neutral message (``State``, ``Visualization``), but is no pydantic model:
it is a struct of msgspec, derived from the form of the version, so that each field is written once. Decision
0017 explains why there are two ways to read a state, and what keeps them together.

A record only accepts values that need no further processing. What a form reads by its own validators (older
names, other spellings) does not fit the record, and the codec of the version reads the message instead.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import datetime
from enum import StrEnum
from functools import cache
from types import GenericAlias
from typing import Annotated, Any, Final, TypeVar, cast

from msgspec import DecodeError, Meta, Struct, ValidationError, convert, defstruct, field, structs
from msgspec.json import Decoder
from msgspec.structs import force_setattr
from pydantic_core import from_json

from nena_shared.vda5050.base import Header, WireObject
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.shape import Field, Shape, fields_of
from nena_shared.vda5050.state import State
from nena_shared.vda5050.visualization import Visualization

R = TypeVar("R", bound=Header)

_JSON: Final[Decoder[Any]] = Decoder()

RECORDED: Final = (State, Visualization)
"""The messages that are read as records: those that robots send most often."""


def read_record(kind: type[R], codec: Codec, payload: bytes) -> R:
    """Read a message as a record, or by its codec if it does not fit a record.

    Raises:
        MalformedMessageError: the codec refuses it.
    """
    record = _decoded(kind, codec, payload)
    return codec.decode(kind, payload) if record is None else record


def parse(payload: bytes) -> tuple[Any, bool]:
    """Parse JSON; return it and whether it is exact: with NaN or infinite numbers it is not.

    Raises:
        ValueError: it is none.

    """
    try:
        return _JSON.decode(payload), True
    except (DecodeError, RecursionError):
        return from_json(payload), False


def record_of(kind: type[R], codec: Codec, content: dict[str, Any]) -> R | None:
    """Make a record of a parsed message; None: it must be read by the codec."""
    form = codec.forms.get(kind)
    if form is None:
        return None
    try:
        return _of_major(codec, cast("R", convert(content, _struct(form))))
    except (ValidationError, RecursionError):
        return None


def changed(message: R, **values: object) -> R:
    """Return a message, a record or not, with other values."""
    record: object = message
    if isinstance(record, Struct):
        return cast("R", structs.replace(record, **values))
    return message.model_copy(update=values)


def _decoded(kind: type[R], codec: Codec, payload: bytes) -> R | None:
    form = codec.forms.get(kind)
    if form is None or len(payload) > MAXIMUM_PAYLOAD:
        return None
    try:
        if not payload.isascii():
            payload.decode()  # the decoder does not check what it skips
        return _of_major(codec, cast("R", _decoder(form).decode(payload)))
    except (DecodeError, UnicodeDecodeError, RecursionError):
        return None


def _of_major(codec: Codec, record: R) -> R | None:
    return record if "v" + record.version.partition(".")[0] == codec.major_version else None


@cache
def _decoder(form: type[Header]) -> Decoder[Any]:
    return Decoder(_struct(form))


@cache
def _struct(form: type[WireObject]) -> type[Any]:
    """Derive the struct of a form. Fields that the version lacks are constants of the class."""
    read = fields_of(form)
    names = {each.name for each in read}
    namespace: dict[str, Any] = {
        name: info.get_default(call_default_factory=True)
        for name, info in form.model_fields.items()
        if name not in names
    }
    if form.finish_record is not WireObject.finish_record:
        namespace["__post_init__"] = _finisher(form)
    return defstruct(
        form.__name__,
        [_member(form, each) for each in read] + [other for each in read for other in _other_names(each)],
        namespace=namespace,
        module=form.__module__,
        frozen=True,
        kw_only=True,
        gc=False,
    )


def _finisher(form: type[WireObject]) -> Callable[[Any], None]:
    finish = form.finish_record

    def post_init(record: Any) -> None:  # noqa: ANN401 - a struct
        for name, value in finish(record).items():
            force_setattr(record, name, value)

    return post_init


def _member(form: type[WireObject], each: Field) -> tuple[str, Any, Any]:
    """Return a field as msgspec defines it."""
    kind = _type_of(each.shape)
    info = form.model_fields[each.name]
    # what the codec fills in with the time of reading is read by the codec
    required = each.required or info.default_factory is not None
    default: Any = {} if required else {"default": info.default}
    return each.name, kind | None if each.nullable else kind, field(name=each.wire[0], **default)


def _other_names(each: Field) -> list[tuple[str, Any, Any]]:
    """Return members that no message fits which has a field under another of its names."""
    return [
        (f"other_{index}_{each.name}", None, field(name=name, default=None))
        for index, name in enumerate(each.wire[1:])
    ]


def _type_of(shape: Shape) -> Any:  # noqa: ANN401 - any type annotation
    if shape.kind is object:
        return None  # the version reads it by its own code: the codec
    if shape.kind is tuple:
        return GenericAlias(tuple, (_type_of(shape.item or Shape(object)), ...))
    if issubclass(shape.kind, WireObject):
        return _struct(shape.kind)
    if issubclass(shape.kind, StrEnum):
        return shape.kind
    return _limited(shape)


def _limited(shape: Shape) -> Any:  # noqa: ANN401 - any type annotation
    kind: Any = shape.kind
    if kind is datetime:
        return Annotated[datetime, Meta(tz=True)]
    if kind in (int, float):
        limits = {"ge": shape.least, "gt": shape.above, "le": shape.most}
        given = {name: kind(limit) for name, limit in limits.items() if limit is not None}
        return Annotated[kind, Meta(**given)] if given else kind
    if kind is str:
        return Annotated[str, Meta(max_length=shape.longest, pattern=_pattern(shape))]
    return kind


def _pattern(shape: Shape) -> str | None:
    """Return what a text has to match: the pattern of its field, and none of its older names."""
    if shape.names:
        return rf"^(?!(?:{'|'.join(map(re.escape, shape.names))})\Z)"
    return None if shape.pattern is None else shape.pattern.removesuffix("$") + r"\Z"
