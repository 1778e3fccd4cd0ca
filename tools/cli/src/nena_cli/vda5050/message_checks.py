"""One message by itself: whether it is one of its version, in that version's own words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from pydantic import JsonValue, ValidationError
from pydantic_core import from_json

from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_cli.vda5050.said import Said
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import KINDS
from nena_shared.vda5050.graph import violations
from nena_shared.vda5050.order import Order

TOLD: Final = 5
"""Findings of one kind about one message, at most."""
TIMES: Final = frozenset({"timestamp", "leaseExpiry", "eta"})
ONLY_READ: Final = frozenset({"AUTOACK"})
"""Values of 2.x that the neutral model says by other fields; they are written as they should be."""


def message_problems(said: Said) -> Iterator[Problem]:
    """Say what is wrong with a message that cannot be read, or that is read in spite of it."""
    if said.message is None:
        broken = _graph_violations(said)
        for problem in said.problems:
            yield Rule.GRAPH if problem in broken else Rule.MESSAGE, Severity.ERROR, problem
        return
    written: JsonValue = said.message.model_dump(mode="json", by_alias=True)
    deviations = list(_deviations(from_json(said.payload), written, ""))
    for rule in (Rule.FIELD, Rule.SPELLING):
        yield from [each for each in deviations if each[0] is rule][:TOLD]


def _graph_violations(said: Said) -> tuple[str, ...]:
    """Give the rules of the graph that an order breaks that is readable otherwise."""
    form = said.codec.forms.get(KINDS[said.topic], Header)
    try:
        order = form.model_validate_json(said.payload, by_alias=True, by_name=False)
    except ValidationError:
        return ()
    return violations(order) if isinstance(order, Order) else ()


def _deviations(given: JsonValue, written: JsonValue, path: str) -> Iterator[Problem]:
    """Compare a message with the same one as its version would write it; ``path`` is where we are in it."""
    if isinstance(given, dict) and isinstance(written, dict):
        for key, value in given.items():
            where = f"{path}.{key}" if path else key
            if key in written:
                yield from _deviations(value, written[key], where)
            else:
                yield Rule.FIELD, Severity.WARNING, f"{where} is no field of this version; it is passed over"
    elif isinstance(given, list) and isinstance(written, list):
        for index, (one, other) in enumerate(zip(given, written, strict=False)):
            yield from _deviations(one, other, f"{path}.{index}")
    elif isinstance(given, str):
        yield from _spelling(given, written, path)


def _spelling(given: str, written: JsonValue, path: str) -> Iterator[Problem]:
    if path.rsplit(".", 1)[-1] in TIMES:
        if not given.endswith("Z"):
            yield (
                Rule.SPELLING,
                Severity.WARNING,
                f"{path} '{given}' is not written in UTC with a Z at its end",
            )
    elif given != written and given not in ONLY_READ:
        yield Rule.SPELLING, Severity.ERROR, f"{path} is written '{given}'; this version writes '{written}'"
