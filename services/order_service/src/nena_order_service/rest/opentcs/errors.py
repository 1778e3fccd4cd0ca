"""Errors as openTCS's clients expect them: a JSON array of sentences."""

from __future__ import annotations

import json
from http import HTTPStatus

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.exceptions import HTTPException

from nena_order_service.problems import FORESEEN, problem_of
from nena_shared.log import get_logger
from nena_shared.misfits import TOLD, in_words
from nena_shared.web.described import describe_problems

log = get_logger(__name__)


class NotPossibleError(Exception):
    """Something that openTCS can do and NeNa cannot, or not that way."""

    def __init__(self, *reasons: str) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = reasons


def answer(status: int, reasons: tuple[str, ...], headers: dict[str, str] | None = None) -> Response:
    """Put sentences into a response."""
    return Response(json.dumps(reasons), status, headers, "application/json")


def install(app: FastAPI) -> None:
    """Let every error of ``app`` be answered as openTCS does, and described.

    What is refused before it comes here (too much, too often, by nobody known) is answered with a problem.
    """
    describe_problems(app, {"application/json": {"type": "array", "items": {"type": "string"}}})

    @app.exception_handler(RequestValidationError)
    async def malformed(_request: Request, error: RequestValidationError) -> Response:
        return answer(
            HTTPStatus.BAD_REQUEST, tuple(in_words(error.errors(), whole="body", root="body", most=TOLD))
        )

    @app.exception_handler(ValidationError)
    async def misfit(_request: Request, error: ValidationError) -> Response:
        return answer(
            HTTPStatus.BAD_REQUEST, tuple(in_words(error.errors(), whole="body", root="body", most=TOLD))
        )

    @app.exception_handler(HTTPException)
    async def refused(_request: Request, error: HTTPException) -> Response:
        return answer(error.status_code, (str(error.detail),), dict(error.headers or {}))

    @app.exception_handler(NotPossibleError)
    async def not_possible(_request: Request, error: NotPossibleError) -> Response:
        return answer(HTTPStatus.BAD_REQUEST, error.reasons)

    async def foreseen(_request: Request, error: Exception) -> Response:
        problem = problem_of(error)
        # openTCS knows no 422.
        status = (
            HTTPStatus.BAD_REQUEST if problem.status == HTTPStatus.UNPROCESSABLE_ENTITY else problem.status
        )
        return answer(status, problem.errors or (problem.detail,))

    for kind in FORESEEN:
        app.add_exception_handler(kind, foreseen)

    @app.exception_handler(Exception)
    async def failed(request: Request, error: Exception) -> Response:
        log.error("request failed", path=request.url.path, exc_info=error)
        return answer(HTTPStatus.INTERNAL_SERVER_ERROR, (problem_of(error).detail,))
