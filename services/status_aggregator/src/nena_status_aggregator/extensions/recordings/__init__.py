"""Recordings and log reports that robots and the order service send: receive, store, list."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from pathlib import Path
from typing import ClassVar

from fastapi import APIRouter
from pydantic import Field

from nena_shared.extensions.black_box.settings import LARGEST_FILE
from nena_shared.metrics import Section, counter
from nena_shared.settings import SettingsGroup
from nena_status_aggregator.extension import Core, Extension
from nena_status_aggregator.extensions.recordings.receiver import RecordingReceiver
from nena_status_aggregator.extensions.recordings.routes import make_router
from nena_status_aggregator.extensions.recordings.store import RecordingStore, StoreLimits


class RecordingSettings(SettingsGroup):
    """Recordings and log reports of robots."""

    enabled: bool = Field(default=True, description="Accept recordings of robots.")
    folder: Path = Field(
        Path("nena-recordings"),
        description="Folder of the recordings, with a subfolder per robot; created with the first one.",
    )
    keep: int = Field(500, ge=1, description="Maximum number of files; beyond it, the oldest is removed.")
    keep_per_robot: int = Field(
        50, ge=1, description="Maximum number of files of a robot; beyond it, its oldest is removed."
    )
    keep_bytes: int = Field(
        2 * 1024**3,
        ge=1024**2,
        description="Maximum size of all files, bytes; beyond it, the oldest are removed.",
    )
    file_bytes: int = Field(
        64 * 1024**2,
        ge=1024,
        le=LARGEST_FILE,
        description="Maximum size of a file, bytes; larger ones are refused.",
    )


class Recordings(Extension):
    """Receives recordings over MQTT, and serves ``/api/v1/recordings``."""

    Settings: ClassVar[type[SettingsGroup]] = RecordingSettings

    def __init__(self, settings: RecordingSettings, core: Core) -> None:
        super().__init__(settings, core)
        self.receiver: RecordingReceiver | None = None
        if settings.enabled:
            limits = StoreLimits(
                files=settings.keep,
                robot_files=settings.keep_per_robot,
                total_bytes=settings.keep_bytes,
                file_bytes=settings.file_bytes,
            )
            self.receiver = RecordingReceiver(RecordingStore(settings.folder, limits), core)

    def routers(self) -> Iterable[APIRouter]:
        """Return the routes of recordings."""
        return (make_router(self.receiver.store if self.receiver else None),)

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return the task that stores chunks."""
        return {"recordings": self.receiver.run} if self.receiver else {}

    section: ClassVar[Section[Recordings] | None] = Section(
        "Recordings",
        (
            counter(
                "nena_recordings_received_total",
                "Recordings of robots and of the order service: `stored`, or `refused` because of size, name "
                "or checksum. Absent if `recordings.enabled` is false.",
                lambda s: s.receiver.received if s.receiver else None,
                "outcome",
            ),
            counter(
                "nena_recordings_received_bytes_total",
                "Size of the stored recordings.",
                lambda s: s.receiver.received_bytes if s.receiver else None,
            ),
        ),
    )
