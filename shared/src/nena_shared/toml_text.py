"""Reads TOML that comes from outside: whatever is wrong with it has one error."""

from __future__ import annotations

import tomllib
from typing import Any

from nena_shared.misfits import shortened


class NoTomlError(ValueError):
    """A text is no TOML that can be read; says why."""


def parse(text: bytes) -> dict[str, Any]:
    """Give the table that a text holds.

    Raises:
        NoTomlError: it is none.

    """
    try:
        return tomllib.loads(text.decode())
    except RecursionError as error:
        message = "lists or tables are nested too deep"
        raise NoTomlError(message) from error
    except ValueError as error:  # more than the library's own: numbers may be too long, signs no UTF-8
        raise NoTomlError(shortened(str(error))) from error
