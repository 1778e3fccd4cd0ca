"""Answers of openTCS's web API: bodies, and errors as arrays of sentences."""

from __future__ import annotations

import json
from collections.abc import Mapping
from http import HTTPStatus
from typing import Final

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import ConfigDict, ValidationError
from starlette.exceptions import HTTPException

from nena_order_service.api import problems
from nena_shared.findings import FINDINGS_SHOWN, in_words
from nena_shared.fleet_api.base import CamelCase
from nena_shared.log import get_logger
from nena_shared.web.problem import describe_problems

log = get_logger(__name__)


class Body(CamelCase):
    """A JSON object; openTCS fields that NeNa does not have are ignored."""

    model_config = ConfigDict(extra="ignore")


class NotPossibleError(Exception):
    """openTCS can do this, but NeNa cannot, or not in this way."""


FORESEEN: Final[tuple[type[Exception], ...]] = (
    RequestValidationError,
    ValidationError,
    HTTPException,
    NotPossibleError,
    *problems.FORESEEN,
)
"""Errors that are answers to hosts, not faults of the service."""


def install_error_answers(app: FastAPI) -> None:
    """Answer every error of ``app`` like openTCS, and document it.

    Requests refused before they get here (too large, too frequent, not logged in) get a problem.
    """
    describe_problems(app, {"application/json": {"type": "array", "items": {"type": "string"}}})

    async def answer_error(request: Request, error: Exception) -> Response:
        return response_to(request, error)

    for kind in (*FORESEEN, Exception):
        app.add_exception_handler(kind, answer_error)


def response_to(request: Request, error: Exception) -> Response:
    """Return the answer to a request that raised an error; an unexpected error is logged."""
    status: int = HTTPStatus.BAD_REQUEST
    headers: Mapping[str, str] | None = None
    reasons: tuple[str, ...]
    match error:
        case RequestValidationError() | ValidationError():
            reasons = tuple(in_words(error.errors(), whole="body", root="body", most=FINDINGS_SHOWN))
        case HTTPException():
            status, reasons, headers = error.status_code, (str(error.detail),), error.headers
        case NotPossibleError():
            reasons = (str(error),)
        case _:
            if not isinstance(error, FORESEEN):
                log.error("request failed", path=request.url.path, exc_info=error)
            problem = problems.problem_of(error)
            status, reasons = problem.status, problem.errors or (problem.detail,)
            if status == HTTPStatus.UNPROCESSABLE_ENTITY:  # openTCS has no 422
                status = HTTPStatus.BAD_REQUEST
    return Response(json.dumps(reasons), status, headers, "application/json")
