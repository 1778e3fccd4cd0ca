"""Recordings of robots, ``/api/v1/recordings``: the list, and the files."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import FileResponse
from typing_extensions import TypedDict

from nena_shared.clock import iso
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import require
from nena_status_aggregator.extensions.recordings.store import RecordingStore

DISABLED = "Recordings are disabled. Set recordings.enabled to true."


class RecordingView(TypedDict):
    """A file of a robot; `received` is the time at which it was complete."""

    robot: str
    name: str
    size: int
    received: str


def make_router(store: RecordingStore | None) -> APIRouter:
    """Create the routes of recordings; None: they are disabled."""
    router = APIRouter(prefix="/api/v1/recordings", tags=["recordings"])

    @router.get("")
    async def recordings(
        robot: Annotated[
            str | None, Query(description="Manufacturer and serial number: `ACME/r1`.", max_length=300)
        ] = None,
    ) -> list[RecordingView]:
        """Return the recordings of all robots or of one, newest first."""
        stored = await asyncio.to_thread(
            require(store, Rejection.RECORDINGS_DISABLED, DISABLED).list_recordings
        )
        return [
            {
                "robot": str(file.robot),
                "name": file.name,
                "size": file.size,
                "received": iso(datetime.fromtimestamp(file.received, UTC)),
            }
            for file in stored
            if robot in (None, str(file.robot))
        ]

    @router.get("/{manufacturer}/{serial}/{name}", response_class=FileResponse)
    async def recording(manufacturer: str, serial: str, name: str) -> FileResponse:
        """Return a file: MCAP, which Foxglove opens, or the text of a log report."""
        robot = RobotKey(manufacturer, serial)
        path = await asyncio.to_thread(
            require(store, Rejection.RECORDINGS_DISABLED, DISABLED).find_file, robot, name
        )
        missing = f"No recording {name} of {robot}; /api/v1/recordings lists all. The oldest are removed."
        is_text = name.endswith(".log")
        media_type = "text/plain; charset=utf-8" if is_text else "application/octet-stream"
        return FileResponse(
            require(path, Rejection.UNKNOWN_RECORDING, missing), media_type=media_type, filename=name
        )

    return router
