"""Refuses commands of browsers' pages where nobody has to log in: no page but others' own would ask here."""

from __future__ import annotations

from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from nena_order_service.rest.roles import READING
from nena_shared.web.problem import refusal

DETAIL = (
    "Commands of web pages (Origin) are not taken where nobody has to log in. Use the control panel; or set "
    "http.users, and send a token."
)


class NoPages:
    """ASGI middleware: answers 403 to whatever a browser says that a page has asked for.

    A browser asks on behalf of any page that is open in it. A request without a body it sends to other sites
    unasked, and to a name that a page has made to point here anything: only a token tells people from pages.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what programs ask, and what changes nothing."""
        asks = scope["type"] == "http" and scope["method"] not in READING
        if asks and "origin" in Headers(scope=scope):
            await refusal(HTTPStatus.FORBIDDEN, DETAIL)(scope, receive, send)
        else:
            await self._app(scope, receive, send)
