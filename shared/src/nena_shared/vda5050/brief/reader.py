"""Reads messages in brief; what is unusual, or wrong, is left to the codec of the version."""

from __future__ import annotations

from typing import Any, Final, TypeVar

from msgspec import DecodeError, ValidationError, convert
from msgspec.json import Decoder

from nena_shared.vda5050.brief import v2_0, v2_1, v3_0
from nena_shared.vda5050.brief.state import StateBrief, VisualizationBrief
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec

B = TypeVar("B", StateBrief, VisualizationBrief)

_FORMS: Final[dict[tuple[str, type], type]] = {
    (version, kind): form
    for version, forms in (("2.0.0", v2_0.FORMS), ("2.1.0", v2_1.FORMS), ("3.0.0", v3_0.FORMS))
    for kind, form in forms.items()
}
_DECODERS: Final[dict[tuple[str, type], Decoder[Any]]] = {key: Decoder(form) for key, form in _FORMS.items()}


def read_brief(kind: type[B], codec: Codec, payload: bytes) -> B:
    """Read a message of ``codec``'s version: as the codec reads it, as far as ``kind`` has its fields.

    Raises:
        MalformedMessageError: the codec does not take it.

    """
    brief = _read_plain(kind, codec, payload)
    if brief is not None:
        return brief
    return convert(codec.decode(kind.FULL, payload), kind, from_attributes=True)


def _read_plain(kind: type[B], codec: Codec, payload: bytes) -> B | None:
    """Read a message that says nothing unusual; None: the codec has to say what it is."""
    if len(payload) > MAXIMUM_PAYLOAD:
        return None
    try:
        if not payload.isascii():
            payload.decode()  # the decoder does not look at what it passes over
        brief: B = _DECODERS[codec.version, kind].decode(payload)
    except (DecodeError, UnicodeDecodeError, RecursionError):
        return None
    major = brief.version.partition(".")[0]
    return brief if "v" + major == codec.major_version else None


def brief_of(kind: type[B], codec: Codec, content: dict[str, Any]) -> B | None:
    """Read a message that is parsed already; None: the codec has to say what it is."""
    try:
        brief: B = convert(content, _FORMS[codec.version, kind])
    except (ValidationError, RecursionError):
        return None
    major = brief.version.partition(".")[0]
    return brief if "v" + major == codec.major_version else None
