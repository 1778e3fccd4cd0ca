"""What importers and exporters of plant models share: reports, and bounded reading of JSON."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from pydantic_core import from_json

from nena_shared.plant.errors import ObjectKind, PlantModelError, Problem
from nena_shared.plant.model import PlantModel

MAX_DEPTH: Final = 200
"""Objects and arrays within each other; the parser itself refuses more."""


@dataclass(frozen=True, slots=True)
class JsonLimits:
    """What a text may hold at most."""

    size_bytes: int = 64 * 1024 * 1024
    values: int = 8_000_000
    """Counted before anything is built: signs that begin or part values, also inside of strings."""


JSON_LIMITS: Final = JsonLimits()


def parse_json(data: bytes, limits: JsonLimits = JSON_LIMITS) -> Any:  # noqa: ANN401 - anything that JSON holds
    """Return what the text holds; raises PlantModelError with one problem if it cannot be had."""
    check_size(data, limits)
    try:
        return from_json(data, allow_inf_nan=False)
    except ValueError as error:
        code = "LIMIT_EXCEEDED" if "recursion limit" in str(error) else "MALFORMED_JSON"
        raise refusal(code, f"this is no JSON that can be read: {error}") from error


def check_size(data: bytes, limits: JsonLimits = JSON_LIMITS) -> None:
    """Raise PlantModelError for a text that would take too much memory."""
    if len(data) > limits.size_bytes:
        raise refusal("LIMIT_EXCEEDED", f"the file has {len(data)} bytes, more than {limits.size_bytes}")
    if sum(map(data.count, (b",", b"[", b"{"))) > limits.values:
        raise refusal("LIMIT_EXCEEDED", f"there are more than {limits.values} values")


def refusal(code: str, text: str) -> PlantModelError:
    """Return the error for a file that cannot be read at all."""
    return PlantModelError([Problem(code, ObjectKind.MODEL, "", text)])


@contextmanager
def paused_collector() -> Iterator[None]:
    """Keep the collector from running.

    A model is made of some hundred thousand objects that all stay and have no cycles; the collector would go
    through them again and again, which takes a third of the time of loading a large plant.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


@dataclass(frozen=True, slots=True)
class ImportReport:
    """A plant model that can be used, and what its author should know about it."""

    model: PlantModel
    warnings: tuple[Problem, ...]


@dataclass(frozen=True, slots=True)
class ExportReport:
    """A file's content, and what of the model the file's format cannot hold."""

    data: bytes
    warnings: tuple[Problem, ...]
