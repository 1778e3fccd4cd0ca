"""Responses that are compressed for clients that accept gzip."""

from __future__ import annotations

import gzip
import re

from starlette.requests import Request
from starlette.responses import Response

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


def compressed(request: Request, content: bytes, media_type: str) -> Response:
    """Return a response with ``content``, compressed if the client accepts it."""
    headers = {"vary": "Accept-Encoding"}
    if takes_gzip(request.headers.get("accept-encoding", "")):
        headers["content-encoding"] = "gzip"
        content = gzip.compress(content, GZIP_LEVEL)
    return Response(content, media_type=media_type, headers=headers)
