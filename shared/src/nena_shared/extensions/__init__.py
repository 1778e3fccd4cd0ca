"""Extensions of a service: parts that it loads by entry point, and that its core never imports.

An extension is a class whose ``Settings`` are a group of the service's settings, named as the entry point.
Each service defines its own base class, which says what an extension adds and gets: see docs/extensions.md.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any, TypeVar

from nena_shared.settings import HasSettings
from nena_shared.tasks import StartError

E = TypeVar("E", bound=HasSettings)


def installed(group: str, base: type[E]) -> dict[str, type[E]]:
    """Return the extensions of a group of entry points, by name.

    Raises:
        StartError: one of them cannot be loaded, or is of another class.
    """
    found: dict[str, type[E]] = {}
    for entry in sorted(entry_points(group=group), key=lambda each: each.name):
        try:
            extension: Any = entry.load()
        # loading runs the extension's module, which may raise anything
        except Exception as error:
            raise StartError(
                f"the extension {entry.name!r} ({entry.value}) cannot be loaded: {error}"
            ) from error
        if not (isinstance(extension, type) and issubclass(extension, base)):
            raise StartError(
                f"the extension {entry.name!r} ({entry.value}) is no {base.__module__}.{base.__name__}"
            )
        found[entry.name] = extension
    return found
