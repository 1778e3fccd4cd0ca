"""Reads the messages of fleet control to a robot, repaired where their meaning is certain."""

from __future__ import annotations

from datetime import datetime
from typing import TypeVar

from pydantic_core import from_json

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.repair import Repair, Repairs, Scope, repair, repairs_of, without_mark, written

H = TypeVar("H", bound=Header)


def read_command(
    kind: type[H], codec: Codec, payload: bytes, *, now: datetime
) -> tuple[H, tuple[Repair, ...]]:
    """Read a message of a fleet control, repaired if its meaning is certain; return what was repaired.

    Raises:
        MalformedMessageError: it violates the standard and cannot be repaired.
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
    repairs: Repairs = {}
    form = codec.forms.get(kind)
    if form is None or len(payload) > MAXIMUM_PAYLOAD:
        return None
    try:
        content = from_json(without_mark(payload, repairs))
        if not isinstance(content, dict):
            return None
        repair(form, content, repairs, version=codec.version, now=now, scope=Scope.COMMAND)
    except (ArithmeticError, ValueError, RecursionError):
        return None
    again = written(content) if repairs else None
    if again is None:
        return None
    try:
        return codec.decode(kind, again), repairs_of(repairs)
    except MalformedMessageError:
        return None
