"""Operations on drafts of the plant model, and on the versions that were active; for administrators."""

from __future__ import annotations

from functools import partial
from http import HTTPStatus
from typing import Final

from nena_shared.fleet_api.operations.operation import PLANT_DRAFTS, PLANT_VERSIONS, Operation
from nena_shared.fleet_api.plant import PlantModelChange
from nena_shared.fleet_api.plant_drafts import (
    PlantActivation,
    PlantDifferences,
    PlantDifferencesQuery,
    PlantDraft,
    PlantDraftList,
    PlantDraftMap,
    PlantDraftQuery,
    PlantDraftRequest,
    PlantDraftStatus,
    PlantFileContent,
    PlantFileQuery,
    PlantRun,
    PlantRunQuery,
    PlantRunRequest,
    PlantVersionList,
    SavedPlantDraft,
)
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.plant_terms import MAX_BYTES

_DRAFT: Final = f"{PLANT_DRAFTS}/{{name}}"
_operation = partial(Operation, admin=True, refusals=(Refusal.UNKNOWN_PLANT_DRAFT,))

LIST_PLANT_DRAFTS = Operation(
    "plantDrafts",
    "List the drafts of the plant model, by name.",
    "GET",
    PLANT_DRAFTS,
    PlantDraftList,
    admin=True,
)
SAVE_PLANT_DRAFT = _operation(
    "savePlantDraft",
    "Create a draft, or save it if nobody else has saved it meanwhile; returns what is wrong in it.",
    "PUT",
    _DRAFT,
    SavedPlantDraft,
    request=PlantDraftRequest,
    also={HTTPStatus.CREATED: "Created."},
    max_body=MAX_BYTES,
    refusals=(
        Refusal.INVALID_PLANT,
        Refusal.UNKNOWN_PLANT_DRAFT,
        Refusal.PLANT_DRAFT_CHANGED,
        Refusal.TOO_MANY_PLANT_DRAFTS,
        Refusal.NOT_SAVED,
    ),
)
SHOW_PLANT_DRAFT = _operation(
    "plantDraft",
    "Return a draft with its model, what is wrong in it, and who else has it open.",
    "GET",
    _DRAFT,
    PlantDraft,
    request=PlantDraftQuery,
)
DELETE_PLANT_DRAFT = _operation(
    "deletePlantDraft",
    "Delete a draft.",
    "DELETE",
    _DRAFT,
    PlantDraftStatus,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT, Refusal.NOT_SAVED),
)
COMPARE_PLANT_DRAFT = _operation(
    "plantDraftDifferences",
    "Return what a draft changes: added, removed, moved and otherwise changed objects.",
    "GET",
    f"{_DRAFT}/differences",
    PlantDifferences,
    request=PlantDifferencesQuery,
)
EXPORT_PLANT_DRAFT = _operation(
    "plantDraftFile",
    "Return a draft as a file of NeNa, openTCS, LIF or Nav2, and what the format cannot represent.",
    "GET",
    f"{_DRAFT}/file",
    PlantFileContent,
    request=PlantFileQuery,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT, Refusal.INVALID_PLANT),
)
ACTIVATE_PLANT_DRAFT = _operation(
    "activatePlantDraft",
    "Make a draft the active plant. Refused while orders or vehicles use objects that it lacks.",
    "POST",
    f"{_DRAFT}/activation",
    PlantModelChange,
    request=PlantActivation,
    refusals=(
        Refusal.UNKNOWN_PLANT_DRAFT,
        Refusal.PLANT_DRAFT_CHANGED,
        Refusal.INVALID_PLANT,
        Refusal.PLANT_IN_USE,
        Refusal.NOT_SAVED,
    ),
)
SHOW_PLANT_DRAFT_MAP = _operation(
    "plantDraftMap",
    "Return the robot's map that is kept with a draft.",
    "GET",
    f"{_DRAFT}/map",
    PlantDraftMap,
)
START_PLANT_RUN = _operation(
    "startPlantRun",
    "Keep a robot's map with a draft, propose a plant from it, check the draft with it, or simulate it.",
    "POST",
    f"{_DRAFT}/run",
    PlantRun,
    request=PlantRunRequest,
    max_body=MAX_BYTES,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT, Refusal.PLANT_RUN_GOES_ON),
)
SHOW_PLANT_RUN = _operation(
    "plantRun",
    "Return the last program that ran on any draft, or the last result of one on this draft.",
    "GET",
    f"{_DRAFT}/run",
    PlantRun,
    request=PlantRunQuery,
)
CANCEL_PLANT_RUN = _operation(
    "cancelPlantRun",
    "End the program that runs on a draft; without one, nothing happens.",
    "DELETE",
    f"{_DRAFT}/run",
    PlantRun,
)
LIST_PLANT_VERSIONS = Operation(
    "plantVersions",
    "List the last plant models that were active, newest first.",
    "GET",
    PLANT_VERSIONS,
    PlantVersionList,
    admin=True,
)
COMPARE_PLANT_VERSION = _operation(
    "plantVersionDifferences",
    "Return what a version changed in the one before it, or what differs from another one.",
    "GET",
    f"{PLANT_VERSIONS}/{{name}}/differences",
    PlantDifferences,
    request=PlantDifferencesQuery,
)
