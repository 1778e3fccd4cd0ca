"""The black box of the order service: its decisions of the last minutes, as files."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, ClassVar, Final

from pydantic import Field

from nena_order_service.api.operations import Handler
from nena_order_service.errors import RefusedError
from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.black_box.recorder import DecisionRecorder
from nena_order_service.fleet.outputs import FleetOutput, Publish
from nena_shared.clock import Clock
from nena_shared.extensions.black_box.box import BlackBox, Source, check_library, outgoing_of
from nena_shared.extensions.black_box.metrics import recording_metrics
from nena_shared.extensions.black_box.settings import OutgoingSettings, RingSettings
from nena_shared.fleet_api.operations.fleet import FETCH_RECORDING
from nena_shared.fleet_api.recordings import RecordingAnswer
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.topics import ORDER_SERVICE, FleetTopics
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.metrics import Section
from nena_shared.settings import TopLevelSettings
from nena_shared.vda5050.topics import Topic

DISTRIBUTION: Final = "nena-order-service"


class BlackBoxSettings(TopLevelSettings):
    """The black box, and where its files go."""

    black_box: RingSettings = Field(
        default_factory=RingSettings, description="Decisions of the last minutes; needs the extra `blackbox`."
    )
    upload: OutgoingSettings = Field(
        default_factory=OutgoingSettings,
        description="Files of the black box, and their transfer to the status aggregator.",
    )


class DecisionBox(Extension):
    """Records decisions if ``black_box.enabled`` is set, and serves requests for recordings."""

    Settings = BlackBoxSettings

    def __init__(self, settings: BlackBoxSettings, core: Core) -> None:
        """Create an empty black box; raises ConfigurationError if a library or the home folder is missing."""
        super().__init__(settings, core)
        self.box = make_black_box(settings, core.topics, core.clock)
        self.recorder: DecisionRecorder | None = None

    @classmethod
    def check(cls, settings: BlackBoxSettings) -> None:
        """Check that files can be written."""
        if settings.black_box.enabled:
            check_library(DISTRIBUTION)

    async def begin(self, previous: DecisionBox | None) -> None:
        """Go on with what was recorded before."""
        if previous:
            self.box = previous.box
        if self.box:
            view = self.core.fleet.view
            self.recorder = DecisionRecorder(self.box, self.core.clock, lambda robot: view(robot).state)
            if uploader := self.box.outgoing.uploader:
                uploader.attach(self.core.mqtt)

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return what writes files after failures, and what sends them."""
        if self.box is None:
            return {}
        uploader = self.box.outgoing.uploader
        return {"black box": self.box.run} | ({"recordings": uploader.run} if uploader else {})

    def handlers(self) -> Iterable[Handler]:
        """Return what writes a recording on request."""
        return (Handler(FETCH_RECORDING, lambda: request_recording(self.box)),)

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Record what has happened to an order."""
        if self.recorder:
            self.recorder.order_changed(status)

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Record what a vehicle waits for."""
        if self.recorder:
            self.recorder.vehicle_changed(status)

    def published(self, topic: Topic, output: Publish, now: float) -> None:  # noqa: ARG002 - monotonic
        """Record a message to a robot."""
        if self.recorder:
            self.recorder.published(topic, output)

    def happened(self, event: FleetOutput, now: float) -> None:  # noqa: ARG002
        """Record an event of a robot."""
        if self.recorder:
            self.recorder.happened(event)

    section: ClassVar[Section[Any]] = Section(
        "Recordings", recording_metrics(lambda s: s.box.outgoing.counts if s.box else None)
    )


def make_black_box(settings: BlackBoxSettings, topics: FleetTopics, clock: Clock) -> BlackBox | None:
    """Return the black box; None if it is disabled.

    Raises:
        ConfigurationError: the extra ``blackbox`` is not installed, or there is no home directory.
    """
    if not settings.black_box.enabled:
        return None
    # 0061: below the topics of robots, so that aggregator, panel and nena list its files like theirs.
    outgoing = outgoing_of(settings.upload, ORDER_SERVICE, topics)
    return BlackBox(Source(ORDER_SERVICE, DISTRIBUTION), settings.black_box, outgoing, clock)


async def request_recording(box: BlackBox | None) -> RecordingAnswer:
    """Write the decisions of the last minutes to a file.

    Raises:
        RefusedError: it is disabled, or the disk fails.
    """
    if box is None:
        text = "Recording is off. Set black_box.enabled and restart the order service."
        raise RefusedError(Refusal.NO_BLACK_BOX, text)
    try:
        name = await box.request()
    except OSError as error:
        text = f"The recording was not written: {error}. Check the disk and upload.folder."
        raise RefusedError(Refusal.RECORDING_NOT_WRITTEN, text) from error
    return RecordingAnswer(robot=str(ORDER_SERVICE), name=name, sent=box.outgoing.uploader is not None)
