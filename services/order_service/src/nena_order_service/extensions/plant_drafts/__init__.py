"""Drafts of the plant model, as the panel's page *Plant* draws them, and the versions that were active."""

from __future__ import annotations

from collections.abc import Iterator

from nena_order_service.api.audit import OpenRequest
from nena_order_service.api.operations import Handler
from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.plant_drafts.drafts import Drafts
from nena_order_service.extensions.plant_drafts.runs import Runs
from nena_order_service.extensions.plant_drafts.versions import PlantVersions
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.operations import plant_drafts as table

EXAMPLE = {
    "version": 3,
    "model": {
        "name": "hall",
        "points": [{"name": "P1", "xMm": 0, "yMm": 0}, {"name": "P2", "xMm": 4000, "yMm": 0}],
        "paths": [{"name": "P1 --- P2", "source": "P1", "destination": "P2", "lengthMm": 4000}],
    },
}


class PlantDrafts(Extension):
    """Serves ``/v1/plantDrafts`` and ``/v1/plantVersions``."""

    def __init__(self, settings: object, core: Core) -> None:
        super().__init__(settings, core)
        self.versions = PlantVersions(core)
        self.drafts = Drafts(core, self.versions)
        self.runs = Runs(core, self.drafts)

    async def begin(self, previous: PlantDrafts | None) -> None:
        """Restore the drafts and versions."""
        await self.drafts.load()
        await self.versions.load(at_start=previous is None)

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        drafts, runs, versions, state = self.drafts, self.runs, self.versions, self.drafts.describe
        yield Handler(table.LIST_PLANT_DRAFTS, drafts.all)
        yield Handler(table.SAVE_PLANT_DRAFT, drafts.save, EXAMPLE, state=state)
        yield Handler(table.SHOW_PLANT_DRAFT, drafts.show)
        yield Handler(table.DELETE_PLANT_DRAFT, drafts.delete, state=state)
        yield Handler(table.COMPARE_PLANT_DRAFT, drafts.compare)
        yield Handler(table.EXPORT_PLANT_DRAFT, drafts.export)
        yield Handler(table.ACTIVATE_PLANT_DRAFT, drafts.activate, {"version": 3}, state=state)
        yield Handler(table.SHOW_PLANT_DRAFT_MAP, runs.map)
        yield Handler(table.START_PLANT_RUN, runs.start, {"program": "PROPOSE"}, state=state)
        yield Handler(table.SHOW_PLANT_RUN, runs.show)
        yield Handler(table.CANCEL_PLANT_RUN, runs.cancel, state=state)
        yield Handler(table.LIST_PLANT_VERSIONS, versions.all)
        yield Handler(table.COMPARE_PLANT_VERSION, versions.compare)

    async def end(self) -> None:
        """End the program that runs on a draft."""
        await self.runs.end()

    def committing(self, request: OpenRequest, changes: Changes) -> None:
        """Keep a plant model that a request activates."""
        self.versions.committing(request, changes)
