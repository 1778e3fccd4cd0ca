"""The REST door: one server and one guard for the whole run, whatever answers behind them."""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp

from nena_order_service.rest.opentcs.app import AccessKey
from nena_order_service.rest.pages import NoPages
from nena_order_service.rest.roles import role_needed
from nena_shared.tasks import Supervisor
from nena_shared.web.access import protect
from nena_shared.web.server import SHUTDOWN_TIMEOUT, HttpServer
from nena_shared.web.settings import HttpSettings


class RestDoor:
    """Has the port from its making on.

    What answers may be changed; users, an issuer's keys and what limits of requests have counted stay.
    """

    def __init__(self, app: ASGIApp, settings: HttpSettings) -> None:
        """Take the port.

        Raises:
            ConfigurationError: the address is not protected as it must be, or a file cannot be used.
            StartError: somebody else has the port, or the address is not ours.

        """
        self._guard = protect(app, settings, role_needed)
        asks = settings.users is not None or settings.oidc is not None
        self._http = HttpServer(AccessKey(self._guard if asks else NoPages(self._guard)), settings)
        self._answering: asyncio.Task[None] | None = None

    @property
    def url(self) -> str:
        """Where it is found, as far as the settings tell."""
        return self._http.url

    def show(self, app: ASGIApp) -> None:
        """Have ``app`` answer from the next request on."""
        self._guard.app = app

    def open(self, supervisor: Supervisor) -> None:
        """Answer requests from now on; nothing happens where that is so already."""
        self._answering = self._answering or supervisor.start("http", self._http.run())

    async def close(self) -> None:
        """Take no more requests, and give those that are open a moment to end."""
        answering, self._answering = self._answering, None
        if answering is None:
            self._http.close()
            return
        self._http.stop()
        await asyncio.wait({answering}, timeout=SHUTDOWN_TIMEOUT + 1)
