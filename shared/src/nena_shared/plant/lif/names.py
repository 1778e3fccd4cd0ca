"""Names over all kinds of object, of ids that are unique for their own kind only."""

from collections.abc import Iterable
from itertools import count

from nena_shared.plant.errors import ObjectKind, Problem


class Names:
    """Gives each object a name of its own; `renamed` says which could not be called by their ids."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = set(taken)
        self.renamed: list[Problem] = []

    def take(self, kind: ObjectKind, wanted: str, prefix: str) -> str:
        """Return the wanted name if nobody has it, else one with the prefix, and keep it."""
        name = wanted
        if name in self._taken:
            tries = (f"{prefix}{'' if number == 1 else number}:{wanted}" for number in count(1))
            name = next(each for each in tries if each not in self._taken)
            text = f"something else has this id; it is called {name!r}"
            self.renamed.append(Problem("RENAMED", kind, wanted, text))
        self._taken.add(name)
        return name
