"""Annotations for forms in which values have other names or fields are missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainSerializer


@dataclass(frozen=True, slots=True, eq=False)
class Reads(BeforeValidator):
    """A validator that translates a version's names to neutral ones; ``names`` lists those it accepts."""

    names: Mapping[str, str] = field(default_factory=dict)


def reads(names: Mapping[str, str]) -> Reads:
    """Translate these names to neutral ones when reading; other values stay unchanged."""

    def read(value: object) -> object:
        return names.get(value, value) if type(value) is str else value

    return Reads(read, names=names)


def writes(names: Mapping[str, str], of: type[StrEnum] | None = None) -> PlainSerializer:
    """Translate neutral values to these names when writing; ``of``: the enumeration of a closed list."""

    def write(value: str) -> str:
        return names.get(value, str(value))

    words: Any = str if of is None else Literal[tuple(dict.fromkeys(map(write, of)))]
    return PlainSerializer(write, return_type=words, when_used="json")


def always(value: object) -> BeforeValidator:
    """Replace any input with ``value``, for a field that the version does not have."""
    return BeforeValidator(lambda _: value)


Absent = Annotated[None, always(None), Field(exclude=True)]
"""An optional field that the version does not have; neither read nor written."""
