"""The supported versions of VDA 5050, by number and by the header of a message (section 7.2)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_shared import vda5050
from nena_shared.vda5050.base import Version
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.topics import TopicScheme

_PACKAGE: Final = re.compile(r"v\d+_\d+(_\d+)?", re.ASCII)


def find_codecs() -> dict[str, Codec]:
    """Return the codecs of all packages here that are named after a version, the oldest first."""
    names = (each.name for each in iter_modules(vda5050.__path__) if _PACKAGE.fullmatch(each.name))
    found: list[Codec] = [import_module(f"{vda5050.__name__}.{name}").CODEC for name in names]
    return {each.version: each for each in sorted(found, key=lambda each: _numbers(each.version))}


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


CODECS: Final[Mapping[str, Codec]] = MappingProxyType(find_codecs())
"""By version number, the oldest first."""

RULES: Final[Mapping[str, Rules]] = MappingProxyType({name: each.rules for name, each in CODECS.items()})
"""The differences in meaning of each version, by version number."""

_WRITTEN: Final = re.compile(r"v?(\d{1,3})(?:\.(\d{1,3}))?(?:\.(\d{1,3}))?", re.ASCII)
"""A version number of which the end may be missing."""


class UnknownVersionError(Exception):
    """``version`` is not supported."""

    def __init__(self, version: str) -> None:
        self.version = version
        super().__init__(f"VDA 5050 {version!r} is not supported; choose one of {', '.join(CODECS)}")


def codec_for(version: str) -> Codec:
    """Return the codec of exactly this version.

    Raises:
        UnknownVersionError: there is none.

    """
    if version not in CODECS:
        raise UnknownVersionError(version)
    return CODECS[version]


def codec_named(text: str) -> Codec:
    """Return the codec of a version as people write it, such as ``2.0`` in a plant model.

    Raises:
        UnknownVersionError: it is neither a supported version nor a later one of a supported major version.

    """
    written = _WRITTEN.fullmatch(text.strip())
    codec = nearest_codec(".".join(part or "0" for part in written.groups())) if written else None
    if codec is None:
        raise UnknownVersionError(text)
    return codec


def topics_for(version: str, interface_name: str | None = None) -> TopicScheme:
    """Return the topics of a version (section 4.2); by default under the standard's suggested interface name.

    Raises:
        UnknownVersionError: the version is not supported.

    """
    codec = codec_for(version)
    return TopicScheme(interface_name or codec.interface_name, codec.major_version)


class _Version(BaseModel):
    model_config = ConfigDict(strict=True)

    version: Version


def version_of(payload: bytes) -> str | None:
    """Read the version from a message's header; None if it is not a message."""
    try:
        return _Version.model_validate_json(payload).version
    except ValidationError:
        return None


def codec_of_header(payload: bytes) -> Codec | None:
    """Return the codec for a robot, from the header of its connection or factsheet.

    For an unsupported version it is the nearest older one of the same major version; None if
    there is none, or no header.
    """
    version = version_of(payload)
    return None if version is None else nearest_codec(version)


@lru_cache(maxsize=100)
def nearest_codec(version: str) -> Codec | None:
    """Return the codec of this version, or of the nearest older one of the same major version."""
    wanted = _numbers(version)
    older = [codec for codec in CODECS.values() if wanted[:1] <= _numbers(codec.version) <= wanted]
    return older[-1] if older else None


def reader_of(payload: bytes, major_version: str) -> Codec:
    """Return the codec for a message received on a topic of ``major_version``, e.g. ``v2``.

    It is that of the header if both agree; else the newest of the major version, whose errors explain the
    problem.

    Raises:
        UnknownVersionError: the major version is not supported.

    """
    return reader_for(version_of(payload), major_version)


def reader_for(version: str | None, major_version: str) -> Codec:
    """Return the codec to read a message with that names ``version`` under a topic of ``major_version``.

    Raises:
        UnknownVersionError: the major version is not supported.

    """
    codec = None if version is None else nearest_codec(version)
    if codec is not None and codec.major_version == major_version:
        return codec
    of_topic = [codec for codec in CODECS.values() if codec.major_version == major_version]
    if not of_topic:
        raise UnknownVersionError(major_version)
    return of_topic[-1]
