"""Web hooks: send changed orders to URLs of hosts, by the scheme of Standard Webhooks (1.0).

A web hook stores the number of the last change that its receiver has, like a client of the event stream. It
reads what changed since then from the store: nothing queues in memory, a restart or takeover continues where
the last one ended, and an order that changed several times meanwhile is sent once, in its present state.
Each web hook has its own task: a receiver that is away delays nobody else.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import hashlib
import hmac
import json
from collections import deque
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from typing import Final
from urllib.parse import urlsplit

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.settings import WebhookSettings
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.webhooks import WebhookAttempt, WebhookState, WebhookStatus
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError, secret_in

log = get_logger(__name__)

KIND: Final = "webhook"
"""The kind of a web hook's document in the store, which contains its change number."""
PAGE: Final = 50
"""Number of changed orders read from the store at a time."""
ATTEMPTS_KEPT: Final = 20
SECRET_PREFIX: Final = "whsec_"  # noqa: S105 - precedes secrets
SECRET_BYTES: Final = range(24, 65)
ANSWER_SECONDS: Final = 15.0
"""Timeout of one attempt, seconds."""
PAUSES: Final = (1.0, 5.0, 15.0, 60.0, 300.0)
"""Delays between attempts, seconds; the last one repeats."""
POLL_SECONDS: Final = 30.0
"""Interval at which the store is read even if no change was published, seconds."""
GONE: Final = 410
SUCCESSES: Final = range(200, 300)

Send = Callable[[str, Mapping[str, str], bytes], Awaitable[int]]
"""Sends a body to a URL and returns the status of the answer; raises OSError if there is none."""


def read_secret(settings: WebhookSettings) -> bytes:
    """Return the key of a web hook; raises ConfigurationError."""
    where = f"webhooks.{settings.name}.secret_file"
    text = secret_in(settings.secret_file, where)
    try:
        secret = base64.b64decode(text.removeprefix(SECRET_PREFIX), validate=True)
    except binascii.Error:
        secret = b""
    if not text.startswith(SECRET_PREFIX) or len(secret) not in SECRET_BYTES:
        hint = f"needs {SECRET_PREFIX} and 24 to 64 bytes in base64: openssl rand -base64 32"
        raise ConfigurationError([f"{where}: {settings.secret_file} {hint}"])
    return secret


def signed(secret: bytes, message: str, moment: datetime, body: bytes) -> dict[str, str]:
    """Return the headers of a message; the signature covers its ID, the moment, and the body."""
    seconds = str(int(moment.timestamp()))
    digest = hmac.digest(secret, b".".join((message.encode(), seconds.encode(), body)), hashlib.sha256)
    return {
        "content-type": "application/json",
        "webhook-id": message,
        "webhook-timestamp": seconds,
        "webhook-signature": f"v1,{base64.b64encode(digest).decode()}",
    }


def body_of(order: TransportOrderStatus) -> bytes:
    """Return the message about an order."""
    changed = order.history[-1].timestamp if order.history else order.created
    content = {
        "type": f"transportOrder.{order.state}",
        "timestamp": changed.isoformat(),
        "data": order.model_dump(mode="json", by_alias=True),
    }
    return json.dumps(content, separators=(",", ":")).encode()


