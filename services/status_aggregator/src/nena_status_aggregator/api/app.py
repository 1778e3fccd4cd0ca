"""The HTTP application: routes, security headers, health, metrics and the panel's files."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from fastapi import APIRouter, FastAPI, Request
from starlette.datastructures import MutableHeaders
from starlette.responses import PlainTextResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from nena_shared.clock import SystemClock
from nena_shared.fleet_api.reasons import TEXTS
from nena_shared.mqtt.broker_check import LACKS
from nena_shared.web.access import AccessControl, access_tokens_of
from nena_shared.web.metrics import METRICS, metrics_response
from nena_shared.web.problem import describe_problems, make_problem_router
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import users_of
from nena_status_aggregator import panel
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api import (
    attention,
    control,
    events,
    fleet,
    history,
    oidc,
    problems,
    session,
    stops,
)
from nena_status_aggregator.api.oidc import sign_in_of
from nena_status_aggregator.api.problem_types import DESCRIBED, OPENAPI, Rejection
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.api.session import make_rule
from nena_status_aggregator.metrics.exposition import DISTRIBUTION, Exposition
from nena_status_aggregator.settings import OrderServiceSettings

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy: only content from this server, nothing inline."""

HEADERS = {
    "content-security-policy": CONTENT_SECURITY_POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


class SecurityHeaders:
    """Adds security headers to every response; plain ASGI middleware, which does not buffer streams."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        await self._app(scope, receive, send_with_headers)


def make_health_router(aggregator: Aggregator, exposition: Exposition) -> APIRouter:
    """Create the routes of health checks and metrics."""
    router = APIRouter(tags=["operation"])

    @router.get("/healthz")
    async def healthz() -> dict[str, str]:
        """Report that the program is running, and its version."""
        return {"status": "ok", "version": version(DISTRIBUTION)}

    @router.get("/readyz")
    async def readyz() -> dict[str, str]:
        """Report whether the broker is connected and grants all subscriptions."""
        if not aggregator.model.link_up:
            detail = (
                "Not connected to the MQTT broker. Check that it is running, and --mqtt.host and --mqtt.port."
            )
            raise ProblemError(Rejection.NOT_READY, detail)
        if refused := aggregator.link.mqtt.state.refused:
            detail = (
                f"The MQTT broker refused the subscription to {', '.join(refused)}; check its access list."
            )
            raise ProblemError(Rejection.NOT_READY, detail)
        if topics := aggregator.link.mqtt.state.set_aside:
            why = (
                f"The MQTT broker ends the connection at messages on {', '.join(topics)}: they are not sent."
            )
            return {"status": "ready", "problem": why}
        if lacks := aggregator.model.order_service.broker_lacks:
            return {"status": "ready", "problem": " ".join(LACKS[lack] for lack in lacks)}
        return {"status": "ready"}

    @router.get(METRICS, response_class=PlainTextResponse)
    async def metrics(request: Request) -> Response:
        """Return all metrics in the Prometheus text format, compressed for clients that accept gzip."""
        return metrics_response(request, exposition.text())

    return router


PANEL = Path(panel.__file__).parent / "static"


class PanelFiles(StaticFiles):
    """The panel's files; browsers revalidate them on each use."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file."""
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = "no-cache"
        return response


def make_app(
    aggregator: Aggregator, http: HttpSettings, order_service: OrderServiceSettings | None = None
) -> FastAPI:
    """Create the application; it starts no tasks.

    Without ``order_service`` commands are disabled.

    Raises:
        ConfigurationError: the users file or an OIDC setting is unusable.
    """
    tokens = access_tokens_of(http)
    app = FastAPI(
        title="NeNa status aggregator",
        version=version(DISTRIBUTION),
        openapi_url="/api/v1/openapi.json",
        docs_url=None,  # the interactive pages would load scripts from another host
        redoc_url=None,
    )
    problems.install(app)
    app.add_middleware(
        AccessControl,
        settings=http,
        role_needed=make_rule(http),
        users=users_of(http),
        cookies=True,
        oidc=tokens,
    )
    app.add_middleware(SecurityHeaders)
    app.include_router(session.make_router())
    app.include_router(oidc.make_router(sign_in_of(tokens), SystemClock()))
    app.include_router(fleet.make_router(aggregator))
    app.include_router(fleet.make_robots_router(aggregator))
    app.include_router(history.make_router(aggregator.history, aggregator.clock))
    for extension in aggregator.extensions:
        for router in extension.routers():
            app.include_router(router)
    control_settings = order_service or OrderServiceSettings()
    commands = control.OrderServiceClient(control_settings)
    app.include_router(attention.make_router(aggregator, control_settings.trusted_hosts))
    app.include_router(stops.make_router(commands, control_settings, aggregator))
    app.include_router(control.make_router(commands, control_settings.trusted_hosts))
    app.include_router(events.make_router(aggregator.events))
    app.include_router(make_problem_router(DESCRIBED, OPENAPI))
    app.include_router(make_health_router(aggregator, Exposition(aggregator)))
    describe_problems(app)
    app.mount("/reasons", PanelFiles(directory=TEXTS), name="reasons")
    app.mount("/", PanelFiles(directory=PANEL, html=True), name="panel")
    return app
