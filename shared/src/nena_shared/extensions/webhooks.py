"""Deliver messages to URLs of hosts, by the scheme of Standard Webhooks (1.0)."""

from __future__ import annotations

import asyncio
import base64
import binascii
import hashlib
import hmac
import json
import ssl
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar, Final, Self

from pydantic import Field, HttpUrl

from nena_shared.clock import Clock, iso
from nena_shared.fleet_api.base import Resource
from nena_shared.fleet_api.webhooks import WebhookState
from nena_shared.log import get_logger
from nena_shared.metrics import Section, counter, gauge
from nena_shared.settings import ConfigurationError, SettingsGroup, secret_in
from nena_shared.tasks import set_within

log = get_logger(__name__)

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


class WebhookSettings(SettingsGroup):
    """A web hook: a URL that receives messages."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_.-]{1,100}$", description="Name; what the receiver has is stored under it."
    )
    url: HttpUrl = Field(description="URL that receives the messages by POST.")
    secret_file: Path = Field(
        description="File with the key of the signatures: `whsec_` and 24 to 64 bytes in base64."
    )
    ca: Path | None = Field(None, description="CA bundle (PEM) for the receiver. Unset: the system CA store.")
    retry_hours: float = Field(
        24.0, gt=0, le=720, description="Time after which an undeliverable message is given up, hours."
    )


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


def id_of(body: bytes) -> str:
    """Return the ID of a message: the same for each attempt, another one for other content.

    The numbers of changes would repeat once the database was restored from a backup.
    """
    return f"msg_{hashlib.sha256(body).hexdigest()[:32]}"


@dataclass(frozen=True, slots=True)
class Message:
    """A message about a change."""

    number: int
    """Increases from message to message."""
    kind: str
    """``type`` of the body, such as ``attention.began``."""
    subject: str
    """Name of what has changed."""
    changed: datetime
    data: Resource
    wanted: bool = True
    """Whether it is sent, or passed over."""

    def body(self) -> bytes:
        """Return the content."""
        data = self.data.model_dump(mode="json", by_alias=True)
        content = {"type": self.kind, "timestamp": iso(self.changed), "data": data}
        return json.dumps(content, separators=(",", ":")).encode()


class Webhook(ABC):
    """Delivers to one receiver, in the order of the changes."""

    not_ready: ClassVar[tuple[type[Exception], ...]] = ()
    """Failures of the source that pass soon."""

    def __init__(self, settings: WebhookSettings, clock: Clock) -> None:
        """Raise ConfigurationError if a secret, a CA or the HTTP library is missing."""
        self.settings = settings
        self.receiver = HttpReceiver(settings)
        self.delivered = self.dropped = 0
        self._secret = read_secret(settings)
        self._clock = clock
        self._log = log.bind(webhook=settings.name)
        self._changed = asyncio.Event()
        self._state = WebhookState.DELIVERING
        self._reason = ""
        """Why the last attempt has failed; empty if it has not."""
        self._failures = 0
        self._failing: tuple[int, datetime] | None = None
        """The change that cannot be delivered, and since when."""
        self._next_attempt: datetime | None = None

    async def begin(self) -> None:  # noqa: B027 - not every source needs it
        """Prepare the source; called until it succeeds."""

    @abstractmethod
    async def read(self) -> Sequence[Message]:
        """Return the next messages, the oldest first; empty if there is none."""

    @abstractmethod
    def note_done(self, message: Message) -> None:
        """Note that a message is delivered, given up, or not wanted."""

    def note_attempt(  # noqa: B027 - not every source shows them
        self, message: Message, body: bytes, time: datetime, result: str, *, delivered: bool
    ) -> None:
        """Note the result of an attempt."""

    @property
    def is_failing(self) -> bool:
        """Whether the receiver does not accept a message, or accepts none any more."""
        return self._state is not WebhookState.DELIVERING

    def wake(self) -> None:
        """Wake the task: something has changed."""
        self._changed.set()

    async def run(self) -> None:
        """Deliver until cancelled; once the receiver is gone, do nothing."""
        began = False
        async with self.receiver:
            while self._state is not WebhookState.DISABLED:
                self._changed.clear()
                try:
                    if not began:
                        await self.begin()
                        began = True
                    pause = await self._deliver_all()
                except self.not_ready:
                    pause = PAUSES[0]
                except Exception:
                    log.exception("web hook failed; trying again", webhook=self.settings.name)
                    pause = PAUSES[-1]
                if pause is not None:
                    await asyncio.sleep(pause)
                else:
                    # With a limit, because another order service may have changed orders before a takeover.
                    await set_within(self._changed, POLL_SECONDS)
        self._log.warning("web hook disabled: its receiver is gone; restart to use it again")
        await asyncio.Event().wait()  # a task that returns is run again

    async def _deliver_all(self) -> float | None:
        """Deliver all messages; return the delay before the next attempt if one fails, otherwise None."""
        while messages := await self.read():
            for message in messages:
                if message.wanted and not await self._deliver_once(message):
                    return self._note_failure(message.subject)
                self.note_done(message)
        self._note_success()
        return None

    async def _deliver_once(self, message: Message) -> bool:
        """Try once; return whether the message is done, because it has arrived or is given up."""
        time, body = self._clock.now(), message.body()
        try:
            # Each attempt gets a new signature: receivers of Standard Webhooks refuse old timestamps.
            async with asyncio.timeout(ANSWER_SECONDS):
                status = await self.receiver.send(sign_message(self._secret, id_of(body), time, body), body)
            result, delivered = str(status), status in SUCCESSES
            if status == GONE:  # Standard Webhooks: the receiver wants no more messages
                self._state = WebhookState.DISABLED
        except TimeoutError:
            result, delivered = f"no answer within {ANSWER_SECONDS:.0f} s", False
        except OSError as error:
            result, delivered = str(error) or type(error).__name__, False
        self._reason = "" if delivered else result[:RESULT_LENGTH]
        self.note_attempt(message, body, time, result[:RESULT_LENGTH], delivered=delivered)
        if delivered:
            self.delivered += 1
            self._note_success()
            return True
        return self._is_given_up(message, time)

    def _is_given_up(self, message: Message, time: datetime) -> bool:
        """Return whether a message has failed for so long that it is given up."""
        if self._failing is None or self._failing[0] != message.number:
            self._failing = (message.number, time)
        if time - self._failing[1] < timedelta(hours=self.settings.retry_hours):
            return False
        self._log.error("web hook: message given up", subject=message.subject, reason=self._reason)
        self.dropped += 1
        self._failing = None
        return True

    def _note_failure(self, subject: str) -> float:
        """Note a failed attempt; return the delay before the next one, seconds."""
        pause = PAUSES[min(self._failures, len(PAUSES) - 1)]
        if not self._failures:
            self._log.warning(
                "web hook: message not delivered; trying again", subject=subject, reason=self._reason
            )
        self._failures += 1
        if self._state is not WebhookState.DISABLED:
            self._state = WebhookState.RETRYING
            self._next_attempt = self._clock.now() + timedelta(seconds=pause)
        return pause

    def _note_success(self) -> None:
        """Note that nothing is left to try again."""
        if self._failures and not self._reason:
            self._log.info("web hook delivers again")
        self._state, self._failures = WebhookState.DELIVERING, 0
        self._failing = self._next_attempt = None


class HttpReceiver:
    """A receiver reached by httpx; follows no redirects and needs no answer's body."""

    def __init__(self, settings: WebhookSettings) -> None:
        """Check that the library is there; raises ConfigurationError."""
        self._url = str(settings.url)
        try:
            import httpx  # noqa: PLC0415 - an extra
        except ImportError as error:
            problem = f"webhooks: {error}; install httpx, the extra `webhooks`"
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
            raise ConnectionError(f"{type(error).__name__}: {error}") from error


def check_names(settings: Iterable[WebhookSettings]) -> None:
    """Raise ConfigurationError if two web hooks have the same name."""
    names = [hook.name for hook in settings]
    if len(set(names)) < len(names):
        raise ConfigurationError([f"webhooks: use each name once: {', '.join(sorted(names))}"])


def section_of(prefix: str) -> Section[Any]:
    """Return the metrics of an extension's ``hooks``; their names begin with ``prefix``."""
    return Section(
        "Web hooks",
        (
            counter(
                f"{prefix}_webhook_messages_total",
                "Messages of web hooks: `delivered`, or given up (`dropped`).",
                lambda s: {
                    (hook.settings.name, result): count
                    for hook in s.hooks
                    for result, count in (("delivered", hook.delivered), ("dropped", hook.dropped))
                },
                "webhook",
                "result",
            ),
            gauge(
                f"{prefix}_webhook_retrying",
                "1 while the receiver of a web hook does not accept a message.",
                lambda s: {hook.settings.name: hook.is_failing for hook in s.hooks},
                "webhook",
            ),
        ),
    )