class Webhook:
    """Delivers to one receiver, in the order of the changes."""

    def __init__(
        self, settings: WebhookSettings, secret: bytes, store: Store, clock: Clock, send: Send
    ) -> None:
        self.settings = settings
        self.delivered = self.dropped = 0
        self._secret = secret
        self._store = store
        self._clock = clock
        self._send = send
        self._changed = asyncio.Event()
        self._attempts: deque[WebhookAttempt] = deque(maxlen=ATTEMPTS_KEPT)
        self._state = WebhookState.DELIVERING
        self._failures = 0
        self._kept: int | None = None
        self._failing_since: datetime | None = None
        self._next_attempt: datetime | None = None

    @property
    def status(self) -> WebhookStatus:
        """The web hook as hosts see it."""
        url, last = urlsplit(str(self.settings.url)), self._attempts[-1] if self._attempts else None
        return WebhookStatus(
            name=self.settings.name,
            url=f"{url.scheme}://{url.netloc.rpartition('@')[2]}{url.path}",
            state=self._state,
            reason=last.result if last and not last.delivered else "",
            next_attempt=self._next_attempt,
            delivered=self.delivered,
            dropped=self.dropped,
            attempts=tuple(reversed(self._attempts)),
        )

    @property
    def failing(self) -> bool:
        """Whether the receiver does not accept a message, or accepts none any more."""
        return self._state is not WebhookState.DELIVERING

    def wake(self) -> None:
        """Look for changes soon."""
        self._changed.set()

    async def run(self) -> None:
        """Deliver until cancelled, or until the receiver is gone."""
        known = await self._begin()
        while self._state is not WebhookState.DISABLED:
            self._changed.clear()
            with suppress(StoreNotReadyError):  # the next look reads the same changes
                known = await self._deliver_since(known)
            await self._pause()
        log.warning("web hook disabled: its receiver is gone; restart to use it again", **self._names)

    async def _begin(self) -> int:
        """Return the number of the last change that the receiver has; a new one begins with the present."""
        stored: str | None = None
        while True:
            try:
                stored = (await self._store.documents(KIND)).get(self.settings.name)
                break
            except StoreNotReadyError:
                await asyncio.sleep(PAUSES[0])
        last = self._store.numbers.last
        if stored is not None and stored.isdecimal() and int(stored) <= last:
            self._kept = int(stored)
            return self._kept
        if stored is not None:
            log.warning("web hook continues at the present: the store is an older one", **self._names)
        self._keep(last)
        return last

    async def _deliver_since(self, known: int) -> int:
        """Deliver until all has arrived, or an attempt has failed; return the last change delivered."""
        while page := await self._store.changes_after(known, PAGE):
            for number, order in page:
                if self._wanted(order):
                    if not await self._deliver(number, order.status):
                        return known
                    self._keep(number)
                known = number
            self._keep(known)
        return known

    def _wanted(self, order: TransportOrder) -> bool:
        return not self.settings.states or order.status.state in self.settings.states

    async def _deliver(self, number: int, order: TransportOrderStatus) -> bool:
        """Try once; return whether the message is done, because it arrived or is given up."""
        now, message = self._clock.now(), f"change-{number}"
        body = body_of(order)
        result, delivered = "no answer", False
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                status = await self._send(
                    str(self.settings.url), signed(self._secret, message, now, body), body
                )
            result, delivered = str(status), status in SUCCESSES
            if status == GONE:
                self._state = WebhookState.DISABLED
        except TimeoutError:
            result = f"no answer within {ANSWER_SECONDS:.0f} s"
        except OSError as error:
            result = str(error) or type(error).__name__
        self._attempts.append(
            WebhookAttempt(
                timestamp=now,
                message=message,
                transport_order=order.name,
                state=order.state,
                result=result[:500],
                delivered=delivered,
            )
        )
        if not delivered:
            return self._failed(order.name, result, now)
        if self._failures:
            log.info("web hook delivers again", **self._names)
        self._state, self._failures = WebhookState.DELIVERING, 0
        self._failing_since = self._next_attempt = None
        self.delivered += 1
        return True

    def _failed(self, order: str, result: str, now: datetime) -> bool:
        """Note a failed attempt; return whether the message is given up."""
        if self._state is WebhookState.DISABLED:
            return False
        if not self._failures:
            log.warning("web hook: message not delivered; trying again", reason=result, **self._names)
        self._failing_since = self._failing_since or now
        if now - self._failing_since >= timedelta(hours=self.settings.retry_hours):
            log.error("web hook: message given up", order=order, reason=result, **self._names)
            self.dropped += 1
            self._failing_since = None
            return True
        pause = PAUSES[min(self._failures, len(PAUSES) - 1)]
        self._state, self._failures = WebhookState.RETRYING, self._failures + 1
        self._next_attempt = now + timedelta(seconds=pause)
        return False

    async def _pause(self) -> None:
        """Wait for a change, or for the next attempt."""
        if self._state is WebhookState.RETRYING and self._next_attempt:
            left = self._next_attempt - self._clock.now()
            await asyncio.sleep(max(0.0, left.total_seconds()))
        elif self._state is WebhookState.DELIVERING:
            try:
                async with asyncio.timeout(POLL_SECONDS):
                    await self._changed.wait()
            except TimeoutError:
                pass  # a change of another order service before a takeover

    def _keep(self, number: int) -> None:
        if number == self._kept:
            return
        self._kept, changes = number, Changes()
        changes.documents[KIND, self.settings.name] = str(number)
        self._store.commit(changes, lambda: None)

    @property
    def _names(self) -> dict[str, str]:
        return {"webhook": self.settings.name}


class Webhooks:
    """All web hooks; listens to the engine."""

    def __init__(self, hooks: Sequence[Webhook]) -> None:
        self.hooks = tuple(hooks)

    @classmethod
    def of(cls, settings: Sequence[WebhookSettings], store: Store, clock: Clock) -> Webhooks:
        """Create them; raises ConfigurationError if a secret or the HTTP library is missing."""
        names = [each.name for each in settings]
        if len(set(names)) < len(names):
            raise ConfigurationError([f"webhooks: each name once: {', '.join(sorted(names))}"])
        send = _sender() if settings else None
        return cls([Webhook(each, read_secret(each), store, clock, send) for each in settings if send])

    @property
    def statuses(self) -> tuple[WebhookStatus, ...]:
        """All web hooks as hosts see them."""
        return tuple(each.status for each in self.hooks)

    def order_changed(self, _: TransportOrderStatus) -> None:
        """Wake all web hooks."""
        for each in self.hooks:
            each.wake()

    def sequence_changed(self, _: object) -> None:
        """Order sequences are not sent."""

    def vehicle_changed(self, _: object) -> None:
        """Vehicles are not sent."""


def _sender() -> Send:
    """Return a function that sends by httpx, without following redirects or reading answers' bodies."""
    try:
        import httpx  # noqa: PLC0415 - an extra
    except ImportError as error:
        problem = f"webhooks: {error}; install the order service with its extra: [webhooks]"
        raise ConfigurationError([problem]) from error
    client = httpx.AsyncClient(timeout=ANSWER_SECONDS, follow_redirects=False, trust_env=False)

    async def send(url: str, headers: Mapping[str, str], body: bytes) -> int:
        try:
            async with client.stream("POST", url, headers=dict(headers), content=body) as answer:
                return answer.status_code
        except httpx.HTTPError as error:
            message = f"{type(error).__name__}: {error}"
            raise ConnectionError(message) from error

    return send
