from __future__ import annotations

import json
from http import HTTPStatus
from typing import Any

import pytest
from fastapi import FastAPI

from nena_shared.fleet_api.transport_order import Problem
from nena_shared.web.problem import MEDIA_TYPE, answer, describe_problems, refusal


def test_problem_response_has_its_status_and_media_type() -> None:
    problem = Problem(title="Conflict", status=409, detail="It has ended.", errors=("one", "two"))

    found = answer(problem, {"Retry-After": "3"})

    assert (found.status_code, found.media_type) == (409, "application/problem+json")
    assert found.headers["retry-after"] == "3"
    assert Problem.model_validate_json(bytes(found.body)) == problem


def test_a_refusal_is_titled_by_its_status() -> None:
    told = json.loads(bytes(refusal(HTTPStatus.TOO_MANY_REQUESTS, "Wait a moment.").body))

    assert (told["title"], told["status"]) == ("Too Many Requests", 429)
    assert told["detail"] == "Wait a moment."


@pytest.fixture
def document() -> dict[str, Any]:
    app = FastAPI()

    @app.get("/{number}", responses={404: {"description": "It is not there."}})
    async def show(number: int) -> int:
        return number

    @app.post("/")
    async def create(name: str) -> str:
        return name

    describe_problems(app)
    return app.openapi()


def test_each_operation_may_answer_with_a_problem(document: dict[str, Any]) -> None:
    operations = [document["paths"]["/{number}"]["get"], document["paths"]["/"]["post"]]
    for operation in operations:
        for status in ("4XX", "5XX"):
            content = operation["responses"][status]["content"]
            assert content == {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    assert "detail" in document["components"]["schemas"]["Problem"]["properties"]


def test_fastapi_validation_error_schema_is_removed(document: dict[str, Any]) -> None:
    assert "422" not in document["paths"]["/{number}"]["get"]["responses"]


def test_errors_documented_by_a_route_are_unchanged(document: dict[str, Any]) -> None:
    told = document["paths"]["/{number}"]["get"]["responses"]["404"]
    assert told["description"] == "It is not there."
