"""The order service's REST door, as the control panel reaches it through this program."""

from __future__ import annotations

import ssl
from dataclasses import dataclass

import httpx

from nena_shared.log import get_logger
from nena_status_aggregator.settings import OrderServiceSettings

log = get_logger(__name__)


class OrderServiceAwayError(Exception):
    """The order service has not answered; the text says what happened."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What the order service answered, problems included."""

    status: int
    content_type: str
    body: bytes


class OrderServiceDoor:
    """Passes requests on. Commands are rare: each has a connection of its own, and none is sent twice."""

    def __init__(self, url: str, settings: OrderServiceSettings) -> None:
        """Prepare; ``url`` is where the order service's ``/v1`` is."""
        self._url = url.rstrip("/")
        self._timeout = httpx.Timeout(settings.timeout, connect=min(5.0, settings.timeout))
        self._tls = ssl.create_default_context(cafile=settings.ca)

    async def ask(
        self, method: str, path: str, query: str = "", body: bytes | None = None, *, token: str = ""
    ) -> Answer:
        """Send one request; ``path`` is percent-encoded and begins below ``/v1/``, ``token`` says who asks.

        Raises:
            OrderServiceAwayError: there was no answer. A command may have been carried out all the same.

        """
        url = f"{self._url}/v1/{path}" + (f"?{query}" if query else "")
        headers = {"content-type": "application/json"} if body is not None else {}
        if token:
            headers["authorization"] = f"Bearer {token}"
        try:
            async with httpx.AsyncClient(
                timeout=self._timeout, verify=self._tls, trust_env=False, follow_redirects=False
            ) as client:
                answer = await client.request(method, url, content=body, headers=headers)
        except httpx.HTTPError as error:
            reason = str(error) or type(error).__name__
            log.warning("order service not reached", method=method, path=path, reason=reason)
            raise OrderServiceAwayError(reason) from error
        if method != "GET":
            log.info("command passed on", method=method, path=path, status=answer.status_code)
        return Answer(answer.status_code, answer.headers.get("content-type", ""), answer.content)
