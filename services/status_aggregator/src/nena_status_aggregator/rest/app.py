"""The HTTP application."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from fastapi import FastAPI
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from nena_shared.clock import SystemClock
from nena_shared.web.access import AccessControl
from nena_shared.web.described import describe_problems
from nena_shared.web.oidc.enabled import access_tokens_of
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import users_of
from nena_status_aggregator import panel
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.metrics.exposition import Exposition
from nena_status_aggregator.metrics.fleet_collector import DISTRIBUTION
from nena_status_aggregator.rest import (
    control,
    events,
    health,
    history,
    problem,
    resources,
    robots,
    session,
    sign_in,
)
from nena_status_aggregator.rest.roles import make_rule
from nena_status_aggregator.rest.security_headers import SecurityHeaders
from nena_status_aggregator.settings import OrderServiceSettings
from nena_status_aggregator.sign_in import sign_in_of

PANEL = Path(panel.__file__).parent / "static"


class PanelFiles(StaticFiles):
    """The page's files; a browser asks each time whether they are still the same."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Give one file."""
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = "no-cache"
        return response


def make_app(
    aggregator: Aggregator, http: HttpSettings, order_service: OrderServiceSettings | None = None
) -> FastAPI:
    """Make the application over ``aggregator``; it starts nothing by itself.

    Without ``order_service`` the panel gives no commands.

    Raises:
        ConfigurationError: the file of users or a setting of the issuer cannot be used.

    """
    tokens = access_tokens_of(http)
    app = FastAPI(
        title="NeNa status aggregator",
        version=version(DISTRIBUTION),
        openapi_url="/api/v1/openapi.json",
        docs_url=None,  # the interactive pages would load scripts from another host
        redoc_url=None,
    )
    problem.install(app)
    app.add_middleware(
        AccessControl,
        settings=http,
        role_needed=make_rule(http),
        book=users_of(http),
        cookies=True,
        oidc=tokens,
    )
    app.add_middleware(SecurityHeaders)
    app.include_router(session.make_router())
    app.include_router(sign_in.make_router(sign_in_of(tokens), SystemClock()))
    app.include_router(resources.make_router(aggregator))
    app.include_router(robots.make_router(aggregator))
    app.include_router(history.make_router(aggregator.history))
    app.include_router(control.make_router(order_service or OrderServiceSettings()))
    app.include_router(events.make_router(aggregator.events))
    app.include_router(health.make_router(aggregator, Exposition(aggregator)))
    describe_problems(app)
    app.mount("/", PanelFiles(directory=PANEL, html=True), name="panel")
    return app
