"""Encode answers as JSON; long ones in slices, between which the event loop does other work."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel
from pydantic_core import to_json

SLICE = 25
"""Number of list items encoded at once: orders, the longest items, take about 0.2 ms each."""


@dataclass(frozen=True, slots=True)
class EncodedPage:
    """A page of a list whose objects are JSON already: as models they would take five times the memory."""

    name: str
    """Of the field that holds the objects."""
    objects: tuple[bytes, ...]
    next: str | None
    """Value of ``after`` for the next page; None: this is the last one."""

    @property
    def size(self) -> int:
        """Length of the whole JSON, bytes."""
        return sum(map(len, self._parts()))

    async def parts(self) -> AsyncIterator[bytes]:
        """Yield the JSON in parts, so that it is in memory only once."""
        for each in self._parts():
            yield each

    def _parts(self) -> Iterator[bytes]:
        yield b'{"%s":[' % self.name.encode()
        for place, each in enumerate(self.objects):
            yield b",%s" % each if place else each
        yield b'],"next":%s}' % to_json(self.next)


async def encode(body: BaseModel, *, exclude_none: bool = False) -> bytes:
    """Return an answer as JSON."""
    long = {name for name, value in body if _is_long(value)}
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
    return isinstance(value, BaseModel) and any(_is_long(each) for _, each in value)


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
