"""Translate dotted paths of order fields between 2.x and neutral names.

Factsheets list optional parameters by such paths, and errors refer to them: ``order.edges.maximumSpeed`` is
``order.edges.maxSpeed`` in 2.x.
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


def _aliases_of(kind: type[WireObject], form: type[WireObject]) -> dict[str, str]:
    """Return the wire names in ``form`` by the wire names in ``kind``."""
    fields = form.model_fields
    return {str(field.alias): str(fields[name].alias) for name, field in kind.model_fields.items()}


WRITTEN: Final[Mapping[str, str]] = {
    name: name_v2
    for kind, form in ((Node, NodeV21), (Edge, EdgeV21), (Corridor, CorridorV21), (Action, ActionV21))
    for name, name_v2 in _aliases_of(kind, form).items()
    if name != name_v2
}
"""Names of 2.x by neutral names, where they differ."""

_READ: Final[Mapping[str, str]] = {name_v2: name for name, name_v2 in WRITTEN.items()}


def written_path(path: str) -> str:
    """Convert a neutral path to 2.x names."""
    return SEGMENT.sub(lambda part: WRITTEN.get(part[0], part[0]), path)


def neutral_path(path: str) -> str:
    """Convert a 2.x path to neutral names."""
    return SEGMENT.sub(lambda part: _READ.get(part[0], part[0]), path)


def missing_names(*forms: type[WireObject]) -> frozenset[str]:
    """Return the neutral wire names of the fields that a version's forms lack."""
    return frozenset(
        str(field.alias) for form in forms for field in form.model_fields.values() if field.exclude
    )


def has_segment_in(names: frozenset[str], path: str) -> bool:
    """Return whether a level of ``path`` is in ``names``."""
    return not names.isdisjoint(SEGMENT.findall(path))
