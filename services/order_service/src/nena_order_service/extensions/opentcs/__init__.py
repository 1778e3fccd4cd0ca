"""openTCS's web API, for hosts that were written for openTCS."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import AfterValidator, Field
from starlette.types import ASGIApp

from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.opentcs.app import make_app
from nena_order_service.extensions.opentcs.events import ChangeLog, Status
from nena_shared.settings import TopLevelSettings


def _not_our_own(path: str) -> str:
    if path.split("/")[1:2] == ["v1"]:
        raise ValueError("/v1 is used by NeNa's own API")
    return path


class OpenTcsSettings(TopLevelSettings):
    """Where openTCS's web API is served."""

    opentcs_prefix: Annotated[str, AfterValidator(_not_our_own)] = Field(
        "/opentcs",
        pattern=r"^(/[A-Za-z0-9_.-]+)*$",
        description="Path prefix of openTCS's web API, version 1. Empty: not served.",
    )


class OpenTcs(Extension):
    """Serves openTCS's web API below ``opentcs_prefix``."""

    Settings = OpenTcsSettings

    def __init__(self, settings: OpenTcsSettings, core: Core) -> None:
        super().__init__(settings, core)
        self.changes = ChangeLog(core.engine.plant, core.clock)

    async def begin(self, previous: OpenTcs | None) -> None:
        """Go on counting changes, whose numbers hosts know."""
        if previous:
            self.changes.count = previous.changes.count

    def apps(self) -> Mapping[str, ASGIApp]:
        """Return the API by its prefix."""
        prefix = self.settings.opentcs_prefix
        return {prefix: make_app(self.core, self.changes)} if prefix else {}

    def close_streams(self) -> None:
        """End event streams and long polls."""
        self.changes.close()

    def note(self, status: Status) -> None:
        """Note the new version of an object."""
        self.changes.note(status)

    order_changed = sequence_changed = vehicle_changed = job_changed = note
