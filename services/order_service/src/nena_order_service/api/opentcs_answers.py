"""Answers of openTCS's web API: bodies, and errors as arrays of sentences."""

from __future__ import annotations

import json
from http import HTTPStatus
from math import degrees

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import ConfigDict, ValidationError
from starlette.exceptions import HTTPException

from nena_order_service.api.problems import FORESEEN, problem_of
from nena_shared.findings import FINDINGS_SHOWN, in_words
from nena_shared.fleet_api.base import CamelCase
from nena_shared.fleet_api.vehicle import PrecisePosition
from nena_shared.log import get_logger
from nena_shared.web.problem import describe_problems

log = get_logger(__name__)


class Body(CamelCase):
    """A JSON object; openTCS fields that NeNa does not have are ignored."""

    model_config = ConfigDict(extra="ignore")


class NotPossibleError(Exception):
    """openTCS can do this, but NeNa cannot, or not in this way."""

    def __init__(self, *reasons: str) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = reasons


def answer(status: int, reasons: tuple[str, ...], headers: dict[str, str] | None = None) -> Response:
    """Return a response with an array of sentences."""
    return Response(json.dumps(reasons), status, headers, "application/json")


def _findings(error: RequestValidationError | ValidationError) -> tuple[str, ...]:
    return tuple(in_words(error.errors(), whole="body", root="body", most=FINDINGS_SHOWN))


def install(app: FastAPI) -> None:
    """Answer every error of ``app`` like openTCS, and document it.

    Requests refused before they get here (too large, too frequent, not logged in) get a problem.
    """
    describe_problems(app, {"application/json": {"type": "array", "items": {"type": "string"}}})

    @app.exception_handler(RequestValidationError)
    async def malformed(_request: Request, error: RequestValidationError) -> Response:
        return answer(
            HTTPStatus.BAD_REQUEST,
            _findings(error),
        )

    @app.exception_handler(ValidationError)
    async def invalid(_request: Request, error: ValidationError) -> Response:
        return answer(
            HTTPStatus.BAD_REQUEST,
            _findings(error),
        )

    @app.exception_handler(HTTPException)
    async def refused(_request: Request, error: HTTPException) -> Response:
        return answer(error.status_code, (str(error.detail),), dict(error.headers or {}))

    @app.exception_handler(NotPossibleError)
    async def not_possible(_request: Request, error: NotPossibleError) -> Response:
        return answer(HTTPStatus.BAD_REQUEST, error.reasons)

    async def foreseen(_request: Request, error: Exception) -> Response:
        problem = problem_of(error)
        # openTCS has no 422.
        wrong = problem.status == HTTPStatus.UNPROCESSABLE_ENTITY
        return answer(
            HTTPStatus.BAD_REQUEST if wrong else problem.status, problem.errors or (problem.detail,)
        )

    for kind in FORESEEN:
        app.add_exception_handler(kind, foreseen)

    @app.exception_handler(Exception)
    async def failed(request: Request, error: Exception) -> Response:
        log.error("request failed", path=request.url.path, exc_info=error)
        return answer(HTTPStatus.INTERNAL_SERVER_ERROR, (problem_of(error).detail,))


def angle_of(position: PrecisePosition | None) -> float | str:
    """Return the heading of a vehicle, degrees; ``NaN`` if it is unknown."""
    return round(degrees(position.theta), 3) if position else "NaN"


def done() -> Response:
    """Return the answer to a successful change."""
    return Response(status_code=HTTPStatus.OK)
