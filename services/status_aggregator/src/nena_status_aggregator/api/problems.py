"""Responses: JSON, and errors as problem details (RFC 9457)."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any, TypeVar

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic_core import to_json
from starlette.exceptions import HTTPException

from nena_shared.findings import FINDINGS_SHOWN, in_words
from nena_shared.fleet_api.refusals import MalformedRequest, ProblemType
from nena_shared.log import get_logger
from nena_shared.web.problem import refusal

log = get_logger(__name__)


class ProblemError(Exception):
    """A request failed; ``detail`` explains why and what to do."""

    def __init__(self, kind: ProblemType, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind
        self.detail = detail


def install(app: FastAPI) -> None:
    """Make ``app`` answer every error with problem details."""

    async def on_problem(_request: Request, error: ProblemError) -> Response:
        return refusal(error.kind.status, error.detail, kind=error.kind)

    async def on_http_error(request: Request, error: HTTPException) -> Response:
        status, kind, detail = HTTPStatus(error.status_code), None, str(error.detail)
        if status is HTTPStatus.NOT_FOUND:
            kind = MalformedRequest.UNKNOWN_RESOURCE
            detail = f"No resource at {request.url.path}; see /api/v1/openapi.json."
        return refusal(status, detail, error.headers, kind=kind)

    async def on_invalid(_request: Request, error: RequestValidationError) -> Response:
        errors = tuple(in_words(error.errors(), whole="request", most=FINDINGS_SHOWN))
        kind = MalformedRequest.INVALID_REQUEST
        return refusal(kind.status, "Invalid request; see errors.", errors=errors, kind=kind)

    async def on_failure(request: Request, error: Exception) -> Response:
        log.error("request failed", path=request.url.path, exc_info=error)
        detail = "Internal error; see the log of the status aggregator."
        kind = MalformedRequest.INTERNAL_ERROR
        return refusal(kind.status, detail, kind=kind)

    app.exception_handler(ProblemError)(on_problem)
    app.exception_handler(HTTPException)(on_http_error)
    app.exception_handler(RequestValidationError)(on_invalid)
    app.exception_handler(Exception)(on_failure)


T = TypeVar("T")


def require(thing: T | None, kind: ProblemType, detail: str) -> T:
    """Return ``thing``; raise a problem of this kind with ``detail`` if it is None."""
    if thing is None:
        raise ProblemError(kind, detail)
    return thing


def as_json(content: Any) -> Response:  # noqa: ANN401 - any of the views
    """Return a JSON response; the views have the names on the wire."""
    return Response(to_json(content), media_type="application/json")
