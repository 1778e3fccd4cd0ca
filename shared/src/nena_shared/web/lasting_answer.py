"""An answer that lasts, such as an event stream: it ends when who asked may no longer be told."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from starlette.types import Message, Receive, Send

from nena_shared.clock import Clock

LOOK_AFTER = 1.0
"""Seconds after which the next part of an answer is held until it is known that it may be told."""

_END: Message = {"type": "http.response.body", "body": b"", "more_body": False}


class LastingAnswer:
    """Stands between an application and the server for one request.

    Each part of the answer that comes a second or more after the last look is sent only where ``allowed``
    says so; otherwise the answer ends before it, and the application is told that the client has gone.
    """

    def __init__(self, receive: Receive, send: Send, *, allowed: Callable[[], bool], clock: Clock) -> None:
        self._receive = receive
        self._send = send
        self._allowed = allowed
        self._clock = clock
        self._looked = clock.monotonic()
        self._over = asyncio.Event()

    async def send(self, message: Message) -> None:
        """Pass on a part of the answer, or end it; what comes after its end is nobody's."""
        if self._over.is_set():
            return
        now = self._clock.monotonic()
        if message["type"] == "http.response.body" and now - self._looked >= LOOK_AFTER:
            self._looked = now
            if not self._allowed():
                self._over.set()
                message = _END
        await self._send(message)

    async def receive(self) -> Message:
        """Give what comes from the client; after the end, that it has gone."""
        coming = asyncio.ensure_future(self._receive())
        over = asyncio.ensure_future(self._over.wait())
        try:
            await asyncio.wait((coming, over), return_when=asyncio.FIRST_COMPLETED)
            return {"type": "http.disconnect"} if self._over.is_set() else coming.result()
        finally:
            coming.cancel()
            over.cancel()
