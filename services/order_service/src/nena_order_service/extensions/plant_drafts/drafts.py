"""Drafts of the plant model: store them, compare, write and activate them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from datetime import datetime
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from nena_order_service.api.plant import change_of
from nena_order_service.errors import InvalidPlantError, RefusedError, UnknownError
from nena_order_service.extension import Core
from nena_order_service.extensions.plant_drafts.difference import (
    find_closed,
    find_differences,
    find_findings,
    to_findings,
)
from nena_order_service.extensions.plant_drafts.versions import PlantVersions
from nena_order_service.store.database import Changes
from nena_plant_formats import files, lif, nav2_route, opentcs_xml
from nena_plant_formats.exchange import ExportReport
from nena_shared.clock import iso
from nena_shared.findings import in_words
from nena_shared.fleet_api.plant import PlantModelChange
from nena_shared.fleet_api.plant_drafts import (
    PlantActivation,
    PlantDifferences,
    PlantDifferencesQuery,
    PlantDraft,
    PlantDraftList,
    PlantDraftQuery,
    PlantDraftRequest,
    PlantDraftStatus,
    PlantFileContent,
    PlantFileFormat,
    PlantFileQuery,
    PlantFinding,
    PlantProgram,
    SavedPlantDraft,
)
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.plant import PlantModel, PlantModelError

DRAFT: Final = "plantDraft"
"""The kind of drafts' documents in the store, without the models."""
DRAFT_MODEL: Final = "plantDraftModel"
RESULTS: Final = {program: f"plantDraft{program.capitalize()}" for program in PlantProgram}
"""The kinds of what programs leave with a draft: the map, and their last results."""
DRAFTS_LIMIT: Final = 50
"""Maximum number of drafts."""
OPEN_FOR: Final = 20.0
"""Seconds after its last request for which a session counts as open."""

SUFFIXES: Final = {
    PlantFileFormat.NENA: ".json",
    PlantFileFormat.OPENTCS: ".xml",
    PlantFileFormat.LIF: ".lif.json",
    PlantFileFormat.LIF_2_0: ".lif.json",
    PlantFileFormat.NAV2_ROUTE: ".geojson",
}

T = TypeVar("T")


