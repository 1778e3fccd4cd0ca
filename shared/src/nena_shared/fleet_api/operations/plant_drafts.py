"""Operations on drafts of the plant model, and on the versions that were active; for administrators."""

from __future__ import annotations

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
    PlantRunRequest,
    PlantVersionList,
    SavedPlantDraft,
)
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.plant_terms import MAX_BYTES

_DRAFT: Final = f"{PLANT_DRAFTS}/{{name}}"

LIST_PLANT_DRAFTS = Operation(
    "plantDrafts",
    "List the drafts of the plant model, by name.",
    "GET",
    PLANT_DRAFTS,
    PlantDraftList,
    admin=True,
)
SAVE_PLANT_DRAFT = Operation(
    "savePlantDraft",
    "Create a draft, or save it if nobody else has saved it meanwhile; returns what is wrong in it.",
    "PUT",
    _DRAFT,
    SavedPlantDraft,
    admin=True,
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
SHOW_PLANT_DRAFT = Operation(
    "plantDraft",
    "Return a draft with its model, what is wrong in it, and who else has it open.",
    "GET",
    _DRAFT,
    PlantDraft,
    admin=True,
    request=PlantDraftQuery,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT,),
)
DELETE_PLANT_DRAFT = Operation(
    "deletePlantDraft",
    "Delete a draft.",
    "DELETE",
    _DRAFT,
    PlantDraftStatus,
    admin=True,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT, Refusal.NOT_SAVED),
)
COMPARE_PLANT_DRAFT = Operation(
    "plantDraftDifferences",
    "Return what a draft changes: added, removed, moved and otherwise changed objects.",
    "GET",
    f"{_DRAFT}/differences",
    PlantDifferences,
    admin=True,
    request=PlantDifferencesQuery,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT,),
)
EXPORT_PLANT_DRAFT = Operation(
    "plantDraftFile",
    "Return a draft as a file of NeNa, openTCS, LIF or Nav2, and what the format cannot represent.",
    "GET",
    f"{_DRAFT}/file",
    PlantFileContent,
    admin=True,
    request=PlantFileQuery,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT, Refusal.INVALID_PLANT),
)
ACTIVATE_PLANT_DRAFT = Operation(
    "activatePlantDraft",
    "Make a draft the active plant. Refused while orders or vehicles use objects that it lacks.",
    "POST",
    f"{_DRAFT}/activation",
    PlantModelChange,
    admin=True,
    request=PlantActivation,
    refusals=(
        Refusal.UNKNOWN_PLANT_DRAFT,
        Refusal.PLANT_DRAFT_CHANGED,
        Refusal.INVALID_PLANT,
        Refusal.PLANT_IN_USE,
        Refusal.NOT_SAVED,
    ),
)
SHOW_PLANT_DRAFT_MAP = Operation(
    "plantDraftMap",
    "Return the robot's map that is kept with a draft.",
    "GET",
    f"{_DRAFT}/map",
    PlantDraftMap,
    admin=True,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT,),
)
START_PLANT_RUN = Operation(
    "startPlantRun",
    "Keep a robot's map with a draft, propose a plant from it, check the draft with it, or simulate it.",
    "POST",
    f"{_DRAFT}/run",
    PlantRun,
    admin=True,
    request=PlantRunRequest,
    max_body=MAX_BYTES,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT, Refusal.PLANT_RUN_GOES_ON),
)
SHOW_PLANT_RUN = Operation(
    "plantRun",
    "Return the last program that ran on any draft, with its result.",
    "GET",
    f"{_DRAFT}/run",
    PlantRun,
    admin=True,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT,),
)
CANCEL_PLANT_RUN = Operation(
    "cancelPlantRun",
    "End the program that runs on a draft; without one, nothing happens.",
    "DELETE",
    f"{_DRAFT}/run",
    PlantRun,
    admin=True,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT,),
)
LIST_PLANT_VERSIONS = Operation(
    "plantVersions",
    "List the last plant models that were active, newest first.",
    "GET",
    PLANT_VERSIONS,
    PlantVersionList,
    admin=True,
)
COMPARE_PLANT_VERSION = Operation(
    "plantVersionDifferences",
    "Return what a version changed in the one before it, or what differs from another one.",
    "GET",
    f"{PLANT_VERSIONS}/{{name}}/differences",
    PlantDifferences,
    admin=True,
    request=PlantDifferencesQuery,
    refusals=(Refusal.UNKNOWN_PLANT_DRAFT,),
)
