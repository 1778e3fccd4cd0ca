"""Responses of ``/metrics``: Prometheus's text format, compressed for clients that accept gzip."""

from __future__ import annotations

import asyncio
import gzip
import re
import zlib
from collections.abc import AsyncIterator
from typing import Final

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

METRICS: Final = "/metrics"
CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"

GZIP_LEVEL = 4
"""Compression level; higher ones take longer and gain little, as names and labels repeat."""
GZIP_SLICE = 256 * 1024
"""Bytes compressed in one piece, which takes some milliseconds."""


def takes_gzip(accept_encoding: str) -> bool:
    """Return whether an Accept-Encoding header accepts gzip."""
    for each in accept_encoding.lower().split(","):
        name, *parameters = (part.strip() for part in each.split(";"))
        refused = any(re.fullmatch(r"q=0(\.0*)?", parameter) for parameter in parameters)
        if name in ("gzip", "*") and not refused:
            return True
    return False


def _wants_gzip(request: Request) -> bool:
    return takes_gzip(request.headers.get("accept-encoding", ""))


async def gzipped(parts: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """Compress parts of a response as they arrive; the event loop runs other tasks in between."""
    compressor = zlib.compressobj(GZIP_LEVEL, zlib.DEFLATED, zlib.MAX_WBITS | 16)
    async for part in parts:
        for start in range(0, len(part), GZIP_SLICE):
            yield compressor.compress(part[start : start + GZIP_SLICE])
            await asyncio.sleep(0)
    yield compressor.flush()


def metrics_response(request: Request, text: bytes) -> Response:
    """Return the response of a scrape, from a short text."""
    headers = {"vary": "Accept-Encoding"}
    if _wants_gzip(request):
        headers["content-encoding"] = "gzip"
        text = gzip.compress(text, GZIP_LEVEL)
    return Response(text, media_type=CONTENT_TYPE, headers=headers)


def metrics_stream(request: Request, parts: AsyncIterator[bytes]) -> StreamingResponse:
    """Return the streaming response of a scrape, for megabytes of text in ``parts``."""
    headers = {"vary": "Accept-Encoding"}
    if _wants_gzip(request):
        headers["content-encoding"] = "gzip"
        parts = gzipped(parts)
    return StreamingResponse(parts, media_type=CONTENT_TYPE, headers=headers)
