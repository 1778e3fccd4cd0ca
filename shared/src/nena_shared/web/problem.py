"""HTTP errors as problem details (RFC 9457), in responses and OpenAPI documents."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from http import HTTPStatus
from types import MappingProxyType
from typing import Any

from fastapi import APIRouter, FastAPI, HTTPException
from pydantic.json_schema import models_json_schema
from starlette.responses import HTMLResponse, Response

from nena_shared.fleet_api.refusals import PROBLEMS, ProblemType
from nena_shared.fleet_api.transport_order import Problem

MEDIA_TYPE = "application/problem+json"


def answer(problem: Problem, headers: Mapping[str, str] | None = None) -> Response:
    """Return a response with a problem."""
    return Response(
        problem.model_dump_json(by_alias=True, exclude_none=True),
        status_code=problem.status,
        media_type=MEDIA_TYPE,
        headers=headers,
    )


def refusal(
    status: HTTPStatus,
    detail: str,
    headers: Mapping[str, str] | None = None,
    errors: tuple[str, ...] = (),
    *,
    kind: ProblemType | None = None,
) -> Response:
    """Return an error response; ``detail`` explains what to do. Without a kind, the status says all."""
    problem = Problem(title=status.phrase, status=status, detail=detail, errors=errors)
    if kind is not None:
        # 0064: relative, so that it is the same at every site, and over MQTT
        problem = problem.model_copy(update={"type": kind.uri})
    return answer(problem, headers)


def make_problem_router(kinds: Mapping[str, ProblemType], api: str) -> APIRouter:
    """Create the route of the pages about types of problems; ``api`` is the path of the API's description."""
    router = APIRouter()

    @router.get(f"{PROBLEMS}/{{name}}", include_in_schema=False)
    async def problem(name: str) -> HTMLResponse:
        """Describe a type of problem."""
        kind = kinds.get(f"{PROBLEMS}/{name}")
        if kind is None:
            raise HTTPException(HTTPStatus.NOT_FOUND)
        meaning = escape(kind.meaning)
        return HTMLResponse(
            f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{meaning}</title>'
            f"<h1>{meaning}</h1><p>HTTP status {int(kind.status)}, {kind.status.phrase}. "
            f"Problem type <code>{kind.uri}</code>.</p>"
            f"<h2>What to do</h2><p>{escape(kind.remedy.replace('`', ''))}</p>"
            f'<p><a href="..{api}">REST API</a></p></html>\n'
        )

    return router


REFERENCES = "#/components/schemas/{model}"
METHODS = frozenset({"get", "put", "post", "patch", "delete"})
VALIDATION = "422"
"""FastAPI's status of invalid requests, which get problem details here."""
ERRORS = {
    "4XX": "What is wrong with the request, and what to do.",
    "5XX": "What failed, and what to do.",
}


def problem_response(description: str) -> dict[str, Any]:
    """Return the OpenAPI description of a problem."""
    schema = {"$ref": REFERENCES.format(model=Problem.__name__)}
    return {"description": description, "content": {MEDIA_TYPE: {"schema": schema}}}


def describe_problems(app: FastAPI, others: Mapping[str, Any] = MappingProxyType({})) -> None:
    """Add problems to each operation in the OpenAPI document of ``app``.

    Errors that a route documents by their exact status stay unchanged.

    Args:
        app: the application.
        others: schemas of other error formats, by media type.
    """
    plain = app.openapi
    problem = {"$ref": REFERENCES.format(model=Problem.__name__)}
    content = {kind: {"schema": schema} for kind, schema in {MEDIA_TYPE: problem, **others}.items()}
    errors = {status: {"description": text, "content": content} for status, text in ERRORS.items()}
    _, known = models_json_schema([(Problem, "serialization")], ref_template=REFERENCES)

    def described() -> dict[str, Any]:
        document = plain()
        for path in document["paths"].values():
            for method in METHODS & path.keys():
                responses = path[method]["responses"]
                if MEDIA_TYPE not in responses.get(VALIDATION, {}).get("content", {}):
                    responses.pop(VALIDATION, None)
                responses |= errors
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        schemas |= known["$defs"]
        return document

    # FastAPI's documented way to extend its document
    app.openapi = described  # type: ignore[method-assign]
