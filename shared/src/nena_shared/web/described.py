"""What an interface says of its errors: each is a problem (RFC 9457), whatever the operation."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from pydantic.json_schema import models_json_schema

from nena_shared.fleet_api.transport_order import Problem
from nena_shared.web.problem import MEDIA_TYPE

REFERENCES = "#/components/schemas/{model}"
METHODS = frozenset({"get", "put", "post", "patch", "delete"})
VALIDATION = "422"
"""What FastAPI says of its own of requests that do not fit; they are answered with problems here."""
ERRORS = {
    "4XX": "What is wrong with the request, and what to do.",
    "5XX": "What failed, and what to do.",
}


def describe_problems(app: FastAPI) -> None:
    """Have the OpenAPI description of ``app`` tell of problems at each operation.

    Errors that a route describes by their exact status stay as they are described.
    """
    plain = app.openapi

    def described() -> dict[str, Any]:
        document = plain()
        for path in document["paths"].values():
            for method in METHODS & path.keys():
                responses = path[method]["responses"]
                responses.pop(VALIDATION, None)
                responses |= {status: _problem(text) for status, text in ERRORS.items()}
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        _, known = models_json_schema([(Problem, "serialization")], ref_template=REFERENCES)
        schemas |= known["$defs"]
        return document

    app.openapi = described  # type: ignore[method-assign]


def _problem(text: str) -> dict[str, Any]:
    schema = {"$ref": REFERENCES.format(model=Problem.__name__)}
    return {"description": text, "content": {MEDIA_TYPE: {"schema": schema}}}
