"""What can be wrong with a plant model, as data."""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum


class ObjectKind(StrEnum):
    """The kinds of object of a plant model."""

    MODEL = "model"
    POINT = "point"
    PATH = "path"
    LOCATION_TYPE = "location type"
    LOCATION = "location"
    BLOCK = "block"
    VEHICLE = "vehicle"
    VISUAL_LAYOUT = "visual layout"
    RESOURCE = "point, path or location"
    """Of which of these kinds an unknown name was meant to be is open."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One finding: what was found (a stable code), on which object, and a sentence that says what to do."""

    code: str
    kind: ObjectKind
    name: str
    text: str

    def __str__(self) -> str:
        of_which = f" {self.name!r}" if self.name else ""
        return f"{self.kind}{of_which}: {self.text} [{self.code}]"


class PlantModelError(ValueError):
    """A plant model that cannot be used; `problems` holds every finding, not just the first."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        lines = "\n".join(f"  {problem}" for problem in self.problems)
        super().__init__(f"The plant model has {len(self.problems)} error(s):\n{lines}")


class UnknownObjectError(LookupError):
    """A name that the plant model does not have; `suggestions` are the names most like it."""

    def __init__(self, kind: ObjectKind, name: str, known: Iterable[str] = ()) -> None:
        self.kind = kind
        self.name = name
        self.suggestions = tuple(get_close_matches(name, list(known), n=3))
        hint = f" Did you mean {' or '.join(map(repr, self.suggestions))}?" if self.suggestions else ""
        super().__init__(f"The plant model has no {kind} {name!r}.{hint}")
