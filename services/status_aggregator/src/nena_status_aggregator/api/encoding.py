"""Large responses: their lists are encoded in slices, between which other tasks run."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice

from pydantic_core import to_json

SLICE = 100
"""Number of views encoded before other tasks run."""


async def encode(view: Mapping[str, object]) -> bytes:
    """Return a view of the fleet as JSON; values may also be iterators, which become lists."""
    parts = []
    for name, value in view.items():
        text = await encode_list(value) if isinstance(value, list | Iterator) else to_json(value)
        parts.append(b"%b:%b" % (to_json(name), text))
    return b"{%b}" % b",".join(parts)


async def encode_list(views: Iterable[object]) -> bytes:
    """Return views as a JSON list."""
    left, parts = iter(views), list[bytes]()
    while part := list(islice(left, SLICE)):
        parts.append(to_json(part)[1:-1])
        await asyncio.sleep(0)
    return b"[%b]" % b",".join(parts)
