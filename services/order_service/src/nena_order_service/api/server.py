"""The HTTP server of the order service: one port and one access guard, whichever application answers."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from http import HTTPStatus
from typing import Final

from fastapi import FastAPI, Request, Response
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from nena_order_service.api import problems
from nena_order_service.api.metrics import Waiting, standing_by
from nena_order_service.api.operation_routes import READING
from nena_order_service.api.rest import ALIVE, rule_of
from nena_shared.fleet_api.requests import Readiness
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.tasks import Supervisor
from nena_shared.web.access import protect
from nena_shared.web.metrics import METRICS, metrics_response
from nena_shared.web.problem import answer, refusal
from nena_shared.web.server import SHUTDOWN_TIMEOUT, HttpServer
from nena_shared.web.settings import HttpSettings

DETAIL = (
    "Requests of web pages (with Origin) may not change anything while no login is required. Use the control "
    "panel, or set http.users and send a token."
)


OPENTCS_KEY: Final = "x-api-access-key"
"""Header in which hosts of openTCS send their key."""


def accept_access_key(scope: Scope) -> None:
    """Take openTCS's access key of a request for this program's token."""
    headers = Headers(scope=scope)
    key = headers.get(OPENTCS_KEY)
    if key and "authorization" not in headers:
        scope["headers"] = [*scope["headers"], (b"authorization", f"Bearer {key}".encode("latin-1"))]


RETRY_AFTER = "1"
"""Value of Retry-After, seconds; a takeover takes several."""

METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]


def make_standby_app(active_url: Callable[[], str], problem: Callable[[], str]) -> FastAPI:
    """Create the ASGI application of a standby.

    Args:
        active_url: returns the URL of the active order service; empty while unknown.
        problem: returns why the database does not answer, empty while it does.
    """

    def readiness() -> Readiness:
        where = f"The active one is {active_url()}." if active_url() else "The active one is not known."
        problems = [f"This order service is a standby. {where}"]
        if problem():
            problems.append(f"The database does not answer ({problem()}): no takeover is possible now.")
        return Readiness(
            ready=False,
            role="standby",
            broker_connected=False,
            store_ready=not problem(),
            problems=tuple(problems),
        )

    def refer(request: Request) -> Response:
        url, headers = active_url(), dict[str, str]()
        where = "The active order service is not known yet. Retry in a moment"
        if url:
            raw: bytes = request.scope["raw_path"]  # unchanged: headers do not allow all characters of names
            active_path = f"{url}{raw.decode('ascii')}"
            where = f"Send the request to the active order service: {active_path}"
            headers["Link"] = f'<{active_path}>; rel="alternate"'
        return _retry_response("Standing by", f"This order service is a standby. {where}.", headers)

    return _make_waiting_app(readiness, refer)


def make_starting_app(problem: Callable[[], str]) -> FastAPI:
    """Create the ASGI application for the start; ``problem`` returns why the store cannot be written."""

    def detail() -> str:
        if not problem():
            return (
                "This order service is starting: it loads its orders, and asks the MQTT broker whether "
                "another one is active for this fleet. It continues automatically."
            )
        return (
            f"This order service is starting and waits for its database ({problem()}). "
            "Check the disk or server of store.url; it continues automatically."
        )

    def readiness() -> Readiness:
        return Readiness(
            ready=False,
            role="starting",
            broker_connected=False,
            store_ready=not problem(),
            problems=(detail(),),
        )

    return _make_waiting_app(readiness, lambda _: _retry_response("Starting", detail(), {}))


def _retry_response(title: str, detail: str, headers: dict[str, str]) -> Response:
    problem = Problem(title=title, status=HTTPStatus.SERVICE_UNAVAILABLE, detail=detail)
    return answer(problem, {"Retry-After": RETRY_AFTER, **headers})


def _make_waiting_app(readiness: Callable[[], Readiness], other: Callable[[Request], Response]) -> FastAPI:
    """Create an application that is alive but not ready, and answers all other requests with ``other``."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    problems.install(app)

    @app.get("/healthz")
    async def alive() -> Response:
        return Response(ALIVE, media_type="text/plain")

    @app.get(METRICS)
    async def metrics(request: Request) -> Response:
        return metrics_response(request, standing_by(Waiting(store_ready=readiness().store_ready)))

    @app.get("/readyz")
    async def ready() -> Response:
        body = readiness().model_dump_json(by_alias=True)
        # 0030: not ready, so that the Service of Kubernetes only has the active order service.
        return Response(body, HTTPStatus.SERVICE_UNAVAILABLE, media_type="application/json")

    @app.api_route("/{path:path}", methods=METHODS)
    async def rest(request: Request) -> Response:
        return other(request)

    return app


class RestServer:
    """Listens on the port from its creation; the application behind it can be replaced.

    Users, the issuer's keys and rate limit counts are kept when it is replaced.
    """

    def __init__(self, app: ASGIApp, settings: HttpSettings) -> None:
        """Bind the port.

        Raises:
            ConfigurationError: the address is not protected as required, or a file cannot be used.
            StartError: the port is in use, or the address does not belong to this machine.
        """
        self._guard = protect(app, settings, rule_of(settings))
        self._has_users = settings.users is not None or settings.oidc is not None
        self._http = HttpServer(self._answer_request, settings)
        self._answering: asyncio.Task[None] | None = None

    @property
    def answers(self) -> Counter[int]:
        """Number of answered requests by status."""
        return self._http.answers

    @property
    def url(self) -> str:
        """The URL according to the settings."""
        return self._http.url

    def show(self, app: ASGIApp) -> None:
        """Serve ``app`` from the next request on."""
        self._guard.app = app

    async def _answer_request(self, scope: Scope, receive: Receive, send: Send) -> None:
        accept_access_key(scope)
        # Any page that is open in a browser can send requests here: simple ones to any address, and all
        # others to a host name that resolves to this address (DNS rebinding). Browsers show it by "Origin";
        # only a token distinguishes users from pages.
        changes_for_page = scope["method"] not in READING and "origin" in Headers(scope=scope)
        if changes_for_page and not self._has_users:
            await refusal(HTTPStatus.FORBIDDEN, DETAIL)(scope, receive, send)
        else:
            await self._guard(scope, receive, send)

    def open(self, supervisor: Supervisor) -> None:
        """Start answering requests; repeated calls have no effect."""
        self._answering = self._answering or supervisor.start("http", self._http.run())

    async def close(self) -> None:
        """Stop accepting requests and wait briefly for open ones."""
        answering, self._answering = self._answering, None
        self._http.stop()
        if answering:
            await asyncio.wait({answering}, timeout=SHUTDOWN_TIMEOUT + 1)
