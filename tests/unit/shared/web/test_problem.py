from __future__ import annotations

import json
from http import HTTPStatus

from nena_shared.fleet_api.transport_order import Problem
from nena_shared.web.problem import answer, refusal


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
