"""The status aggregator: fleet model, MQTT subscriptions, event stream and history."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from secrets import token_hex
from types import MappingProxyType

from pydantic_core import to_json

from nena_shared.certificates import Certificates
from nena_shared.clock import Clock, iso
from nena_shared.fleet_api.attention import Matter, MatterChange
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.loop_lag import LoopLag
from nena_shared.settings import settings_of
from nena_status_aggregator.api.events import EventStream
from nena_status_aggregator.direct_stops import DirectStops
from nena_status_aggregator.extension import Core, Extension
from nena_status_aggregator.fleet.events import Event
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Timestamp
from nena_status_aggregator.history.history import History
from nena_status_aggregator.kept_acknowledgements import KeptAcknowledgements
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings, Share

log = get_logger(__name__)

IDLE_DELAY = 30.0
"""Time for which changes are still published after the last client has left, as it may reconnect, seconds."""


@contextmanager
def _failure_of(extension: Extension, what: str) -> Iterator[None]:
    """Log an exception: the fleet is shown whatever an extension does."""
    try:
        yield
    except Exception:
        log.exception("an extension failed", extension=type(extension).__name__, what=what)


class Aggregator:
    """Owns the parts that the program runs and the API reads. Not thread-safe."""

    def __init__(
        self,
        settings: AggregatorSettings,
        clock: Clock,
        extensions: Mapping[str, type[Extension]] = MappingProxyType({}),
    ) -> None:
        """Create the parts and the extensions; nothing is connected or opened yet.

        Raises:
            HistoryError: the history settings are invalid.
            ConfigurationError: those of an extension are.
        """
        self.clock = clock
        self.share = Share.read(settings.share)
        url = settings.history.location()
        self.history = History(settings.history, url, clock) if url else None
        limits = ModelLimits(
            robots=settings.robots_limit,
            orders=settings.orders_limit,
            open_orders=settings.open_orders_limit,
            silence=settings.silence_limit,
            clock_skew=settings.clock_skew_limit,
            track_distance=settings.history.track_distance if self.history else 0.0,
            jam=settings.jam,
        )
        self.model = FleetModel(limits, self._on_event, self._on_matter)
        self.link = FleetSubscriber(settings, self.model, clock)
        topics = FleetTopics(settings.topic_prefix)
        self.direct_stops = DirectStops(self.link.mqtt, self.model, topics, clock)
        kept = topics.acknowledgements(str(self.share))
        self.acknowledgements = KeptAcknowledgements(self.link.mqtt, self.model.attention, kept, clock)
        core = Core(
            clock=clock,
            topics=topics,
            share=self.share,
            history=self.history,
            subscribe=partial(self.link.mqtt.subscribe, needed=False),
            publish=self.link.mqtt.publish,
        )
        self.extensions = [
            extension(settings_of(settings, name, extension), core) for name, extension in extensions.items()
        ]
        self.events = EventStream(settings.events, epoch=token_hex(4), snapshot=self._fleet_snapshot)
        self.loop_lag = LoopLag(clock)
        self.certificates = Certificates(settings.http.tls_certificate, settings.mqtt.tls.certificate)
        self._interval = settings.events.interval

    def _on_event(self, event: Event) -> None:
        if self.history:
            self.history.writer.add(event)
        for extension in self.extensions:
            with _failure_of(extension, event.code):
                extension.on_event(event)

    def _on_matter(self, change: MatterChange, matter: Matter) -> None:
        for extension in self.extensions:
            with _failure_of(extension, matter.id):
                extension.on_matter(change, matter)

    def now(self) -> Timestamp:
        """Return the current time."""
        return Timestamp.of(self.clock)

    def publish_changes(self) -> None:
        """Update the conditions and publish all changes to the clients of the event stream."""
        self.link.report_connection()
        delta = self.model.flush(self.now())
        if delta is not None:
            self.events.publish(delta["id"], to_json(delta))

    async def keep_publishing(self) -> None:
        """Publish changes until cancelled.

        Without clients only the conditions are updated, which is much cheaper; the changes are part of the
        next delta or snapshot.
        """
        followed_until = 0.0
        while True:
            time_s = self.clock.monotonic()
            self.link.read_postponed()
            self.link.report_limits()
            self.direct_stops.pause_and_release()
            self.acknowledgements.keep()
            if self.events.clients:
                followed_until = time_s + IDLE_DELAY
            if time_s < followed_until:
                self.publish_changes()
            else:
                self.link.report_connection()
                self.model.update_conditions(self.now())
            await asyncio.sleep(self._interval)

    def _fleet_snapshot(self) -> tuple[int, bytes]:
        self.publish_changes()
        view = self.model.snapshot()
        return view["id"], to_json({**view, "time": iso(self.clock.now()), "share": str(self.share)})
