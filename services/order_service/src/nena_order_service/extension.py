"""What an extension of the order service is, adds and gets; see docs/extensions.md.

An extension is installed under the entry point group ``nena.order_service``. The order service creates each
one with its own parts, again when these are rebuilt from the store (for another plant model, or after an
internal error), and imports none of them itself.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, ClassVar, Final, Self

from fastapi import APIRouter
from pydantic import BaseModel
from starlette.types import ASGIApp

from nena_order_service.api.audit import OpenRequest
from nena_order_service.api.hosts import HostServices
from nena_order_service.api.operations import Handler
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.link import FleetLink
from nena_order_service.fleet.outputs import FleetOutput, Publish
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from nena_shared import extensions
from nena_shared.clock import Clock
from nena_shared.fleet_api.audit import AuditResult
from nena_shared.fleet_api.peripherals import PeripheralJobStatus
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import OrderSequenceStatus, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.metrics import Section
from nena_shared.mqtt import MqttLink
from nena_shared.plant import PlantModel
from nena_shared.settings import NoSettings
from nena_shared.tasks import report_failure
from nena_shared.vda5050.topics import Topic

GROUP: Final = "nena.order_service"

EVENTS: Final = (
    "order_changed",
    "sequence_changed",
    "vehicle_changed",
    "job_changed",
    "request_begun",
    "request_ended",
    "peripheral_changed",
    "begun",
    "published",
    "happened",
)
"""What extensions hear of, by the names of their methods."""

EditPlant = Callable[[PlantModel], PlantModel]
"""Returns the changed plant model; the same object if nothing changes."""


@dataclass(frozen=True, slots=True)
class Core:
    """What the order service gives its extensions."""

    clock: Clock
    store: Store
    """Its ``documents`` belong to a kind each; an extension takes a kind of its own."""
    engine: Engine
    """Orders, sequences, vehicles and the plant model; changes them in a unit of work."""
    fleet: FleetLink
    """The robots and their VDA 5050 orders."""
    hosts: HostServices
    """The operations of hosts, by nouns."""
    mqtt: MqttLink
    topics: FleetTopics
    """NeNa's own topics."""
    change_plant: Callable[..., Awaitable[None]]
    """Replaces the plant model, or edits it by an ``EditPlant``, which rebuilds the order service.

    With ``check_only=True`` it only raises what stands against it.
    """


class Extension:
    """A part of the order service; every method may be left as it is.

    All of it runs in the event loop: what blocks belongs in ``asyncio.to_thread``.
    """

    Settings: ClassVar[type[BaseModel]] = NoSettings
    """Its group of settings: ``[NAME]`` in the file, ``--NAME.FIELD`` on the command line."""

    section: ClassVar[Section[Any] | None] = None
    """Its metrics, read from the extension at each scrape, and shown in docs/metrics.md."""

    def __init__(self, settings: Any, core: Core) -> None:  # noqa: ANN401 - of the class's own Settings
        """Prepare the extension; nothing is connected or restored yet, and it may never begin.

        Raises:
            ConfigurationError: its settings are invalid.
        """
        self.settings = settings
        self.core = core

    @classmethod
    def check(cls, settings: Any) -> None:  # noqa: ANN401 - of the class's own Settings
        """Check what else would end the program at its start, also that of a standby.

        A standby that noticed it only at a takeover would leave the fleet without an order service.

        Raises:
            ConfigurationError: its settings are invalid, or a library is missing.
        """

    async def begin(self, previous: Self | None) -> None:
        """Restore what it needs, before anything runs.

        ``previous``: the same extension before the order service was rebuilt, which has ended.
        """

    def handlers(self) -> Iterable[Handler]:
        """Return what executes its operations of hosts, over REST and MQTT."""
        return ()

    def routers(self) -> Iterable[APIRouter]:
        """Return other routes below ``/v1/``: viewers may read, operators change."""
        return ()

    def apps(self) -> Mapping[str, ASGIApp]:
        """Return applications by the path below which they answer, with the same access control."""
        return {}

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return functions that run, by name, while this order service leads the fleet.

        One that returns or fails is started again.
        """
        return {}

    def close_streams(self) -> None:
        """End answers that would go on, such as event streams."""

    async def end(self) -> None:
        """Send or write what is pending; no host is answered any more."""

    async def close(self) -> None:
        """Close what went on with each rebuilt order service: the program ends."""

    # Each change, once it is committed

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Handle the new version of a transport order."""

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Handle the new version of an order sequence."""

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Handle the new status of a vehicle."""

    def job_changed(self, status: PeripheralJobStatus) -> None:
        """Handle the new version of a peripheral job."""

    def peripheral_changed(self, location: str) -> None:
        """Handle a change of a peripheral device or of its jobs."""

    # Each request of a host that changes something

    def request_begun(self, request: OpenRequest) -> None:
        """Handle a request that is about to be executed."""

    def committing(self, request: OpenRequest, changes: Changes) -> None:
        """Add to the changes of a request, which are then committed together; if it fails, they are not."""

    def request_ended(self, request: OpenRequest, result: AuditResult, reason: str) -> None:
        """Handle the end of a request."""

    # What happens between fleet control and the robots; ``now`` is monotonic, s

    def begun(self, order_id: str, now: float, *, restored: bool) -> None:
        """Handle a VDA 5050 order that is to be sent, or was ``restored`` after a restart."""

    def published(self, topic: Topic, output: Publish, now: float) -> None:
        """Handle a message to a robot."""

    def happened(self, event: FleetOutput, now: float) -> None:
        """Handle an event of a robot, such as the end of its VDA 5050 order."""


class Listeners(Extension):
    """Tells extensions what happens; one that fails holds up neither the fleet nor other extensions."""

    def __init__(self, listeners: Sequence[Extension]) -> None:
        self._listeners = listeners
        for name in EVENTS:
            # Only those that override the method: some events occur with each state of each robot.
            own = [ext for ext in listeners if getattr(type(ext), name) is not getattr(Extension, name)]
            setattr(self, name, partial(_tell_all, [getattr(ext, name) for ext in own]))

    def committing(self, request: OpenRequest, changes: Changes) -> None:
        """Let extensions add to the changes: none is committed without its row in the audit trail."""
        for extension in self._listeners:
            extension.committing(request, changes)


def _tell_all(handlers: Sequence[Callable[..., None]], *values: object, **options: object) -> None:
    for handle in handlers:
        try:
            handle(*values, **options)
        except Exception as error:  # noqa: BLE001 - it is reported
            report_failure("an extension failed", error, handler=handle.__qualname__)


@cache
def installed() -> Mapping[str, type[Extension]]:
    """Return the installed extensions by name; raises as :func:`nena_shared.extensions.installed`."""
    return extensions.installed(GROUP, Extension)
