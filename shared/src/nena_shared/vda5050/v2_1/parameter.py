"""Names of the order's fields in 2.x, where messages speak about them by their dotted path.

The factsheet lists optional parameters by such paths, and errors refer to them: ``order.edges.maximumSpeed``
is ``order.edges.maxSpeed`` in 2.x.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from nena_shared.vda5050.action import Action
from nena_shared.vda5050.base import WireObject
from nena_shared.vda5050.order import Corridor, Edge, Node
from nena_shared.vda5050.v2_1.order import ActionV21, CorridorV21, EdgeV21, NodeV21

SEGMENT: Final = re.compile(r"\w+")


def _aliases(kind: type[WireObject], form: type[WireObject]) -> dict[str, str]:
    """Return the wire names of ``kind``'s fields, and what ``form`` calls them."""
    fields = form.model_fields
    return {str(field.alias): str(fields[name].alias) for name, field in kind.model_fields.items()}


WRITTEN: Final[Mapping[str, str]] = {
    name: other
    for kind, form in ((Node, NodeV21), (Edge, EdgeV21), (Corridor, CorridorV21), (Action, ActionV21))
    for name, other in _aliases(kind, form).items()
    if name != other
}
"""Neutral names and those of 2.x, where they differ."""

_READ: Final[Mapping[str, str]] = {other: name for name, other in WRITTEN.items()}


def written_path(path: str) -> str:
    """Return a neutral path in the names of 2.x."""
    return SEGMENT.sub(lambda part: WRITTEN.get(part[0], part[0]), path)


def neutral_path(path: str) -> str:
    """Return a path of 2.x in neutral names."""
    return SEGMENT.sub(lambda part: _READ.get(part[0], part[0]), path)


def missing_names(*forms: type[WireObject]) -> frozenset[str]:
    """Return the neutral wire names of the fields that a version does not have, from its forms."""
    return frozenset(
        str(field.alias) for form in forms for field in form.model_fields.values() if field.exclude
    )


def speaks_of(names: frozenset[str], path: str) -> bool:
    """Return whether a part of ``path`` is among ``names``."""
    return not names.isdisjoint(SEGMENT.findall(path))
