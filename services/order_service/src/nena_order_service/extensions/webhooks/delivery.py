"""Deliver changed orders to URLs of hosts, by the scheme of Standard Webhooks (1.0).

A web hook stores the number of the last change that its receiver has, like a client of the event stream. It
reads what changed since then from the store: nothing queues in memory, a restart or takeover continues where
the last one ended, and an order that changed several times meanwhile is sent once, in its present state.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import hashlib
import hmac
import json
import ssl
from collections import deque
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any, Final, Protocol, Self
from urllib.parse import urlsplit

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.extensions.webhooks.settings import WebhookSettings
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.webhooks import WebhookAttempt, WebhookState, WebhookStatus
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError, secret_in
from nena_shared.tasks import set_within

log = get_logger(__name__)

KIND: Final = "webhook"
"""The kind of a web hook's document in the store, which contains its change number."""
PAGE: Final = 50
"""Number of changed orders read from the store at a time."""
ATTEMPTS_KEPT: Final = 20
RESULT_LENGTH: Final = 500
BODY_READ: Final = 65_536
"""Maximum length of an answer's body that is read, bytes."""
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


def sign_message(secret: bytes, message: str, moment: datetime, body: bytes) -> dict[str, str]:
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
    """Return the message about an order; its time is that of the last entry of the order's history."""
    data = order.model_dump(mode="json", by_alias=True)
    changed = data["history"][-1]["timestamp"] if order.history else data["created"]
    content = {"type": f"transportOrder.{order.state}", "timestamp": changed, "data": data}
    return json.dumps(content, separators=(",", ":")).encode()


def id_of(body: bytes) -> str:
    """Return the ID of a message: the same for each attempt, another one for other content.

    The numbers of changes would repeat once the database was restored from a backup.
    """
    return f"msg_{hashlib.sha256(body).hexdigest()[:32]}"


class Webhook:
    """Delivers to one receiver, in the order of the changes."""

    def __init__(self, settings: WebhookSettings, secret: bytes, store: Store, clock: Clock) -> None:
        self.settings = settings
        self.delivered = self.dropped = 0
        self._secret = secret
        self._store = store
        self._clock = clock
        self._changed = asyncio.Event()
        self._attempts: deque[WebhookAttempt] = deque(maxlen=ATTEMPTS_KEPT)
        self._state = WebhookState.DELIVERING
        self._known = 0
        """Number of the last change that is done: delivered, given up, or not wanted."""
        self._stored = -1
        self._failures = 0
        self._failing: tuple[int, datetime] | None = None
        """The change that cannot be delivered, and since when."""
        self._next_attempt: datetime | None = None

    @property
    def status(self) -> WebhookStatus:
        """The web hook as hosts see it."""
        # User, password and query of a URL may be the receiver's secrets.
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
    def is_failing(self) -> bool:
        """Whether the receiver does not accept a message, or accepts none any more."""
        return self._state is not WebhookState.DELIVERING

    def wake(self) -> None:
        """Wake the task: an order has changed."""
        self._changed.set()

    async def run(self, receiver: Receiver) -> None:
        """Deliver until cancelled; once the receiver is gone, do nothing."""
        began = False
        async with receiver:
            while self._state is not WebhookState.DISABLED:
                self._changed.clear()
                try:
                    if not began:
                        await self._restore_progress()
                        began = True
                    pause = await self._deliver_all(receiver)
                except StoreNotReadyError:
                    pause = PAUSES[0]
                except Exception:
                    log.exception("web hook failed; trying again", pause=PAUSES[-1], **self._log_values)
                    pause = PAUSES[-1]
                if pause is not None:
                    await asyncio.sleep(pause)
                else:
                    # With a limit, because another order service may have changed orders before a takeover.
                    await set_within(self._changed, POLL_SECONDS)
        log.warning("web hook disabled: its receiver is gone; restart to use it again", **self._log_values)
        await asyncio.Event().wait()  # a task that returns is run again

    async def _restore_progress(self) -> None:
        """Continue where the last run ended; a new web hook begins with the present."""
        stored = (await self._store.documents(KIND)).get(self.settings.name, "")
        last = self._store.numbers.last
        # A number that the store has not reached would hold back everything until then.
        if stored.isdecimal() and int(stored) <= last:
            self._known = self._stored = int(stored)
        else:
            self._known = last
            self._store_progress()

    async def _deliver_all(self, receiver: Receiver) -> float | None:
        """Deliver all changes; return the delay before the next attempt if one fails, otherwise None."""
        more = True
        while more:
            page = await self._store.read_changes_after(self._known, PAGE)
            more = len(page) == PAGE
            for number, order in page:
                wanted = not self.settings.states or order.status.state in self.settings.states
                if wanted and not await self._deliver_once(receiver, number, order.status):
                    return self._note_failure(order.name)
                self._known = number
                # Few unwanted ones are read again after a restart: cheaper than a commit for each.
                if wanted or number - self._stored >= PAGE:
                    self._store_progress()
        self._note_success()
        return None

    async def _deliver_once(self, receiver: Receiver, number: int, order: TransportOrderStatus) -> bool:
        """Try once; return whether the message is done, because it has arrived or is given up."""
        time, body = self._clock.now(), body_of(order)
        message = id_of(body)
        try:
            # Each attempt gets a new signature: receivers of Standard Webhooks refuse old timestamps.
            async with asyncio.timeout(ANSWER_SECONDS):
                status = await receiver.send(sign_message(self._secret, message, time, body), body)
            result, delivered = str(status), status in SUCCESSES
            if status == GONE:  # Standard Webhooks: the receiver wants no more messages
                self._state = WebhookState.DISABLED
        except TimeoutError:
            result, delivered = f"no answer within {ANSWER_SECONDS:.0f} s", False
        except OSError as error:
            result, delivered = str(error) or type(error).__name__, False
        self._attempts.append(
            WebhookAttempt(
                timestamp=time,
                message=message,
                transport_order=order.name,
                state=order.state,
                result=result[:RESULT_LENGTH],
                delivered=delivered,
            )
        )
        if delivered:
            self.delivered += 1
            self._note_success()
            return True
        return self._is_given_up(number, order.name, time)

    def _is_given_up(self, number: int, order: str, time: datetime) -> bool:
        """Return whether a message has failed for so long that it is given up."""
        if self._failing is None or self._failing[0] != number:
            self._failing = (number, time)
        if time - self._failing[1] < timedelta(hours=self.settings.retry_hours):
            return False
        log.error("web hook: message given up", order=order, reason=self.status.reason, **self._log_values)
        self.dropped += 1
        self._failing = None
        return True

    def _note_failure(self, order: str) -> float:
        """Note a failed attempt; return the delay before the next one, seconds."""
        pause = PAUSES[min(self._failures, len(PAUSES) - 1)]
        if not self._failures:
            reason = self.status.reason
            log.warning(
                "web hook: message not delivered; trying again",
                order=order,
                reason=reason,
                **self._log_values,
            )
        self._failures += 1
        if self._state is not WebhookState.DISABLED:
            self._state = WebhookState.RETRYING
            self._next_attempt = self._clock.now() + timedelta(seconds=pause)
        return pause

    def _note_success(self) -> None:
        """Note that nothing is left to try again."""
        if self._failures:
            log.info("web hook delivers again", **self._log_values)
        self._state, self._failures = WebhookState.DELIVERING, 0
        self._failing = self._next_attempt = None

    def _store_progress(self) -> None:
        self._stored, changes = self._known, Changes()
        changes.documents[KIND, self.settings.name] = str(self._known)
        self._store.commit(changes, lambda: None)

    @property
    def _log_values(self) -> dict[str, str]:
        return {"webhook": self.settings.name}