class Drafts:
    """Changes drafts for hosts. Models are read from the store when they are needed."""

    def __init__(self, core: Core, versions: PlantVersions) -> None:
        self._core = core
        self._versions = versions
        self._drafts: dict[str, PlantDraftStatus] = {}
        self._open: dict[tuple[str, str], tuple[str, float]] = {}
        """User and time of the last request, by draft and session."""
        self._one_by_one = asyncio.Lock()
        """Held from the check of a draft's version to the commit of the next one."""

    async def load(self) -> None:
        """Restore the drafts from before a restart."""
        for name, document in (await self._core.store.documents(DRAFT)).items():
            self._drafts[name] = PlantDraftStatus.model_validate_json(document)

    def all(self) -> PlantDraftList:
        """Return all drafts, by name."""
        return PlantDraftList(drafts=tuple(self._drafts[name] for name in sorted(self._drafts)))

    async def show(self, name: str, request: PlantDraftQuery, caller: str) -> PlantDraft:
        """Return a draft, and note that the caller has it open; raises UnknownError."""
        status, now = self.status(name), self._core.clock.monotonic()
        if request.session:
            self._open[name, request.session] = (caller, now)
        self._open = {key: value for key, value in self._open.items() if now - value[1] < OPEN_FOR}
        others = {
            user
            for (draft, session), (user, _) in self._open.items()
            if draft == name != session != request.session
        }
        found: dict[str, Any] = {"editors": tuple(sorted(others))}
        if status.version > request.known or request.vehicle:
            text = await self.text(name)
            model = PlantModel.from_json(text)
            findings = await asyncio.to_thread(find_findings, model)
            if not any(each.is_error for each in findings):
                found["closed"] = tuple(await asyncio.to_thread(find_closed, model, request.vehicle))
            if status.version > request.known:
                found |= {"model": json.loads(text), "findings": findings}
        return PlantDraft(**dict(status), **found)

    async def save(self, name: str, request: PlantDraftRequest, caller: str) -> tuple[SavedPlantDraft, bool]:
        """Create a draft, or save its next version; return it, and whether it is new.

        Raises:
            InvalidPlantError: it is no plant model.
            UnknownError: the draft was deleted, or there is no such version of the plant.
            RefusedError: somebody else has saved it, or no more drafts can be stored.
            StoreNotReadyError: the change may be lost.
        """
        model, findings = await self._read(name, request)
        text = await asyncio.to_thread(_to_text, model)
        async with self._one_by_one:
            if await self._is_repeated(name, request.version, text):
                return SavedPlantDraft(**dict(self._drafts[name]), findings=findings), request.version is None
            self._check_version(name, request.version)
            if name not in self._drafts and len(self._drafts) >= DRAFTS_LIMIT:
                text = f"There are {DRAFTS_LIMIT} drafts already. Delete one of them first."
                raise RefusedError(Refusal.TOO_MANY_PLANT_DRAFTS, text)
            status = PlantDraftStatus(
                name=name,
                version=(request.version or 0) + 1,
                changed=self._core.clock.now(),
                by=caller,
                points=len(model.points),
                paths=len(model.paths),
                locations=len(model.locations),
            )
            map_of = request.map_of if request.version is None else None
            await self._commit(name, status, text, map_of and await self.result(map_of, PlantProgram.MAP))
        return SavedPlantDraft(**dict(status), findings=findings), request.version is None

    async def _is_repeated(self, name: str, version: int | None, text: str) -> bool:
        """Return whether this save was made already: its client has not received the answer."""
        stored = self._drafts.get(name)
        if stored is None or stored.version != (version or 0) + 1:
            return False
        return await self._core.store.document(DRAFT_MODEL, name) == text

    async def delete(self, name: str) -> PlantDraftStatus:
        """Delete a draft, and return what it was; raises UnknownError and StoreNotReadyError."""
        async with self._one_by_one:
            status = self.status(name)
            await self._commit(name, None, None)
        return status

    async def compare(self, name: str, request: PlantDifferencesQuery) -> PlantDifferences:
        """Return what a draft changes; raises UnknownError."""
        model = await self._model(name)
        other = await self._versions.model(request.with_version)
        return await asyncio.to_thread(find_differences, other, model)

    async def export(self, name: str, request: PlantFileQuery) -> PlantFileContent:
        """Return a draft as a file; raises UnknownError, and InvalidPlantError if it has errors."""
        model = await self._model(name)
        _refuse_errors(find_findings(model))
        at = self._core.clock.now()
        report = await asyncio.to_thread(_refused_if_invalid, lambda: _write(model, request, at))
        return PlantFileContent(
            file_name=name + SUFFIXES[request.format],
            content=report.data.decode(),
            losses=tuple(map(str, report.warnings)),
        )

    async def activate(self, name: str, request: PlantActivation) -> PlantModelChange:
        """Make a draft the active plant, or only check whether that is possible.

        Raises:
            UnknownError: no such draft.
            RefusedError: somebody else has saved it.
            InvalidPlantError: it has errors.
            PlantInUseError: orders or vehicles use objects that it lacks.
            StoreNotReadyError: it may not be activated.
        """
        self._check_version(name, request.version)
        model = await self._model(name)
        findings = await asyncio.to_thread(find_findings, model)
        _refuse_errors(findings)
        await self._core.change_plant(model, check_only=request.check_only)
        return change_of(model, map(_line, findings), changed=not request.check_only)

    def describe(self, name: str, changes: Changes) -> dict[str, Any] | None:
        """Return a draft in a few words for the audit trail; None: unknown."""
        if (DRAFT, name) in changes.documents:
            document = changes.documents[DRAFT, name]
            return json.loads(document) if document else {"deleted": True}
        return self._drafts[name].model_dump(mode="json", by_alias=True) if name in self._drafts else None

    def status(self, name: str) -> PlantDraftStatus:
        """Return a draft without its model; raises UnknownError."""
        if name not in self._drafts:
            raise UnknownError(Refusal.UNKNOWN_PLANT_DRAFT, name)
        return self._drafts[name]

    def _check_version(self, name: str, version: int | None) -> None:
        stored = self._drafts.get(name)
        if stored is None and version is not None:
            raise UnknownError(Refusal.UNKNOWN_PLANT_DRAFT, name)
        if stored and stored.version != version:
            raise RefusedError(
                Refusal.PLANT_DRAFT_CHANGED,
                f"{stored.by} saved version {stored.version} of the draft {name!r} at {iso(stored.changed)}; "
                "nothing was changed. Open that version, or save yours under another name.",
            )

    async def text(self, name: str) -> str:
        """Return the model of a draft in NeNa's JSON; raises UnknownError."""
        self.status(name)
        found = await self._core.store.document(DRAFT_MODEL, name)
        if found is None:  # deleted meanwhile
            raise UnknownError(Refusal.UNKNOWN_PLANT_DRAFT, name)
        return found

    async def result(self, name: str, program: PlantProgram) -> str | None:
        """Return what a program has left with a draft, in JSON."""
        return await self._core.store.document(RESULTS[program], name)

    async def keep(self, name: str, program: PlantProgram, document: str) -> None:
        """Keep what a program leaves with a draft; raises UnknownError."""
        async with self._one_by_one:
            self.status(name)
            changes = Changes(documents={(RESULTS[program], name): document})
            await self._core.engine.unit_of_work.commit(changes, lambda: None)

    async def _model(self, name: str) -> PlantModel:
        return await asyncio.to_thread(PlantModel.from_json, await self.text(name))

    async def _read(
        self, name: str, request: PlantDraftRequest
    ) -> tuple[PlantModel, tuple[PlantFinding, ...]]:
        """Return the model that a request contains, and what is wrong in it."""
        if request.file is not None:
            data = request.file.encode()
            report = await asyncio.to_thread(_refused_if_invalid, lambda: files.read(data))
            errors = (each for each in find_findings(report.model) if each.is_error)
            return report.model, (*errors, *to_findings(report.warnings))
        if request.from_version is not None:
            model = await self._versions.model(request.from_version)
        else:
            content = {"name": name} if request.model is None else request.model
            model = await asyncio.to_thread(_refused_if_invalid, lambda: PlantModel.model_validate(content))
        return model, await asyncio.to_thread(find_findings, model)

    async def _commit(
        self, name: str, status: PlantDraftStatus | None, text: str | None, robot_map: str | None = None
    ) -> None:
        document = status.model_dump_json(by_alias=True) if status else None
        changes = Changes(documents={(DRAFT, name): document, (DRAFT_MODEL, name): text})
        if status is None:
            changes.documents |= dict.fromkeys((kind, name) for kind in RESULTS.values())
        elif robot_map is not None:
            changes.documents[RESULTS[PlantProgram.MAP], name] = robot_map

        def show() -> None:
            if status:
                self._drafts[name] = status
            else:
                del self._drafts[name]

        await self._core.engine.unit_of_work.commit(changes, show)


