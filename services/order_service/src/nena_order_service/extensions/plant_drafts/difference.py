"""What differs between two plant models, and what is wrong in one: without I/O."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from math import hypot
from typing import Any, Final

from nena_order_service.routing.graph import Access, RoutingProfile
from nena_shared.fleet_api.plant_drafts import DifferenceKind, PlantDifference, PlantDifferences, PlantFinding
from nena_shared.plant import ObjectKind, PlantModel, PlantProblem
from nena_shared.plant.advice import find_advice
from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.fleet_checks import find_fleet_errors
from nena_shared.plant.track import MM_PER_M

DIFFERENCES_SHOWN: Final = 1000

_PLACE: Final = ("x_mm", "y_mm")


def find_differences(old: PlantModel, new: PlantModel) -> PlantDifferences:
    """Return what differs in ``new``, by kind, in the order of the models."""
    kinds = (
        (ObjectKind.POINT, old.points_by_name, new.points_by_name),
        (ObjectKind.PATH, old.paths_by_name, new.paths_by_name),
        (ObjectKind.LOCATION_TYPE, old.location_types_by_name, new.location_types_by_name),
        (ObjectKind.LOCATION, old.locations_by_name, new.locations_by_name),
        (ObjectKind.BLOCK, old.blocks_by_name, new.blocks_by_name),
        (ObjectKind.VEHICLE, old.vehicles_by_name, new.vehicles_by_name),
    )
    found = list(chain.from_iterable(_of_kind(*each) for each in kinds))
    own = tuple(name for name in ("name", "properties") if getattr(old, name) != getattr(new, name))
    if own:
        changed = DifferenceKind.CHANGED
        found.append(PlantDifference(change=changed, kind=ObjectKind.MODEL, name=new.name, fields=own))
    return PlantDifferences(
        differences=tuple(found[:DIFFERENCES_SHOWN]), more=max(0, len(found) - DIFFERENCES_SHOWN)
    )


def _of_kind(kind: ObjectKind, old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[PlantDifference]:
    for name, thing in new.items():
        if name not in old:
            yield PlantDifference(change=DifferenceKind.ADDED, kind=kind, name=name)
        elif (before := old[name]) != thing:
            yield _difference(kind, before, thing)
    for name in old:
        if name not in new:
            yield PlantDifference(change=DifferenceKind.REMOVED, kind=kind, name=name)


def _difference(kind: ObjectKind, old: Any, new: Any) -> PlantDifference:  # noqa: ANN401 - of any kind
    fields = {
        name: field.alias or name
        for name, field in type(new).model_fields.items()
        if getattr(old, name) != getattr(new, name)
    }
    moved = any(name in fields for name in _PLACE)
    return PlantDifference(
        change=DifferenceKind.MOVED if moved else DifferenceKind.CHANGED,
        kind=kind,
        name=new.name,
        distance=hypot(new.x_mm - old.x_mm, new.y_mm - old.y_mm) / MM_PER_M if moved else None,
        fields=tuple(alias for name, alias in fields.items() if name not in _PLACE),
    )


def find_findings(model: PlantModel) -> tuple[PlantFinding, ...]:
    """Return all that ``nena plant check`` says, errors first."""
    errors = find_errors(model)
    # warnings look up what a name refers to
    warnings = () if errors else (*find_warnings(model), *find_advice(model))
    return (*to_findings((*errors, *find_fleet_errors(model)), are_errors=True), *to_findings(warnings))


def find_closed(model: PlantModel, vehicle: str) -> Iterator[PlantFinding]:
    """Yield the paths of a model without errors that a vehicle must not use; none of an unknown vehicle."""
    found = model.vehicles_by_name.get(vehicle)
    access = Access(model, RoutingProfile.of(found, model.vehicle_types))
    for edge in model.edges() if found else ():
        if why := access.why_closed(edge):
            (path,) = to_findings([PlantProblem(why.code.name, ObjectKind.PATH, edge.path.name, str(why))])
            yield path.model_copy(update={"coded_reason": why.coded})


def to_findings(problems: Iterable[PlantProblem], *, are_errors: bool = False) -> Iterator[PlantFinding]:
    """Yield problems as findings."""
    for each in problems:
        yield PlantFinding(
            code=each.code, kind=each.kind, name=each.name, text=each.text, is_error=are_errors
        )
