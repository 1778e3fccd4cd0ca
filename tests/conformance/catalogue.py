"""The catalogue of clauses of VDA 5050, in our own words: how each is kept, by version and side."""

from __future__ import annotations

import tomllib
from collections import Counter
from enum import StrEnum
from pathlib import Path
from typing import Final, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from nena_shared.vda5050.versions import CODECS

FOLDER: Final = Path(__file__).parent / "clauses"
VERSIONS: Final = tuple(CODECS)


class Side(StrEnum):
    """Who keeps the clause."""

    ROBOT = "robot"
    FLEET = "fleet"
    BOTH = "both"


class Standing(StrEnum):
    """How far the clause is kept."""

    DONE = "done"
    PARTLY = "partly"
    """What is left out stands in ``reason``."""
    PLANNED = "planned"
    NOT_DONE = "not done"

    @property
    def needs_test(self) -> bool:
        """Whether at least one test has to show it."""
        return self in (Standing.DONE, Standing.PARTLY)


class Clause(BaseModel):
    """A rule of the standard.

    ``id`` is the section of 3.0.0, with a name behind a slash if a section has several rules or sides. ``v2``
    is the section of 2.0 and 2.1, with ``2.1:`` before it if 2.0 has none, empty if neither has one. ``how``
    describes the implementation in every version; ``in_2``, ``in_2_0``, ``in_2_1``, ``in_3``, ``in_3_0_1``
    replace it for a version that differs, the last one also for those after it. A version without a text does
    not have the clause.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str = Field(pattern=r"^\d+(\.\d+)*(/[A-Za-z0-9]+)?$")
    title: str
    v2: str = ""
    side: Side
    how: str = ""
    in_2: str = ""
    in_2_0: str = ""
    in_2_1: str = ""
    in_3: str = ""
    in_3_0_1: str = ""
    standing: Standing = Standing.DONE
    reason: str = ""

    @model_validator(mode="after")
    def _reason_given(self) -> Self:
        if self.standing is not Standing.DONE and not self.reason:
            message = f"clause {self.id} is {self.standing}, and no reason says why"
            raise ValueError(message)
        if not any(self.in_version(version) for version in VERSIONS) and self.standing.needs_test:
            message = f"clause {self.id} does not say how it is kept"
            raise ValueError(message)
        return self

    def in_version(self, version: str) -> str:
        """Return how the clause is implemented in ``version``; empty if the version does not have it."""
        major, minor = version.split(".")[:2]
        if major == "2":
            return getattr(self, f"in_2_{minor}") or self.in_2 or self.how
        return (version != "3.0.0" and self.in_3_0_1) or self.in_3 or self.how

    @property
    def place(self) -> tuple[tuple[int, ...], bool]:
        """Return the sort key of the clause; those of one section keep the catalogue's order."""
        section, _, name = self.id.partition("/")
        return tuple(map(int, section.split("."))), bool(name)


class Chapter(BaseModel):
    """A file of the catalogue."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    clause: tuple[Clause, ...]


class CatalogueError(Exception):
    """The catalogue contradicts itself; the message says where."""


def chapters(folder: Path = FOLDER) -> tuple[Chapter, ...]:
    """Read the catalogue, sorted by file name.

    Raises:
        CatalogueError: an ID occurs twice.
    """
    found = tuple(
        Chapter.model_validate(tomllib.loads(path.read_text())) for path in sorted(folder.glob("*.toml"))
    )
    counted = Counter(each.id for chapter in found for each in chapter.clause)
    if twice := sorted(name for name, count in counted.items() if count > 1):
        message = f"clauses that stand twice in the catalogue: {', '.join(twice)}"
        raise CatalogueError(message)
    return found