def _to_text(model: PlantModel) -> str:
    # Most values are the default: a tenth of the text, which a browser sends at each save.
    return model.model_dump_json(by_alias=True, exclude_none=True, exclude_defaults=True)


def _refused_if_invalid(read: Callable[[], T]) -> T:
    """Return what ``read`` returns; raises InvalidPlantError for its errors."""
    try:
        return read()
    except PlantModelError as error:
        raise InvalidPlantError([str(problem) for problem in error.problems]) from error
    except ValidationError as error:
        details = error.errors(include_url=False, include_context=False, include_input=False)
        raise InvalidPlantError(in_words(details, whole="the model", most=10)) from error


def _refuse_errors(findings: tuple[PlantFinding, ...]) -> None:
    if errors := [_line(each) for each in findings if each.is_error]:
        raise InvalidPlantError(errors)


def _line(finding: PlantFinding) -> str:
    of_which = f" {finding.name!r}" if finding.name else ""
    return f"{finding.kind}{of_which}: {finding.text} [{finding.code}]"


def _write(model: PlantModel, request: PlantFileQuery, at: datetime) -> ExportReport:
    match request.format:
        case PlantFileFormat.NENA:
            return ExportReport(model.to_json().encode() + b"\n", ())
        case PlantFileFormat.OPENTCS:
            return opentcs_xml.write(model)
        case PlantFileFormat.NAV2_ROUTE:
            return nav2_route.write(model, map_id=request.map_id)
        case PlantFileFormat.LIF | PlantFileFormat.LIF_2_0:
            version = lif.LifVersion.V1_0 if request.format is PlantFileFormat.LIF else lif.LifVersion.V2_0
            return lif.write(model, version, at=at, map_id=request.map_id)
