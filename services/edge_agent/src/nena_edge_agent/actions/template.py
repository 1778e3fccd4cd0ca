"""Fields of a message with the parameters of an action in them, as settings give them.

The whole rule: ``{name}`` stands for a value. A text that is nothing but ``{name}`` becomes the value itself,
whatever its type; in a longer text the value is written out. ``{{`` and ``}}`` are braces. There is nothing
to call, to look into or to format, so that no order can do more than fill in its values.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from typing import Final

from pydantic import JsonValue

_PART: Final = re.compile(r"\{\{|\}\}|\{(?P<name>[A-Za-z_][A-Za-z0-9_]*)\}|(?P<lone>[{}])")
_WHOLE: Final = re.compile(r"\{([A-Za-z_][A-Za-z0-9_]*)\}")


def whole(text: str) -> str | None:
    """Give the name that the text is nothing but, None if there is more to it."""
    found = _WHOLE.fullmatch(text)
    return found.group(1) if found else None


def problems(template: JsonValue, names: Collection[str], path: str) -> Iterator[str]:
    """Say what is wrong with a template whose values have ``names``, each with its place under ``path``."""
    match template:
        case str():
            yield from (f"{path}: {each}" for each in _text_problems(template, names))
        case dict():
            for key, value in template.items():
                yield from problems(value, names, f"{path}.{key}")
        case list():
            for number, value in enumerate(template):
                yield from problems(value, names, f"{path}.{number}")


def filled(template: JsonValue, values: Mapping[str, JsonValue]) -> JsonValue:
    """Put ``values`` in; one that was not given (None) leaves its field out, in a longer text it is empty."""
    match template:
        case str():
            name = whole(template)
            return values.get(name) if name else _PART.sub(lambda found: _written(found, values), template)
        case dict():
            parts = {key: filled(value, values) for key, value in template.items()}
            return {key: value for key, value in parts.items() if value is not None}
        case list():
            items = (filled(each, values) for each in template)
            return [each for each in items if each is not None]
        case _:
            return template


def _text_problems(text: str, names: Collection[str]) -> Iterator[str]:
    for found in _PART.finditer(text):
        name = found.group("name")
        if found.group("lone"):
            brace = found.group()
            yield f"a lone '{brace}' in '{text}'; write {{name}} for a value, '{brace * 2}' for a brace"
        elif name and name not in names:
            yield f"there is no parameter '{name}'; there are {', '.join(sorted(names))}"


def _written(found: re.Match[str], values: Mapping[str, JsonValue]) -> str:
    name = found.group("name")
    if not name:
        return found.group()[0]
    value = values.get(name)
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else str(value)
