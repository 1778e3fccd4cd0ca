"""Requests of hosts that change something, by REST, MQTT and openTCS's web API, for those who record them."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, Final, Protocol

from pydantic import BaseModel
from starlette.requests import HTTPConnection

from nena_order_service.api.problems import FORESEEN, problem_of
from nena_order_service.errors import RefusedError
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.audit import ANONYMOUS, AuditInterface, AuditResult
from nena_shared.web.access import user_of

SECRET: Final = re.compile(
    r"password|passphrase|passcode|passwd|pwd|secret|credential|authori[sz]ation|bearer|psk$|pin.?code"
    r"|(private|api|access|encryption).?key|(access|auth|refresh|session).?token|^token$",
    re.IGNORECASE,
)
"""Names of fields and keys of properties and parameters whose values are masked."""
MASK: Final = "***"

INTERRUPTED: Final = "interrupted by a shutdown or a change of the plant model"


DescribeObject = Callable[[str, Changes], dict[str, Any] | None]
"""Describes an object by its name in a few words, with changes that are not committed yet."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a request comes from."""

    interface: AuditInterface
    user: str = ANONYMOUS
    client: str = ""
    """User-Agent of a REST client."""


@dataclass(frozen=True, slots=True)
class ChangingRequest:
    """What a request asks for."""

    origin: Origin
    operation: str
    kind: str
    """Kind of the object, such as ``vehicle``."""
    name: str
    """Name of the object; empty if the request creates it."""
    body: Callable[[], str]
    """Serialises the body; called by the store's writer."""
    creates: str = ""
    """Kind of the objects that the request creates; empty: none."""
    creates_many: bool = False
    """Whether it may create several of them."""
    joins: bool = True
    """Whether it is recorded together with its change; otherwise when it ends."""
    state: DescribeObject | None = None
    """Describes the object, if it is of a kind that the core does not have."""


_CURRENT: ContextVar[OpenRequest | None] = ContextVar("changing request", default=None)


def record_current(changes: Changes) -> None:
    """Tell listeners of ``changes`` by the request that this task executes; do nothing outside a request."""
    if (current := _CURRENT.get()) is not None:
        current.committing(changes)


def current_recorder() -> Callable[[Changes], None]:
    """Return :func:`record_current` for another task, which executes the current request."""
    current = _CURRENT.get()
    return (lambda _: None) if current is None else current.committing


class RequestListener(Protocol):
    """Follows the requests that change something."""

    def request_begun(self, request: OpenRequest) -> None:
        """Handle a request that is about to be executed."""
        ...

    def committing(self, request: OpenRequest, changes: Changes) -> None:
        """Add to the changes of a request, which are about to be committed."""
        ...

    def request_ended(self, request: OpenRequest, result: AuditResult, reason: str) -> None:
        """Handle the end of a request."""
        ...


class OpenRequest:
    """A changing request that has not ended."""

    def __init__(self, asked: ChangingRequest, listeners: Sequence[RequestListener]) -> None:
        self.asked = asked
        self.name = asked.name
        """Name of the object, as far as it is known."""
        self.after = ""
        """State of the object after the request, as JSON; empty: as the object is then."""
        self._listeners = listeners
        self._is_over = False

    def committing(self, changes: Changes) -> None:
        """Note a change of this request that is about to be committed."""
        if changes and self.asked.joins and not self._is_over:
            for listener in self._listeners:
                listener.committing(self, changes)

    def end(self, result: AuditResult, reason: str = "") -> None:
        """Note how the request has ended; only the first end counts."""
        if not self._is_over:
            self._is_over = True
            for listener in self._listeners:
                listener.request_ended(self, result, reason)


class Trail:
    """Tells its listeners of each changing request."""

    def __init__(self) -> None:
        self.listeners: list[RequestListener] = []

    @contextmanager
    def record_request(self, asked: ChangingRequest) -> Iterator[OpenRequest]:
        """Execute a request in this context, which tells the listeners how it ends."""
        request = OpenRequest(asked, self.listeners)
        for listener in self.listeners:
            listener.request_begun(request)
        token = _CURRENT.set(request)
        try:
            yield request
        except FORESEEN as error:
            request.end(AuditResult.REFUSED, _reason_of(error))
            raise
        except asyncio.CancelledError:  # no Exception: the trail would keep the request as open
            request.end(AuditResult.FAILED, INTERRUPTED)
            raise
        except Exception as error:
            request.end(AuditResult.FAILED, type(error).__name__)
            raise
        else:
            request.end(AuditResult.DONE)
        finally:
            _CURRENT.reset(token)


def _reason_of(error: Exception) -> str:
    """Return why a request was refused: the name of the refusal, and its text."""
    if isinstance(error, RefusedError):
        return f"{error.refusal.name}: {error}"
    problem = problem_of(error)
    return "; ".join(problem.errors) or problem.detail


def serialiser_of(request: BaseModel | None) -> Callable[[], str]:
    """Return a function that serialises a request's fields as sent by its client."""

    def serialise() -> str:
        if request is None:
            return ""
        return to_masked_json(request.model_dump(mode="json", by_alias=True, exclude_unset=True))

    return serialise


def to_masked_json(content: Any) -> str:  # noqa: ANN401 - of JSON
    """Return content as JSON, without the values of secrets."""
    return json.dumps(_mask_secrets(content), ensure_ascii=False, separators=(",", ":"))


def _mask_secrets(content: Any) -> Any:  # noqa: ANN401 - of JSON
    if isinstance(content, dict):
        key = content.get("key", content.get("name"))
        # Properties and action parameters are pairs of "key" (or "name") and "value".
        is_secret = isinstance(key, str) and SECRET.search(key) is not None
        return {
            name: MASK if SECRET.search(name) or (is_secret and name == "value") else _mask_secrets(value)
            for name, value in content.items()
        }
    return [_mask_secrets(item) for item in content] if isinstance(content, list) else content


def origin_of(http: HTTPConnection, interface: AuditInterface) -> Origin:
    """Return the origin of a request over HTTP."""
    user = user_of(http.scope)
    client = http.headers.get("user-agent", "")
    return Origin(interface, user.known_as if user else ANONYMOUS, client)


def kind_of_path(path: str) -> str:
    """Return the kind of the objects below a path of the API: ``vehicle`` for ``/v1/vehicles/{name}``."""
    return path.split("/")[2].removesuffix("s")
