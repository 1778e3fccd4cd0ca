"""Maps each error of the order service to one problem (RFC 9457), the same over REST and MQTT."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from nena_order_service.errors import RefusedError
from nena_order_service.orders.validation import InvalidRequestError
from nena_shared.findings import FINDINGS_SHOWN, in_words
from nena_shared.fleet_api.refusals import MalformedRequest, Refusal
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.log import get_logger
from nena_shared.web.problem import answer

log = get_logger(__name__)

FORESEEN: tuple[type[Exception], ...] = (InvalidRequestError, RefusedError)
"""Errors that are answers to hosts, not faults of the service."""


def problem_of(error: Exception) -> Problem:
    """Return the problem for an error; an unexpected error reveals no internals."""
    if isinstance(error, InvalidRequestError):
        refusal = Refusal.UNKNOWN_IN_PLANT if error.only_unknown else Refusal.NOT_IN_PLANT
        return Problem(
            type=refusal.uri,
            title="Not possible in this plant",
            status=refusal.status,
            detail="The request does not fit the plant model; nothing was created. Fix what errors lists.",
            errors=tuple(str(finding.text) for finding in error.findings),
        )
    if not isinstance(error, RefusedError):
        return Problem(
            type=MalformedRequest.INTERNAL_ERROR.uri,
            title="Internal error",
            status=HTTPStatus.INTERNAL_SERVER_ERROR,
            detail="Internal error; the log of the order service has the details. Please report it.",
        )
    refusal, problems = error.refusal, getattr(error, "problems", ())
    status = refusal.status
    return Problem(type=refusal.uri, title=status.phrase, status=status, detail=str(error), errors=problems)


def response_to(request: Request, error: Exception) -> Response:
    """Return the answer to a request that raised an error; an unexpected error is logged."""
    if isinstance(error, RequestValidationError):
        return answer(_problem_of_validation(request, error))
    if isinstance(error, HTTPException):
        return answer(_problem_of_status(request, error), dict(error.headers or {}))
    if not isinstance(error, FORESEEN):
        log.error("request failed", path=request.url.path, exc_info=error)
    return answer(problem_of(error))


def install(app: FastAPI) -> None:
    """Answer every error of ``app`` with a problem."""

    async def answered(request: Request, error: Exception) -> Response:
        return response_to(request, error)

    for kind in (RequestValidationError, HTTPException, *FORESEEN, Exception):
        app.add_exception_handler(kind, answered)


def _problem_of_validation(request: Request, error: RequestValidationError) -> Problem:
    findings = error.errors()
    content_type = request.headers.get("content-type", "no content type")
    # FastAPI does not parse a body of another content type, and reports that it is no object.
    if "json" not in content_type and any(item["loc"][0] == "body" for item in findings):
        return Problem(
            title="Not JSON",
            status=HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
            detail=f"The body is {content_type}. Send a JSON object with Content-Type: application/json.",
        )
    if any(item["type"] == "json_invalid" for item in findings):
        return Problem(
            type=MalformedRequest.NOT_JSON.uri,
            title="Not JSON",
            status=HTTPStatus.BAD_REQUEST,
            detail="The body is not JSON. Send a JSON object with Content-Type: application/json.",
            errors=tuple(str(item.get("ctx", {}).get("error", item["msg"])) for item in findings),
        )
    return Problem(
        type=MalformedRequest.INVALID_REQUEST.uri,
        title="Request does not fit",
        status=HTTPStatus.UNPROCESSABLE_ENTITY,
        detail="The request is malformed. Fix the problems listed in errors; see /docs.",
        errors=tuple(in_words(findings, whole="body", root="body", most=FINDINGS_SHOWN)),
    )


def _problem_of_status(request: Request, error: HTTPException) -> Problem:
    details = {
        HTTPStatus.NOT_FOUND: f"Unknown path {request.url.path}; see /docs.",
        HTTPStatus.METHOD_NOT_ALLOWED: f"{request.method} is not supported at this path; see /docs.",
    }
    status = HTTPStatus(error.status_code)
    detail = details.get(status, str(error.detail))
    if status is HTTPStatus.NOT_FOUND:
        kind = MalformedRequest.UNKNOWN_RESOURCE.uri
        return Problem(type=kind, title=status.phrase, status=status, detail=detail)
    return Problem(title=status.phrase, status=status, detail=detail)
