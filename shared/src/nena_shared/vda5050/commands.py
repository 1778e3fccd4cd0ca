"""Reads what a fleet control sends to a robot, tolerantly where the meaning is certain."""

from __future__ import annotations

from datetime import datetime
from typing import TypeVar

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.repair import Repair, Repairs, Scope, parsed, repair, repairs_of, written

H = TypeVar("H", bound=Header)


def read_command(
    kind: type[H], codec: Codec, payload: bytes, *, now: datetime
) -> tuple[H, tuple[Repair, ...]]:
    """Read a message of a fleet control, repaired where its meaning is certain; return what was repaired.

    Raises:
        MalformedMessageError: it breaks the standard otherwise.

    """
    try:
        return codec.decode(kind, payload), ()
    except MalformedMessageError:
        repaired = _repaired_command(kind, codec, payload, now)
        if repaired is None:
            raise
        return repaired


def _repaired_command(
    kind: type[H], codec: Codec, payload: bytes, now: datetime
) -> tuple[H, tuple[Repair, ...]] | None:
    found: Repairs = {}
    content = parsed(payload, found) if len(payload) <= MAXIMUM_PAYLOAD else None
    form = codec.forms.get(kind)
    if content is None or form is None:
        return None
    repair(form, content, found, version=codec.version, now=now, scope=Scope.COMMAND)
    again = written(content) if found else None
    if again is None:
        return None
    try:
        return codec.decode(kind, again), repairs_of(found)
    except MalformedMessageError:
        return None
