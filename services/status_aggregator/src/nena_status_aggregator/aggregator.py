"""The parts of one aggregator: model, link to the broker and stream of changes."""

from __future__ import annotations

import asyncio
from secrets import token_hex

from pydantic_core import to_json

from nena_shared.clock import Clock, iso
from nena_status_aggregator.api.events import EventStream
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Instant
from nena_status_aggregator.history.history import History
from nena_status_aggregator.mqtt import FleetLink
from nena_status_aggregator.settings import AggregatorSettings, HistorySettings, Share

LINGER = 30.0
"""Seconds for which changes are still made when the last client has gone: it may only have lost its line."""


class Aggregator:
    """What the program runs and what the API shows; owned by one event loop."""

    def __init__(self, settings: AggregatorSettings, clock: Clock) -> None:
        """Make the parts; nothing is connected or opened yet.

        Raises:
            HistoryError: the history cannot be kept as it is set.

        """
        self.clock = clock
        self.share = Share.read(settings.share)
        self.history = _history(settings.history, clock)
        limits = ModelLimits(
            robots=settings.robots_limit,
            orders=settings.orders_limit,
            silence=settings.silence_limit,
            clock_skew=settings.clock_skew_limit,
            track_distance=settings.history.track_distance if self.history else 0.0,
        )
        self.model = FleetModel(limits, self.history.writer.tell if self.history else lambda _: None)
        self.link = FleetLink(settings, self.model, clock)
        self.events = EventStream(settings.events, epoch=token_hex(4), snapshot=self._snapshot)
        self._interval = settings.events.interval

    def now(self) -> Instant:
        """Read the clock."""
        return Instant.of(self.clock)

    def publish_changes(self) -> None:
        """Bring the conditions up to date, and tell the clients what has changed."""
        self.link.notice()
        delta = self.model.flush(self.now())
        if delta is not None:
            self.events.publish(delta["id"], to_json(delta))

    async def keep_publishing(self) -> None:
        """Publish changes until cancelled; while nobody follows them, only judge, which is far less work.

        What nobody was told then is in the next change or snapshot, whoever asks for it first.
        """
        followed_until = 0.0
        while True:
            now = self.clock.monotonic()
            if self.events.clients:
                followed_until = now + LINGER
            if now < followed_until:
                self.publish_changes()
            else:
                self.link.notice()
                self.model.advance(self.now())
            await asyncio.sleep(self._interval)

    def _snapshot(self) -> tuple[int, bytes]:
        self.publish_changes()
        view = self.model.snapshot()
        return view["id"], to_json({**view, "time": iso(self.clock.now()), "share": str(self.share)})


def _history(settings: HistorySettings, clock: Clock) -> History | None:
    url = settings.location()
    return History(settings, url, clock) if url else None
