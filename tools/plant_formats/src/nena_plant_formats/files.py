"""Read plant models of any supported format, detected by content."""

from enum import StrEnum
from typing import Final

from pydantic import ValidationError

from nena_plant_formats import lif, opentcs_xml
from nena_plant_formats.exchange import ImportReport, check_size, parse_json
from nena_shared.findings import in_words
from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.model import PlantModel

# RFC 8259, 8.1: writers must not add one, but readers may ignore it.
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class PlantFormat(StrEnum):
    """Formats of plant models."""

    OPENTCS = "opentcs"
    LIF = "lif"
    NENA = "nena"
    """NeNa's own JSON: lossless."""


def format_of(data: bytes) -> PlantFormat:
    """Return the format of a file; anything that is not JSON counts as XML. Raises PlantModelError."""
    if not _json_bytes(data).startswith((b"{", b"[")):
        return PlantFormat.OPENTCS
    content = parse_json(_json_bytes(data))
    # One of them is enough: then the reader of LIF names what is missing.
    return PlantFormat.LIF if isinstance(content, dict) and _LIF & content.keys() else PlantFormat.NENA


_LIF: Final = frozenset({"metaInformation", "layouts", "origins"})
"""Fields of LIF files; NeNa's JSON has none of them."""


def read(data: bytes, *, strict: bool = False) -> ImportReport:
    """Read a plant model; `strict` rejects LIF that deviates from its standard. Raises PlantModelError."""
    match format_of(data):
        case PlantFormat.OPENTCS:
            return opentcs_xml.read(data)
        case PlantFormat.LIF:
            return lif.read(_json_bytes(data), strict=strict)
        case PlantFormat.NENA:
            return read_nena(_json_bytes(data))


def read_nena(data: bytes) -> ImportReport:
    """Read the output of `PlantModel.to_json`. Raises PlantModelError."""
    # pydantic parses it, without the limits of parse_json.
    check_size(data)
    try:
        model = PlantModel.from_json(data)
    except ValidationError as error:
        raise PlantModelError(_problems_of(error)) from error
    if errors := find_errors(model):
        raise PlantModelError(errors)
    return ImportReport(model, find_warnings(model))


def _json_bytes(data: bytes) -> bytes:
    return data.removeprefix(_BYTE_ORDER_MARK).lstrip()


def _problems_of(error: ValidationError) -> tuple[PlantProblem, ...]:
    details = error.errors(include_url=False, include_context=False, include_input=False)
    return tuple(
        PlantProblem("BAD_VALUE", ObjectKind.MODEL, "", word) for word in in_words(details, whole="the model")
    )
