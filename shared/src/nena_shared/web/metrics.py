"""Responses of ``/metrics``: Prometheus's text format, compressed for clients that accept gzip."""

from __future__ import annotations

import gzip
import re
from typing import Final

from starlette.requests import Request
from starlette.responses import Response

METRICS: Final = "/metrics"
CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"

GZIP_LEVEL = 4
"""Compression level; higher ones take longer and gain little, as names and labels repeat."""


def takes_gzip(accept_encoding: str) -> bool:
    """Return whether an Accept-Encoding header accepts gzip."""
    for each in accept_encoding.lower().split(","):
        name, *parameters = (part.strip() for part in each.split(";"))
        # RFC 9110, 12.4.2: a weight of 0 means that it is not accepted
        refused = any(re.fullmatch(r"q=0(\.0*)?", parameter) for parameter in parameters)
        if name in ("gzip", "*") and not refused:
            return True
    return False


def _wants_gzip(request: Request) -> bool:
    return takes_gzip(request.headers.get("accept-encoding", ""))


def metrics_response(request: Request, text: bytes) -> Response:
    """Return the response of a scrape."""
    headers = {"vary": "Accept-Encoding"}
    if _wants_gzip(request):
        headers["content-encoding"] = "gzip"
        text = gzip.compress(text, GZIP_LEVEL)
    return Response(text, media_type=CONTENT_TYPE, headers=headers)
