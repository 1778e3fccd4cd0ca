"""Limit of request bodies: a longer one is refused before it is in memory."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from nena_shared.web.problem import refusal


class BodyLimit:
    """ASGI middleware: answers 413 to a body of more than ``limit`` bytes.

    ``larger`` contains the beginnings of paths that have their own limit.
    """

    def __init__(self, app: ASGIApp, limit: int, larger: Mapping[str, int] | None = None) -> None:
        self._app = app
        self._limit = limit
        self._larger = larger or {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request and count its bytes."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        # 0101: FastAPI's own limit answers in plain text, not with a problem, if no route reads the body.
        larger = (size for start, size in self._larger.items() if scope["path"].startswith(start))
        limit = next(larger, self._limit)
        announced = Headers(scope=scope).get("content-length", "")
        if announced.isdecimal() and int(announced) > limit:
            error = _too_long(limit)
            await refusal(HTTPStatus(error.status_code), error.detail)(scope, receive, send)
            return
        received = 0

        # A body in chunks announces no length, so what arrives is counted too.
        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > limit:
                raise _too_long(limit)
            return message

        await self._app(scope, counted, send)


def _too_long(limit: int) -> HTTPException:
    detail = f"The body is longer than {limit} bytes. Send a shorter one, or raise max_body."
    return HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, detail)
