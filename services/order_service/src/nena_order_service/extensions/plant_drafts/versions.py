"""The plant models that were active: each is kept together with the change that activated it."""

from __future__ import annotations

import asyncio
from typing import Final

from pydantic import ValidationError

from nena_order_service.api.audit import OpenRequest
from nena_order_service.errors import UnknownError
from nena_order_service.extension import Core
from nena_order_service.extensions.plant_drafts.difference import find_differences
from nena_order_service.plant_file import PLANT_MODEL, StoredPlant
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.operations.plant import CHANGE_PLANT
from nena_shared.fleet_api.operations.plant_drafts import ACTIVATE_PLANT_DRAFT
from nena_shared.fleet_api.plant_drafts import (
    PlantDifferences,
    PlantDifferencesQuery,
    PlantVersion,
    PlantVersionList,
)
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel

log = get_logger(__name__)

VERSION: Final = "plantVersion"
"""The kind of the versions' documents in the store, without the models."""
VERSION_MODEL: Final = "plantVersionModel"
VERSIONS_KEPT: Final = 50

# openTCS's hosts lock locations by changes of the plant model: each would be a version
_ACTIVATIONS: Final = {CHANGE_PLANT.name, ACTIVATE_PLANT_DRAFT.name}


class PlantVersions:
    """Keeps and compares the versions of the plant model."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._versions: list[PlantVersion] = []
        """Oldest first."""

    async def load(self, *, at_start: bool) -> None:
        """Restore the versions; ``at_start`` of the program, add a plant model file that is new."""
        documents = await self._core.store.documents(VERSION)
        self._versions = sorted(
            map(PlantVersion.model_validate_json, documents.values()), key=lambda version: version.number
        )
        plant = self._core.engine.plant
        if not at_start or (self._versions and await self._stored_model(self._versions[-1].number) == plant):
            return
        changes = Changes()
        self._add(changes, plant, plant.to_json(), by="", draft="")
        committed = asyncio.Event()
        self._core.store.commit(changes, committed.set)
        await committed.wait()

    def all(self) -> PlantVersionList:
        """Return the versions, newest first."""
        return PlantVersionList(versions=tuple(reversed(self._versions)))

    async def model(self, number: int) -> PlantModel:
        """Return the model of a version, 0: the active one; raises UnknownError."""
        found = await self._stored_model(number) if number else self._core.engine.plant
        if found is None:
            raise UnknownError(Refusal.UNKNOWN_PLANT_DRAFT, number)
        return found

    async def compare(self, name: int, request: PlantDifferencesQuery) -> PlantDifferences:
        """Return what a version changed in the one before, or differs in; raises UnknownError."""
        model = await self.model(name)
        numbers = [version.number for version in self._versions if version.number < name]
        before = request.with_version or (numbers[-1] if numbers else name)
        return await asyncio.to_thread(find_differences, await self.model(before), model)

    def committing(self, request: OpenRequest, changes: Changes) -> None:
        """Keep a plant model that a request activates, in the same commit."""
        document = changes.documents.get((PLANT_MODEL, ""))
        if document is None or request.asked.operation not in _ACTIVATIONS:
            return
        text = StoredPlant.model_validate_json(document).model
        draft = request.name if request.asked.operation == ACTIVATE_PLANT_DRAFT.name else ""
        self._add(changes, PlantModel.from_json(text), text, by=request.asked.origin.user, draft=draft)

    def _add(self, changes: Changes, model: PlantModel, text: str, *, by: str, draft: str) -> None:
        version = PlantVersion(
            number=self._versions[-1].number + 1 if self._versions else 1,
            activated=self._core.clock.now(),
            by=by,
            draft=draft,
            name=model.name,
            points=len(model.points),
            paths=len(model.paths),
            locations=len(model.locations),
        )
        self._versions.append(version)
        changes.documents[VERSION, str(version.number)] = version.model_dump_json(by_alias=True)
        changes.documents[VERSION_MODEL, str(version.number)] = text
        while len(self._versions) > VERSIONS_KEPT:
            oldest = str(self._versions.pop(0).number)
            changes.documents |= {(VERSION, oldest): None, (VERSION_MODEL, oldest): None}

    async def _stored_model(self, number: int) -> PlantModel | None:
        text = await self._core.store.document(VERSION_MODEL, str(number))
        try:
            return await asyncio.to_thread(PlantModel.from_json, text) if text else None
        except ValidationError:
            log.exception("stored version of the plant model is unreadable", version=number)
            return None
