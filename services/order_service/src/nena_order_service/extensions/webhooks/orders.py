"""Changed orders as messages of a web hook.

A web hook stores the number of the last change that its receiver has, like a client of the event stream. It
reads what changed since then from the store: nothing queues in memory, a restart or takeover continues where
the last one ended, and an order that changed several times meanwhile is sent once, in its present state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from datetime import datetime
from typing import ClassVar, Final
from urllib.parse import urlsplit

from pydantic import Field

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from nena_shared.clock import Clock
from nena_shared.extensions.webhooks import Message, Webhook, WebhookSettings, id_of
from nena_shared.fleet_api.transport_order import TransportOrderState, TransportOrderStatus
from nena_shared.fleet_api.webhooks import WebhookAttempt, WebhookStatus

KIND: Final = "webhook"
"""The kind of a web hook's document in the store, which contains its change number."""
PAGE: Final = 50
"""Number of changed orders read from the store at a time."""
ATTEMPTS_KEPT: Final = 20


class OrderWebhookSettings(WebhookSettings):
    """A web hook: a URL that receives changed orders."""

    states: tuple[TransportOrderState, ...] = Field(
        (), description="Send only orders in these states. Empty: every change of an order."
    )


class OrderWebhook(Webhook):
    """Delivers the changed orders of a store."""

    not_ready: ClassVar[tuple[type[Exception], ...]] = (StoreNotReadyError,)

    def __init__(self, settings: OrderWebhookSettings, store: Store, clock: Clock) -> None:
        """Create it; raises ConfigurationError if its secret is unusable."""
        super().__init__(settings, clock)
        self._states = settings.states
        self._store = store
        self._attempts: deque[WebhookAttempt] = deque(maxlen=ATTEMPTS_KEPT)
        self._known = 0
        """Number of the last change that is done: delivered, given up, or not wanted."""
        self._stored = -1

    @property
    def status(self) -> WebhookStatus:
        """The web hook as hosts see it."""
        # User, password and query of a URL may be the receiver's secrets.
        url = urlsplit(str(self.settings.url))
        return WebhookStatus(
            name=self.settings.name,
            url=f"{url.scheme}://{url.netloc.rpartition('@')[2]}{url.path}",
            state=self._state,
            reason=self._reason,
            next_attempt=self._next_attempt,
            delivered=self.delivered,
            dropped=self.dropped,
            attempts=tuple(reversed(self._attempts)),
        )

    async def begin(self) -> None:
        """Continue where the last run ended; a new web hook begins with the present."""
        stored = (await self._store.documents(KIND)).get(self.settings.name, "")
        last = self._store.numbers.last
        # A number that the store has not reached would hold back everything until then.
        if stored.isdecimal() and int(stored) <= last:
            self._known = self._stored = int(stored)
        else:
            self._known = last
            self._store_progress()

    async def read(self) -> Sequence[Message]:
        """Return the orders that have changed since the last one that is done."""
        page = await self._store.read_changes_after(self._known, PAGE)
        return [self._message_of(number, order.status) for number, order in page]

    def _message_of(self, number: int, order: TransportOrderStatus) -> Message:
        changed = order.history[-1].timestamp if order.history else order.created
        wanted = not self._states or order.state in self._states
        return Message(number, f"transportOrder.{order.state}", order.name, changed, order, wanted=wanted)

    def note_done(self, message: Message) -> None:
        """Store the progress."""
        self._known = message.number
        # Few unwanted ones are read again after a restart: cheaper than a commit for each.
        if message.wanted or message.number - self._stored >= PAGE:
            self._store_progress()

    def note_attempt(
        self, message: Message, body: bytes, time: datetime, result: str, *, delivered: bool
    ) -> None:
        """Keep it for the status."""
        assert isinstance(message.data, TransportOrderStatus)  # noqa: S101 - for the type
        self._attempts.append(
            WebhookAttempt(
                timestamp=time,
                message=id_of(body),
                transport_order=message.subject,
                state=message.data.state,
                result=result,
                delivered=delivered,
            )
        )

    def _store_progress(self) -> None:
        self._stored, changes = self._known, Changes()
        changes.documents[KIND, self.settings.name] = str(self._known)
        self._store.commit(changes, lambda: None)
