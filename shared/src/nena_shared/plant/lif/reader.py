"""Reads LIF 1.0.0: strictly, or leniently with warnings."""

from itertools import chain

from pydantic import ValidationError

from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.errors import PlantModelError, Problem
from nena_shared.plant.json_text import DEFAULT_LIMITS, JsonLimits, parse
from nena_shared.plant.lif import checks
from nena_shared.plant.lif.document import LifFile
from nena_shared.plant.lif.leniency import faults, put_right
from nena_shared.plant.lif.names import Names
from nena_shared.plant.lif.reach import reach_warnings
from nena_shared.plant.lif.to_plant import to_plant
from nena_shared.plant.paused_collector import paused_collector
from nena_shared.plant.reports import ImportReport


def read(data: bytes, *, strict: bool = False, limits: JsonLimits = DEFAULT_LIMITS) -> ImportReport:
    """Read a LIF file into a plant model (mm, with LIF's own rules for each vehicle type beside it).

    What real files get wrong is put right with a warning; with `strict` it is an error. Raises
    PlantModelError with all problems if the file is no LIF 1.0.0, breaks a limit, or if its objects
    contradict each other.
    """
    with paused_collector():
        return _read(data, strict=strict, limits=limits)


def _read(data: bytes, *, strict: bool, limits: JsonLimits) -> ImportReport:
    raw = parse(data, limits)
    findings = (*_departures_of_form(data), *put_right(raw))
    try:
        file = LifFile.model_validate(raw)
    except ValidationError as error:
        raise PlantModelError(faults(error)) from error
    if problems := tuple(checks.errors(file)):
        raise PlantModelError(problems)
    findings = (*findings, *checks.departures(file))
    if strict and findings:
        raise PlantModelError(findings)
    names = Names(node.node_id for layout in file.layouts for node in layout.nodes)
    model = to_plant(file, names)
    if problems := find_errors(model):
        raise PlantModelError(problems)
    others: chain[Problem] = chain(
        names.renamed, checks.remarks(file), reach_warnings(model), find_warnings(model)
    )
    return ImportReport(model, (*findings, *others))


def _departures_of_form(data: bytes) -> tuple[Problem, ...]:
    """Return where the text does not have the types and fields that the schema demands."""
    try:
        LifFile.model_validate_json(data, strict=True)
    except ValidationError as error:
        return faults(error)
    return ()
