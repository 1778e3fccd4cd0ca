"""What the resources answer with."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any, TypeVar

from fastapi import Response
from pydantic_core import to_json

from nena_status_aggregator.rest.problem import ProblemError

T = TypeVar("T")


def found(thing: T | None, detail: str) -> T:
    """Give ``thing``; where there is none, the answer is 404 with ``detail``."""
    if thing is None:
        raise ProblemError(HTTPStatus.NOT_FOUND, detail)
    return thing


def as_json(content: Any) -> Response:  # noqa: ANN401 - any of the views
    """Give it as it is: the views have the names on the wire."""
    return Response(to_json(content), media_type="application/json")
