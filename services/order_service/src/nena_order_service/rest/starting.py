"""What an order service answers that cannot take up its orders yet: it is well, and what it waits for."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus

from fastapi import FastAPI, Response

from nena_order_service.rest import problems
from nena_order_service.rest.bodies import Readiness
from nena_order_service.rest.standby import METHODS, RETRY_AFTER
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.web.problem import answer


def make_starting_app(problem: Callable[[], str]) -> FastAPI:
    """Make the ASGI application; ``problem`` tells why the store takes nothing."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    problems.install(app)
    status = HTTPStatus.SERVICE_UNAVAILABLE

    def said() -> str:
        why = f" ({problem()})" if problem() else ""
        return (
            f"This order service starts, and waits until its store takes something{why}. "
            "Look at the disk or server of store.url; it goes on by itself."
        )

    @app.get("/healthz")
    async def alive() -> Response:
        return Response("ok\n", media_type="text/plain")

    @app.get("/readyz")
    async def ready() -> Response:
        body = Readiness(
            ready=False, role="starting", broker_connected=False, store_ready=False, problems=(said(),)
        )
        return Response(body.model_dump_json(by_alias=True), status, media_type="application/json")

    @app.api_route("/{path:path}", methods=METHODS)
    async def later() -> Response:
        told = Problem(title="Starting", status=status, detail=said())
        return answer(told, {"Retry-After": RETRY_AFTER})

    return app
