"""Headers of a request; Starlette's class searches them several times slower."""

from __future__ import annotations

from starlette.types import Scope


def header_of(scope: Scope, name: bytes) -> str | None:
    """Return the first value of a header, whose ``name`` is in lower case; None: it is missing."""
    for each, value in scope["headers"]:
        if each == name:
            found: bytes = value
            return found.decode("latin-1")
    return None
