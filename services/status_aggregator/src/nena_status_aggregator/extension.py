"""What an extension of the status aggregator is, adds and gets; see docs/extensions.md.

An extension is installed under the entry point group ``nena.status_aggregator``. The aggregator creates each
one once, before it connects, and imports none of them itself.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

from fastapi import APIRouter
from pydantic import BaseModel

from nena_shared import extensions
from nena_shared.clock import Clock
from nena_shared.fleet_api.attention import Matter, MatterChange
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.metrics import Section
from nena_shared.mqtt import Inbound, Outbound
from nena_shared.settings import NoSettings
from nena_status_aggregator.fleet.events import Event
from nena_status_aggregator.history.history import History
from nena_status_aggregator.settings import Share

GROUP = "nena.status_aggregator"


@dataclass(frozen=True, slots=True)
class Core:
    """What the aggregator gives its extensions."""

    clock: Clock
    topics: FleetTopics
    """NeNa's own topics."""
    share: Share
    """The robots that this aggregator monitors."""
    history: History | None
    """None: it is disabled."""
    subscribe: Callable[[str, Callable[[Inbound], None]], None]
    """Pass the messages of a topic filter to a function; only while the extension is created."""
    publish: Callable[[Outbound], None]


class Extension:
    """A part of the aggregator; every method may be left as it is.

    All of it runs in the event loop: what blocks belongs in ``asyncio.to_thread``.
    """

    Settings: ClassVar[type[BaseModel]] = NoSettings
    """Its group of settings: ``[NAME]`` in the file, ``--NAME.FIELD`` on the command line."""

    section: ClassVar[Section[Any] | None] = None
    """Its metrics, read from the extension at each scrape, and shown in docs/metrics.md."""

    def __init__(self, settings: Any, core: Core) -> None:  # noqa: ANN401 - of the class's own Settings
        """Prepare the extension; nothing is connected yet.

        Raises:
            ConfigurationError: its settings are invalid.
            StartError: it cannot start.
        """
        self.settings = settings
        self.core = core

    def routers(self) -> Iterable[APIRouter]:
        """Return routes below ``/api/``: viewers may read, operators change."""
        return ()

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return functions that run as long as the program, by name; one that fails is started again."""
        return {}

    def on_event(self, event: Event) -> None:
        """Handle an event of a robot or an order, such as a failed order (``fleet/events.py``)."""

    def on_matter(self, change: MatterChange, matter: Matter) -> None:
        """Handle that something needs a person, was acknowledged, or has ended."""


@cache
def installed() -> Mapping[str, type[Extension]]:
    """Return the installed extensions by name; raises as :func:`nena_shared.extensions.installed`."""
    return extensions.installed(GROUP, Extension)
