"""Encode answers as JSON; long ones in slices, so that other tasks can run in between."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from pydantic import BaseModel
from pydantic_core import to_json

SLICE = 25
"""Number of list items encoded at once: orders, the longest items, take about 0.2 ms each."""

SCALARS: Final = frozenset({type(None), bool, int, float, str, datetime})
"""Types of most fields, which need no search for a long list."""


@dataclass(frozen=True, slots=True)
class EncodedPage:
    """A page of a list of objects in JSON: as models they would take five times the memory."""

    name: str
    """Of the field that holds the objects."""
    objects: tuple[bytes, ...]
    next: str | None
    """Value of ``after`` for the next page; None: this is the last one."""

    @property
    def size(self) -> int:
        """Length of the whole JSON, bytes."""
        commas = max(len(self.objects) - 1, 0)
        return len(self._opening) + sum(map(len, self.objects)) + commas + len(self._closing)

    async def parts(self) -> AsyncIterator[bytes]:
        """Yield the JSON in parts, so that it is in memory only once; other tasks run in between."""
        yield self._opening
        for start in range(0, len(self.objects), SLICE):
            part = b",".join(self.objects[start : start + SLICE])
            yield b",%s" % part if start else part
            await asyncio.sleep(0)
        yield self._closing

    @property
    def _opening(self) -> bytes:
        return b'{"%s":[' % self.name.encode()

    @property
    def _closing(self) -> bytes:
        return b'],"next":%s}' % to_json(self.next)


def as_json(body: BaseModel) -> bytes:
    """Return an object as JSON."""
    return body.__pydantic_serializer__.to_json(body, by_alias=True)


async def encode(body: BaseModel, *, exclude_none: bool = False) -> bytes:
    """Return an answer as JSON."""
    long = {name for name, value in vars(body).items() if type(value) not in SCALARS and _is_long(value)}
    short = body.model_dump_json(by_alias=True, exclude_none=exclude_none, exclude=long or None).encode()
    if not long:
        return short
    parts = [] if short == b"{}" else [short[1:-1]]
    for name, value in body:
        if name in long:
            field = type(body).model_fields[name]
            alias = field.serialization_alias or field.alias or name
            parts.append(b'"%s":%s' % (alias.encode(), await _encode_long(value, exclude_none=exclude_none)))
    return b"{%s}" % b",".join(parts)


def _is_long(value: object) -> bool:
    if isinstance(value, tuple):
        return len(value) > SLICE and all(isinstance(each, BaseModel) for each in value)
    return isinstance(value, BaseModel) and any(map(_is_long, vars(value).values()))


async def _encode_long(value: Any, *, exclude_none: bool) -> bytes:  # noqa: ANN401 - checked by _is_long
    if isinstance(value, BaseModel):
        return await encode(value, exclude_none=exclude_none)
    parts = []
    for start in range(0, len(value), SLICE):
        parts += [
            each.model_dump_json(by_alias=True, exclude_none=exclude_none).encode()
            for each in value[start : start + SLICE]
        ]
        await asyncio.sleep(0)
    return b"[%s]" % b",".join(parts)
