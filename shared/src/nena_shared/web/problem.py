"""An error as a problem (RFC 9457)."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus

from starlette.responses import Response

from nena_shared.fleet_api.transport_order import Problem

MEDIA_TYPE = "application/problem+json"


def answer(problem: Problem, headers: Mapping[str, str] | None = None) -> Response:
    """Put a problem into a response."""
    return Response(
        problem.model_dump_json(by_alias=True, exclude_none=True),
        status_code=problem.status,
        media_type=MEDIA_TYPE,
        headers=headers,
    )


def refusal(status: HTTPStatus, detail: str, headers: Mapping[str, str] | None = None) -> Response:
    """Refuse a request; ``detail`` says what to do."""
    return answer(Problem(title=status.phrase, status=status, detail=detail), headers)
