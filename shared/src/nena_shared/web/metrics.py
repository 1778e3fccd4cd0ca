"""Responses of ``/metrics``: Prometheus's text format, compressed for clients that accept gzip."""

from __future__ import annotations

from typing import Final

from starlette.requests import Request
from starlette.responses import Response

from nena_shared.web.compression import compressed

METRICS: Final = "/metrics"
CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"


def metrics_response(request: Request, text: bytes) -> Response:
    """Return the response of a scrape."""
    return compressed(request, text, CONTENT_TYPE)
