"""Common parts of plant model importers and exporters: reports, and bounded JSON parsing."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, get_args

from pydantic import BaseModel
from pydantic_core import from_json

from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.model import PlantModel
from nena_shared.plant_terms import MAX_BYTES
from nena_shared.vda5050.malformed import QUOTE, quoted


@dataclass(frozen=True, slots=True)
class JsonLimits:
    """Limits of a JSON text."""

    size_bytes: int = MAX_BYTES
    values: int = 8_000_000
    """Counted before parsing: characters that start or separate values, also inside strings."""


JSON_LIMITS: Final = JsonLimits()


def parse_json(data: bytes, limits: JsonLimits = JSON_LIMITS) -> Any:  # noqa: ANN401 - anything that JSON holds
    """Parse JSON within limits. Raises PlantModelError with one problem."""
    check_size(data, limits)
    try:
        # RFC 8259, 6: JSON has neither NaN nor infinity, although many parsers accept them.
        return from_json(data, allow_inf_nan=False)
    except ValueError as error:
        # jiter has no error of its own for its 200 levels (0014), only this text.
        code = "LIMIT_EXCEEDED" if "recursion limit" in str(error) else "MALFORMED_JSON"
        raise refusal(code, f"invalid JSON: {error}") from error


def repeated_keys(data: bytes) -> Counter[str]:
    """Return the keys that some JSON object has more than once, with the number of objects."""
    found: Counter[str] = Counter()

    def note(pairs: list[tuple[str, object]]) -> None:
        found.update(key for key, times in Counter(key for key, _ in pairs).items() if times > 1)

    # numbers stay texts: Python refuses those of more than 4,300 digits
    json.loads(data, object_pairs_hook=note, parse_int=str)
    return found


def check_size(data: bytes, limits: JsonLimits = JSON_LIMITS) -> None:
    """Raise PlantModelError if the text exceeds the limits."""
    if len(data) > limits.size_bytes:
        raise refusal("LIMIT_EXCEEDED", f"the file has {len(data)} bytes; the limit is {limits.size_bytes}")
    # 0014: before parsing, which turns three bytes (`[],`) into a list of 56.
    if sum(map(data.count, (b",", b"[", b"{"))) > limits.values:
        raise refusal("LIMIT_EXCEEDED", f"the file has more than {limits.values} values")


def records_in(raw: Any, form: type[BaseModel]) -> Iterator[tuple[dict[str, Any], type[BaseModel]]]:  # noqa: ANN401 - whatever the JSON holds
    """Yield each JSON object that the form has a record for, with its record, outer objects first.

    What the caller changes in an object counts for the objects in it.
    """
    waiting: list[tuple[Any, type[BaseModel]]] = [(raw, form)]
    while waiting:
        value, record = waiting.pop()
        if isinstance(value, list):
            waiting.extend((each, record) for each in value)
        elif isinstance(value, dict):
            yield value, record
            inner = _inner_records(record)
            waiting.extend((value[key], inner[key]) for key in inner.keys() & value.keys())


@cache
def _inner_records(record: type[BaseModel]) -> Mapping[str, type[BaseModel]]:
    return {
        field.alias or "": part
        for field in record.model_fields.values()
        for part in parts_of(field.annotation)
        if isinstance(part, type) and issubclass(part, BaseModel)
    }


def parts_of(annotation: Any) -> tuple[Any, ...]:  # noqa: ANN401 - any annotation of a field
    """Return an annotation and all that it consists of: `X | None` is also X and None."""
    return (annotation, *(part for each in get_args(annotation) for part in parts_of(each)))


def refusal(code: str, text: str) -> PlantModelError:
    """Return the error for a file that cannot be read."""
    return PlantModelError([PlantProblem(code, ObjectKind.MODEL, "", text)])


@dataclass(frozen=True, slots=True)
class ImportReport:
    """A valid plant model with warnings for its author."""

    model: PlantModel
    warnings: tuple[PlantProblem, ...]


@dataclass(frozen=True, slots=True)
class ExportReport:
    """Content of a file, with warnings about what its format cannot represent."""

    data: bytes
    warnings: tuple[PlantProblem, ...]


def with_received(text: str, finding: Any) -> str:  # noqa: ANN401 - pydantic's own type says less
    """Return the text of one of pydantic's errors with the received value; a missing one has none."""
    return text if finding["type"] == "missing" else f"{text}{QUOTE}{quoted(finding['input'])})"
