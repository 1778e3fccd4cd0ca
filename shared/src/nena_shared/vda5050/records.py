"""Read states and visualizations as read-only records, several times as fast as with the codecs.

A record has the attributes of its neutral message (``State``, ``Visualization``), but is an msgspec struct
instead of a pydantic model. It is derived from the version's form, so that each field is defined once.
Decision 0017 explains why there are two ways to read a state, and how they are kept consistent.

A record only accepts values that need no further processing. Values that need a form's validators (older
names, other spellings) do not fit the record; the version's codec then reads the message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from datetime import datetime
from enum import StrEnum
from functools import cache
from sys import float_info
from types import GenericAlias
from typing import Annotated, Any, Final, TypeVar, cast

from msgspec import DecodeError, Meta, Raw, Struct, ValidationError, convert, defstruct, field, structs
from msgspec.json import Decoder, Encoder
from msgspec.structs import force_setattr
from pydantic_core import from_json

from nena_shared.vda5050.base import Header, WireObject
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.shape import Field, Shape, fields_of
from nena_shared.vda5050.state import State
from nena_shared.vda5050.visualization import Visualization

R = TypeVar("R", bound=Header)
W = TypeVar("W", bound=WireObject)

_JSON: Final[Decoder[Any]] = Decoder()
_MEMBERS: Final[Decoder[dict[str, Raw]]] = Decoder(dict[str, Raw])
_ENCODER: Final = Encoder()

RECORDED: Final = (State, Visualization)
"""Messages that are read as records: the most frequent ones."""


def read_record(kind: type[R], codec: Codec, payload: bytes) -> R:
    """Read a message as a record, or with its codec if it does not fit a record.

    Raises:
        MalformedMessageError: the codec rejects the message.
    """
    record = _decode_record(kind, codec, payload)
    return codec.decode(kind, payload) if record is None else record


def parse(payload: bytes) -> Any:  # noqa: ANN401 - JSON
    """Parse JSON, which may contain NaN or infinity; raises ValueError if the payload is not JSON."""
    try:
        return _JSON.decode(payload)
    except (DecodeError, RecursionError):
        return from_json(payload)


def parse_members(payload: bytes, names: Iterable[str]) -> Any:  # noqa: ANN401 - JSON
    """Parse the named members of a JSON object; the others stay text (``Raw``), which is faster.

    Everything is parsed if it contains NaN or infinity, or is no object.

    Raises:
        ValueError: the payload is not JSON.
    """
    try:
        content: dict[str, Any] = _MEMBERS.decode(payload)
        for name in names:
            if name in content:
                content[name] = _JSON.decode(content[name])
    except (DecodeError, RecursionError):
        return from_json(payload)
    return content


def encoded(content: dict[str, Any]) -> bytes | None:
    """Serialise a message of which members are text (see ``parse_members``); None if none is."""
    return _ENCODER.encode(content) if Raw in map(type, content.values()) else None


def record_of(kind: type[R], codec: Codec, content: dict[str, Any]) -> R | None:
    """Convert a parsed message to a record; None if only the codec can read it."""
    form = codec.forms.get(kind)
    if form is None:
        return None
    try:
        return _of_major(codec, cast("R", convert(content, _struct_of(form))))
    except (ValidationError, RecursionError):
        return None


def changed(message: W, **values: object) -> W:
    """Return a copy of a message (record or model) with changed fields."""
    record: object = message
    if isinstance(record, Struct):
        return cast("W", structs.replace(record, **values))
    return message.model_copy(update=values)


def _decode_record(kind: type[R], codec: Codec, payload: bytes) -> R | None:
    form = codec.forms.get(kind)
    if form is None or len(payload) > MAXIMUM_PAYLOAD:
        return None
    try:
        if not payload.isascii():
            payload.decode()  # msgspec does not validate UTF-8 in skipped fields
        return _of_major(codec, cast("R", _decoder_of(form).decode(payload)))
    except (DecodeError, UnicodeDecodeError, RecursionError):
        return None


def _of_major(codec: Codec, record: R) -> R | None:
    return record if "v" + record.version.partition(".")[0] == codec.major_version else None


@cache
def _decoder_of(form: type[Header]) -> Decoder[Any]:
    return Decoder(_struct_of(form))


@cache
def _struct_of(form: type[WireObject]) -> type[Any]:
    """Derive the struct of a form. Fields that the version lacks become class constants."""
    read = fields_of(form)
    names = {member.name for member in read}
    namespace: dict[str, Any] = {
        name: info.get_default(call_default_factory=True)
        for name, info in form.model_fields.items()
        if name not in names
    }
    if form.finish_record is not WireObject.finish_record:
        namespace["__post_init__"] = _finisher_of(form)
    return defstruct(
        form.__name__,
        [_struct_member(form, member) for member in read]
        # a field under another of its names has no place in the struct: such a message does not fit it
        + [
            (f"other_{index}_{member.name}", None, field(name=name, default=None))
            for member in read
            for index, name in enumerate(member.wire[1:])
        ],
        namespace=namespace,
        module=form.__module__,
        frozen=True,
        kw_only=True,
        gc=False,  # a tree without circles
    )


def _finisher_of(form: type[WireObject]) -> Callable[[Any], None]:
    finish = form.finish_record

    def post_init(record: Any) -> None:  # noqa: ANN401 - a struct
        for name, value in finish(record).items():
            force_setattr(record, name, value)

    return post_init


def _struct_member(form: type[WireObject], member: Field) -> tuple[str, Any, Any]:
    """Return a field as msgspec defines it."""
    kind = _type_of(member.shape)
    info = form.model_fields[member.name]
    # fields that default to the time of reading need the codec
    required = member.required or info.default_factory is not None
    default: Any = {} if required else {"default": info.default}
    return member.name, kind | None if member.nullable else kind, field(name=member.wire[0], **default)


def _type_of(shape: Shape) -> Any:  # noqa: ANN401 - any type annotation
    if shape.kind is object:
        return None  # read by the version's own code: needs the codec
    if shape.kind is tuple:
        return GenericAlias(tuple, (_type_of(shape.item or Shape(object)), ...))
    if issubclass(shape.kind, WireObject):
        return _struct_of(shape.kind)
    if issubclass(shape.kind, StrEnum):
        return shape.kind
    return _limited_type(shape)


def _limited_type(shape: Shape) -> Any:  # noqa: ANN401 - any type annotation
    kind: Any = shape.kind
    if kind is datetime:
        return Annotated[datetime, Meta(tz=True)]
    if kind in (int, float):
        limits = {"ge": shape.least, "gt": shape.above, "le": shape.most}
        meta = {name: kind(limit) for name, limit in limits.items() if limit is not None}
        if kind is float:  # NaN and infinity, which ``record_of`` may be given, are beyond these limits
            meta = ({} if "gt" in meta else {"ge": -float_info.max}) | {"le": float_info.max} | meta
        return Annotated[kind, Meta(**meta)] if meta else kind
    if kind is str:
        pattern = shape.pattern
        if shape.names:  # only the codec translates older names of a value
            pattern = rf"^(?!(?:{'|'.join(map(re.escape, shape.names))})\Z)"
        elif pattern is not None:  # in Python, unlike in pydantic, $ also matches before a final line end
            pattern = pattern.removesuffix("$") + r"\Z"
        return Annotated[str, Meta(max_length=shape.longest, pattern=pattern)]
    return kind
