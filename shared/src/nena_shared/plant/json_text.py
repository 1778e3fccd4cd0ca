"""Reads JSON that comes from outside, within limits."""

from dataclasses import dataclass
from typing import Any, Final

from pydantic_core import from_json

from nena_shared.plant.errors import ObjectKind, PlantModelError, Problem

MAX_DEPTH: Final = 200
"""Objects and arrays within each other; the parser itself refuses more."""


@dataclass(frozen=True, slots=True)
class JsonLimits:
    """What a text may hold at most."""

    size_bytes: int = 64 * 1024 * 1024
    values: int = 8_000_000
    """Counted before anything is built: signs that begin or part values, also inside of strings."""


DEFAULT_LIMITS: Final = JsonLimits()


def parse(data: bytes, limits: JsonLimits = DEFAULT_LIMITS) -> Any:  # noqa: ANN401 - anything that JSON holds
    """Return what the text holds; raises PlantModelError with one problem if it cannot be had."""
    check_size(data, limits)
    try:
        return from_json(data, allow_inf_nan=False)
    except ValueError as error:
        code = "LIMIT_EXCEEDED" if "recursion limit" in str(error) else "MALFORMED_JSON"
        raise refusal(code, f"this is no JSON that can be read: {error}") from error


def check_size(data: bytes, limits: JsonLimits = DEFAULT_LIMITS) -> None:
    """Raise PlantModelError for a text that would take too much memory."""
    if len(data) > limits.size_bytes:
        raise refusal("LIMIT_EXCEEDED", f"the file has {len(data)} bytes, more than {limits.size_bytes}")
    if sum(map(data.count, (b",", b"[", b"{"))) > limits.values:
        raise refusal("LIMIT_EXCEEDED", f"there are more than {limits.values} values")


def refusal(code: str, text: str) -> PlantModelError:
    """Return the error for a file that cannot be read at all."""
    return PlantModelError([Problem(code, ObjectKind.MODEL, "", text)])
