"""Recordings and log reports that robots and the order service send: receive, store, list."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import ClassVar

from fastapi import APIRouter

from nena_shared.metrics import Section, counter
from nena_shared.settings import SettingsGroup
from nena_status_aggregator.extension import Core, Extension
from nena_status_aggregator.extensions.recordings.receiver import RecordingReceiver
from nena_status_aggregator.extensions.recordings.routes import make_router
from nena_status_aggregator.extensions.recordings.store import RecordingSettings, RecordingStore


class Recordings(Extension):
    """Receives recordings over MQTT, and serves ``/api/v1/recordings``."""

    Settings: ClassVar[type[SettingsGroup]] = RecordingSettings

    def __init__(self, settings: RecordingSettings, core: Core) -> None:
        super().__init__(settings, core)
        self.receiver: RecordingReceiver | None = None
        if settings.enabled:
            self.receiver = RecordingReceiver(RecordingStore(settings), core)

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
