"""Read plant models of any supported format, detected by content."""

import json
from collections import Counter
from dataclasses import replace
from enum import StrEnum
from typing import Final

from pydantic import ValidationError

from nena_plant_formats import lif, nav2_route, opentcs_xml
from nena_plant_formats.exchange import (
    ImportReport,
    parse_json,
    records_in,
    refusal,
    repeated_keys,
    with_received,
)
from nena_plant_formats.other_files import name_of
from nena_shared.findings import in_words, letters_of
from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.model import PlantModel

# RFC 8259, 8.1: writers must not add one, but readers may ignore it.
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class PlantFormat(StrEnum):
    """Formats of plant models."""

    OPENTCS = "opentcs"
    LIF = "lif"
    NAV2_ROUTE = "nav2-route"
    """Nav2's route graph (GeoJSON)."""
    NENA = "nena"
    """NeNa's own JSON: lossless."""


def format_of(data: bytes) -> PlantFormat:
    """Return the format of a plant model; a text of no known form counts as XML. Raises PlantModelError."""
    text = _json_bytes(data)
    content, malformed = None, None
    try:
        content = parse_json(text) if text.startswith((b"{", b"[")) else None
    except PlantModelError as error:
        malformed = error
    # One of them is enough: then the reader of LIF names what is missing.
    if isinstance(content, dict) and _LIF & set(map(letters_of, content)):
        return PlantFormat.LIF
    if isinstance(content, dict) and "features" in content:
        return PlantFormat.NAV2_ROUTE
    if other := name_of(text, content, _NENA):
        other += (
            ". A plant model is openTCS XML, LIF, a route graph of Nav2 or NeNa's JSON (docs/plant-models.md)"
        )
        raise refusal("NOT_A_PLANT_MODEL", f"this is {other}") from malformed
    if malformed:
        raise malformed
    return PlantFormat.OPENTCS if content is None else PlantFormat.NENA


_LIF: Final = frozenset({"metainformation", "layouts", "origins"})
"""Fields of LIF files, in small letters; NeNa's JSON has none of them."""
_NENA: Final = {field.alias or "" for field in PlantModel.model_fields.values()} - {"name", "properties"}
"""Fields of NeNa's JSON, without those of much other JSON."""


def read(data: bytes, *, strict: bool = False) -> ImportReport:
    """Read a plant model; `strict` rejects LIF that deviates from its standard. Raises PlantModelError."""
    form = format_of(data)
    if form is PlantFormat.OPENTCS:
        return opentcs_xml.read(data.lstrip())
    text = _json_bytes(data)
    if form is PlantFormat.LIF:
        report = lif.read(text, strict=strict)
    else:
        report = _read_route_graph(text) if form is PlantFormat.NAV2_ROUTE else read_nena(text)
    repeated = (
        PlantProblem(
            "REPEATED_KEY",
            ObjectKind.MODEL,
            "",
            f"the key {key!r} stands more than once in an object (found {count} times); the last one counts",
        )
        for key, count in sorted(repeated_keys(text).items())
    )
    return replace(report, warnings=(*repeated, *report.warnings))


def _read_route_graph(data: bytes) -> ImportReport:
    content, losses = nav2_route.to_nena(parse_json(data))
    report = read_nena(json.dumps(content).encode())
    return replace(report, warnings=(*losses, *report.warnings))


def read_nena(data: bytes) -> ImportReport:
    """Read the output of `PlantModel.to_json`. Raises PlantModelError."""
    content = parse_json(data)
    try:
        model = PlantModel.from_json(data)
    except ValidationError as error:
        raise PlantModelError(_problems_of(error)) from error
    if errors := find_errors(model):
        raise PlantModelError(errors)
    unknown = Counter(
        key
        for each, record in records_in(content, PlantModel)
        for key in each.keys()
        - {field.alias for field in record.model_fields.values()}
        - record.model_fields.keys()
    )
    ignored = (
        PlantProblem(
            "IGNORED", ObjectKind.MODEL, "", f"unknown field {key!r} is ignored (found {times} times)"
        )
        for key, times in sorted(unknown.items())
    )
    return ImportReport(model, (*ignored, *find_warnings(model)))


def _json_bytes(data: bytes) -> bytes:
    return data.removeprefix(_BYTE_ORDER_MARK).lstrip()


def _problems_of(error: ValidationError) -> tuple[PlantProblem, ...]:
    details = error.errors(include_url=False, include_context=False)
    words = map(with_received, in_words(details, whole="the model"), details)
    return tuple(PlantProblem("BAD_VALUE", ObjectKind.MODEL, "", word) for word in words)