class Receiver(Protocol):
    """The connection to a receiver; entered before its first use."""

    async def __aenter__(self) -> object:
        """Open it."""
        ...

    async def __aexit__(self, *_: object) -> None:
        """Close it."""
        ...

    async def send(self, headers: Mapping[str, str], body: bytes) -> int:
        """Send a message and return the status of the answer; raises OSError if there is none."""
        ...


class HttpReceiver:
    """A receiver reached by httpx; follows no redirects and needs no answer's body."""

    def __init__(self, settings: WebhookSettings) -> None:
        """Check that the library is there; raises ConfigurationError."""
        self._url = str(settings.url)
        try:
            import httpx  # noqa: PLC0415 - an extra
        except ImportError as error:
            problem = f"webhooks: {error}; install the extra nena-order-service[webhooks]"
            raise ConfigurationError([problem]) from error
        self._httpx = httpx
        try:
            self._trusted = ssl.create_default_context(cafile=settings.ca)
        except OSError as error:
            raise ConfigurationError([f"webhooks.{settings.name}.ca: {settings.ca}: {error}"]) from error
        self._client: Any = None

    async def __aenter__(self) -> Self:
        """Open a client."""
        # Proxies and certificates of the environment are not used: the settings alone say who is trusted.
        self._client = self._httpx.AsyncClient(
            timeout=ANSWER_SECONDS, follow_redirects=False, trust_env=False, verify=self._trusted
        )
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close the client."""
        await self._client.aclose()

    async def send(self, headers: Mapping[str, str], body: bytes) -> int:
        """Send a message; a short body of the answer is read, so that the connection can be used again."""
        try:
            request = self._client.stream("POST", self._url, headers=dict(headers), content=body)
            async with request as answer:
                size = 0
                async for part in answer.aiter_raw():
                    size += len(part)
                    if size > BODY_READ:
                        break
                return int(answer.status_code)
        except (self._httpx.HTTPError, self._httpx.InvalidURL) as error:
            message = f"{type(error).__name__}: {error}"
            raise ConnectionError(message) from error
