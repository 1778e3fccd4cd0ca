"""Whether a message that has come is the one that is waited for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic import JsonValue

CLOSE = 1e-6
"""Relative difference of two numbers that count as the same: a float32 is not quite what was written."""


def matches(value: Any, wanted: JsonValue) -> bool:  # noqa: ANN401 - a value of any field
    """Tell whether ``value`` is as ``wanted``: of tables the named fields, of an array any one of its items.

    Where the value is an array itself, it is compared as a whole.
    """
    if isinstance(wanted, dict):
        return isinstance(value, Mapping) and all(
            key in value and matches(value[key], each) for key, each in wanted.items()
        )
    if isinstance(wanted, list) and not isinstance(value, list):
        return any(matches(value, each) for each in wanted)
    if isinstance(value, list):
        return isinstance(wanted, list) and len(value) == len(wanted) and all(map(matches, value, wanted))
    if isinstance(value, float) and isinstance(wanted, int | float):
        return math.isclose(value, wanted, rel_tol=CLOSE)
    return type(value) is type(wanted) and bool(value == wanted)


def value_at(message: Mapping[str, Any], path: str) -> Any:  # noqa: ANN401
    """Give the value at a path such as ``status.text``, None if there is none."""
    value: Any = message
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
