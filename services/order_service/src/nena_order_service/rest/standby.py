"""What an order service answers that stands by: it is well, and hosts are to go to the active one."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus

from fastapi import FastAPI, Request, Response

from nena_order_service.rest import problems
from nena_order_service.rest.bodies import Readiness
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.web.problem import answer

RETRY_AFTER = "1"
"""Seconds; a takeover takes a few."""

METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]


def make_standby_app(active_url: Callable[[], str], problem: Callable[[], str]) -> FastAPI:
    """Make the ASGI application.

    Args:
        active_url: tells where the active order service is; empty where that is not known.
        problem: tells why the database cannot be asked for that; empty where it can.

    """
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    problems.install(app)

    @app.get("/healthz")
    async def alive() -> Response:
        return Response("ok\n", media_type="text/plain")

    @app.get("/readyz")
    async def ready() -> Response:
        where = f"The active one is {active_url()}." if active_url() else "It is not known which is active."
        said = [f"This order service stands by. {where}"]
        if problem():
            said.append(f"The database does not answer ({problem()}): no takeover is possible now.")
        body = Readiness(
            ready=False,
            role="standby",
            broker_connected=False,
            store_ready=not problem(),
            problems=tuple(said),
        )
        status = HTTPStatus.SERVICE_UNAVAILABLE
        return Response(body.model_dump_json(by_alias=True), status, media_type="application/json")

    @app.api_route("/{path:path}", methods=METHODS)
    async def elsewhere(request: Request) -> Response:
        raw: bytes = request.scope["raw_path"]  # as it came: names may have letters that no header holds
        return _go_there(active_url(), raw.decode("ascii"))

    return app


def _go_there(active_url: str, path: str) -> Response:
    status = HTTPStatus.SERVICE_UNAVAILABLE
    where = (
        f"Send the request to the active one: {active_url}{path}"
        if active_url
        else "It is not known yet which is active. Try again in a moment, here and at the others"
    )
    problem = Problem(title="Standing by", status=status, detail=f"This order service stands by. {where}.")
    headers = {"Retry-After": RETRY_AFTER}
    if active_url:
        headers["Link"] = f'<{active_url}{path}>; rel="alternate"'
    return answer(problem, headers)
