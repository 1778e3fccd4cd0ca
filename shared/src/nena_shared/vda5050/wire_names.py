"""Annotations by which the form of a version writes values under other names, or lacks a field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainSerializer


@dataclass(frozen=True, slots=True, eq=False)
class Reads(BeforeValidator):
    """A validator that translates names of a version into neutral ones, and the names that it accepts."""

    names: Mapping[str, str] = field(default_factory=dict)


def reads(names: Mapping[str, str]) -> Reads:
    """Read the given names as the corresponding neutral ones; other values stay unchanged."""

    def read(value: object) -> object:
        return names.get(value, value) if type(value) is str else value

    return Reads(read, names=names)


def writes(names: Mapping[str, str], of: type[StrEnum] | None = None) -> PlainSerializer:
    """Write the neutral values by the given names, other values unchanged; ``of`` is a closed list."""

    def write(value: str) -> str:
        return names.get(value, str(value))

    words: Any = str if of is None else Literal[tuple(dict.fromkeys(map(write, of)))]
    return PlainSerializer(write, return_type=words, when_used="json")


def always(value: object) -> BeforeValidator:
    """Read any input as ``value``: for a field that the version does not have."""
    return BeforeValidator(lambda _: value)


Absent = Annotated[None, always(None), Field(exclude=True)]
"""An optional field that the version does not have: neither read nor written."""
