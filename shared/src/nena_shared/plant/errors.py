"""Problems of plant models as data, and exceptions."""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum


class ObjectKind(StrEnum):
    """Kinds of objects of a plant model."""

    MODEL = "model"
    POINT = "point"
    PATH = "path"
    LOCATION_TYPE = "location type"
    LOCATION = "location"
    BLOCK = "block"
    VEHICLE = "vehicle"
    VISUAL_LAYOUT = "visual layout"
    RESOURCE = "point, path or location"
    """Unknown name that may be any of these kinds."""


@dataclass(frozen=True, slots=True)
class PlantProblem:
    """A finding: a stable code, the object, and a text that explains it."""

    code: str
    kind: ObjectKind
    name: str
    text: str

    def __str__(self) -> str:
        of_which = f" {self.name!r}" if self.name else ""
        return f"{self.kind}{of_which}: {self.text} [{self.code}]"


class PlantModelError(ValueError):
    """The plant model is invalid; `problems` has all findings."""

    def __init__(self, problems: Iterable[PlantProblem]) -> None:
        self.problems = tuple(problems)
        lines = "\n".join(f"  {problem}" for problem in self.problems)
        super().__init__(f"The plant model has {len(self.problems)} error(s):\n{lines}")


class UnknownObjectError(LookupError):
    """The plant model has no object of this name; `suggestions` are similar names."""

    def __init__(self, kind: ObjectKind, name: str, known: Iterable[str] = ()) -> None:
        self.kind = kind
        self.name = name
        self.suggestions = tuple(get_close_matches(name, list(known), n=3))
        hint = f" Did you mean {' or '.join(map(repr, self.suggestions))}?" if self.suggestions else ""
        super().__init__(f"The plant model has no {kind} {name!r}.{hint}")
