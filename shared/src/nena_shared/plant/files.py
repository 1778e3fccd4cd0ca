"""Reads a plant model from a file of any format, told by its content."""

from enum import StrEnum

from pydantic import ValidationError

from nena_shared.misfits import in_words
from nena_shared.plant import lif, opentcs_xml
from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.errors import ObjectKind, PlantModelError, Problem
from nena_shared.plant.exchange import ImportReport, check_size, parse_json, paused_collector
from nena_shared.plant.model import PlantModel

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class PlantFormat(StrEnum):
    """The formats of plant models."""

    OPENTCS = "opentcs"
    LIF = "lif"
    NENA = "nena"
    """JSON, all that NeNa knows of a plant."""


def format_of(data: bytes) -> PlantFormat:
    """Return the format of a file; what is no JSON is taken for XML. Raises PlantModelError."""
    if not _json(data).startswith((b"{", b"[")):
        return PlantFormat.OPENTCS
    content = parse_json(_json(data))
    return PlantFormat.LIF if isinstance(content, dict) and "layouts" in content else PlantFormat.NENA


def read(data: bytes, *, strict: bool = False) -> ImportReport:
    """Read a plant model; `strict` refuses LIF that does not keep to its standard. Raises PlantModelError."""
    match format_of(data):
        case PlantFormat.OPENTCS:
            return opentcs_xml.read(data)
        case PlantFormat.LIF:
            return lif.read(_json(data), strict=strict)
        case PlantFormat.NENA:
            return read_nena(_json(data))


def read_nena(data: bytes) -> ImportReport:
    """Read what `PlantModel.to_json` wrote. Raises PlantModelError."""
    check_size(data)
    try:
        with paused_collector():
            model = PlantModel.from_json(data)
    except ValidationError as error:
        raise PlantModelError(_problems(error)) from error
    if errors := find_errors(model):
        raise PlantModelError(errors)
    return ImportReport(model, find_warnings(model))


def _json(data: bytes) -> bytes:
    return data.removeprefix(_BYTE_ORDER_MARK).lstrip()


def _problems(error: ValidationError) -> tuple[Problem, ...]:
    details = error.errors(include_url=False, include_context=False, include_input=False)
    return tuple(
        Problem("BAD_VALUE", ObjectKind.MODEL, "", each) for each in in_words(details, whole="the model")
    )
