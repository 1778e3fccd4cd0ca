"""Health for those who watch processes, metrics for Prometheus."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4
from starlette.responses import PlainTextResponse, StreamingResponse

from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.metrics.exposition import Exposition
from nena_status_aggregator.rest.problem import ProblemError


def make_router(aggregator: Aggregator, exposition: Exposition) -> APIRouter:
    """Make the routes."""
    router = APIRouter(tags=["operation"])

    @router.get("/healthz")
    async def healthz() -> dict[str, str]:
        """Tell that the program lives."""
        return {"status": "ok"}

    @router.get("/readyz")
    async def readyz() -> dict[str, str]:
        """Tell whether the link to the broker stands and brings all; without it everything here grows old."""
        if not aggregator.model.link_up:
            detail = "No link to the MQTT broker. Is it running, and do --mqtt.host and --mqtt.port name it?"
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        if refused := aggregator.link.mqtt.state.refused:
            detail = f"The MQTT broker refuses to tell of {', '.join(refused)}: look at its access list."
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        return {"status": "ready"}

    @router.get("/metrics", response_class=PlainTextResponse)
    async def metrics() -> StreamingResponse:
        """Give all metrics in Prometheus's text format."""
        return StreamingResponse(exposition.stream(), media_type=CONTENT_TYPE_PLAIN_0_0_4)

    return router
