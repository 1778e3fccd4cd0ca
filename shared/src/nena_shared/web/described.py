"""What an interface says of its errors: all have one form, as problems (RFC 9457) do."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
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
    _, known = models_json_schema([(Problem, "serialization")], ref_template=REFERENCES)
    describe_errors(app, MEDIA_TYPE, {"$ref": REFERENCES.format(model=Problem.__name__)}, known["$defs"])


def describe_errors(
    app: FastAPI, media_type: str, schema: dict[str, Any], parts: Mapping[str, Any] = MappingProxyType({})
) -> None:
    """Have the description tell of errors at each operation, with bodies of one form.

    Args:
        app: is described.
        media_type: of every error.
        schema: of every error; may refer to ``parts``.
        parts: schemas by their names.

    """
    plain = app.openapi
    content = {media_type: {"schema": schema}}
    errors = {status: {"description": text, "content": content} for status, text in ERRORS.items()}

    def described() -> dict[str, Any]:
        document = plain()
        for path in document["paths"].values():
            for method in METHODS & path.keys():
                responses = path[method]["responses"]
                responses.pop(VALIDATION, None)
                responses |= errors
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        schemas |= parts
        return document

    app.openapi = described  # type: ignore[method-assign]
