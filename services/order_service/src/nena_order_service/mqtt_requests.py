"""Reads requests that hosts publish."""

from __future__ import annotations

from http import HTTPStatus
from typing import TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import from_json

from nena_shared.fleet_api.transport_order import Problem
from nena_shared.misfits import TOLD
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.malformed import problems_of

M = TypeVar("M", bound=BaseModel)

TEXT_LIMIT = 200
"""Characters of a requestId, name or idempotencyKey at most."""


def read_request(message: Inbound, model: type[M], *, max_body: int) -> M | Problem:
    """Give the request, or what is wrong with it.

    A retained request is refused: the broker would deliver it again at each connect.
    """
    if message.retained:
        detail = "The request is retained, so it would come again. Publish it without the retain flag."
        return Problem(title="Retained request", status=HTTPStatus.BAD_REQUEST, detail=detail)
    if len(message.payload) > max_body:
        detail = f"The request is longer than {max_body} bytes. Send less at once."
        return Problem(title="Too long", status=HTTPStatus.REQUEST_ENTITY_TOO_LARGE, detail=detail)
    try:
        return model.model_validate_json(message.payload, by_alias=True, by_name=False)
    except ValidationError as error:
        problems = problems_of(error, TOLD)
        no_json = error.error_count() == 1 and error.errors()[0]["type"] == "json_invalid"
        return Problem(
            title="Not JSON" if no_json else "Request does not fit",
            status=HTTPStatus.BAD_REQUEST if no_json else HTTPStatus.UNPROCESSABLE_ENTITY,
            detail="The request has not the form that it needs. Correct what errors names.",
            errors=tuple(problems),
        )


def text_in(message: Inbound, key: str, *, max_body: int) -> str | None:
    """Give a text of a request that is refused, so that its host knows which one was; None: it has none."""
    if len(message.payload) > max_body:
        return None
    try:
        body = from_json(message.payload)
    except ValueError:
        return None
    text = body.get(key) if isinstance(body, dict) else None
    return text if isinstance(text, str) and 0 < len(text) <= TEXT_LIMIT else None
