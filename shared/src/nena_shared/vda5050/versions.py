"""The supported versions of VDA 5050, by number and by the header of a message (section 7.2)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_shared import vda5050
from nena_shared.vda5050.base import Version
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.topics import TopicScheme

_PACKAGE: Final = re.compile(r"v\d+_\d+(_\d+)?", re.ASCII)


class _Codecs(Mapping[str, Codec]):
    """Codecs by version; each package is imported at its first use, because a robot only needs one."""

    def __init__(self, packages: Iterable[str]) -> None:
        by_version = {_version_of(package): package for package in packages}
        # by numbers: as a text, 2.10.0 is before 2.9.0
        self._packages = {version: by_version[version] for version in sorted(by_version, key=_numbers_of)}
        self._loaded: dict[str, Codec] = {}

    def __getitem__(self, version: str) -> Codec:
        if version not in self._loaded:
            module = import_module(f"{vda5050.__name__}.{self._packages[version]}")
            self._loaded[version] = module.CODEC
        return self._loaded[version]

    def __iter__(self) -> Iterator[str]:
        return iter(self._packages)

    def __len__(self) -> int:
        return len(self._packages)


class _Rules(Mapping[str, Rules]):
    """Rules by version; they load the codec."""

    def __getitem__(self, version: str) -> Rules:
        return CODECS[version].rules

    def __iter__(self) -> Iterator[str]:
        return iter(CODECS)

    def __len__(self) -> int:
        return len(CODECS)


def find_codecs() -> Mapping[str, Codec]:
    """Return the codecs of all packages here that are named after a version, the oldest first."""
    return _Codecs(
        module.name for module in iter_modules(vda5050.__path__) if _PACKAGE.fullmatch(module.name)
    )


def load_codecs() -> None:
    """Import all versions now, because an import in the middle of the work would hold up the event loop."""
    for version in CODECS:
        codec_for(version)


def _version_of(package: str) -> str:
    """Return the version of a package such as ``v3_0`` or ``v3_0_1``."""
    numbers = package[1:].split("_")
    return ".".join([*numbers, "0"][:3])


def _numbers_of(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


CODECS: Final[Mapping[str, Codec]] = find_codecs()
"""By version number, the oldest first."""

RULES: Final[Mapping[str, Rules]] = _Rules()
"""The differences in meaning of each version, by version number."""

_WRITTEN: Final = re.compile(r"v?(\d{1,3})(?:\.(\d{1,3}))?(?:\.(\d{1,3}))?", re.ASCII | re.IGNORECASE)
"""A version number; minor and patch may be missing."""


class UnknownVersionError(Exception):
    """``version`` is not supported."""

    def __init__(self, version: str) -> None:
        self.version = version
        super().__init__(f"VDA 5050 {version!r} is not supported; choose one of {', '.join(CODECS)}")


def codec_for(version: str) -> Codec:
    """Return the codec of exactly this version.

    Raises:
        UnknownVersionError: the version is not supported.
    """
    if version not in CODECS:
        raise UnknownVersionError(version)
    return CODECS[version]


def codec_named(text: str) -> Codec:
    """Return the codec of a possibly abbreviated version, such as ``2.0`` in a plant model.

    Raises:
        UnknownVersionError: neither this version nor an older one of the same major version is supported.
    """
    written = _WRITTEN.fullmatch(text.strip())
    codec = nearest_codec(".".join(part or "0" for part in written.groups())) if written else None
    if codec is None:
        raise UnknownVersionError(text)
    return codec


def topics_for(version: str, interface_name: str | None = None) -> TopicScheme:
    """Return the topics of a version (section 4.2); ``interface_name`` defaults to that of the standard.

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


@lru_cache(maxsize=100)
def nearest_codec(version: str) -> Codec | None:
    """Return the codec of this version, or of the nearest older one of the same major version."""
    wanted = _numbers_of(version)
    # (2,) is before every (2, x, y), so the lower limit is the major version
    older = [codec for codec in CODECS if wanted[:1] <= _numbers_of(codec) <= wanted]
    return CODECS[older[-1]] if older else None


def reader_of(payload: bytes, major_version: str) -> Codec:
    """Return the codec for a message received on a topic of ``major_version``, e.g. ``v2``.

    If header and topic disagree, this is the newest codec of the topic's major version; its errors explain
    the problem.

    Raises:
        UnknownVersionError: the major version is not supported.
    """
    return reader_for(version_of(payload), major_version)


def reader_for(version: str | None, major_version: str) -> Codec:
    """Return the codec for a message with ``version`` in its header, on a topic of ``major_version``.

    Raises:
        UnknownVersionError: the major version is not supported.
    """
    codec = None if version is None else nearest_codec(version)
    if codec is not None and codec.major_version == major_version:
        return codec
    # 4.2: fleet controls subscribe by the topic's major version, so it counts if the header disagrees
    of_topic = [codec for codec in CODECS if "v" + codec.partition(".")[0] == major_version]
    if not of_topic:
        raise UnknownVersionError(major_version)
    return CODECS[of_topic[-1]]
