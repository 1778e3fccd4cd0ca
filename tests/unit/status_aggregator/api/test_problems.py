from __future__ import annotations

import json

import httpx
import pytest

from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.problem_types import DESCRIBED, Rejection
from nena_status_aggregator.api.problems import ProblemError, as_json, require


@pytest.mark.parametrize(
    ("path", "word"),
    [
        ("/api/v1/plant", "Start the order service"),
        ("/api/v1/robots/ACME/none", "/api/v1/fleet lists"),
        ("/api/v1/nothing", "openapi.json"),
        ("/nothing.js", "openapi.json"),
    ],
)
async def test_unknown_path_is_a_problem_with_advice(client: httpx.AsyncClient, path: str, word: str) -> None:
    answer = await client.get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["status"] == 404
    assert word in answer.json()["detail"]


async def test_a_wrong_method_and_a_wrong_value_are_problems(client: httpx.AsyncClient) -> None:
    refused = await client.post("/api/v1/fleet")
    assert (refused.status_code, refused.json()["status"]) == (405, 405)
    assert "GET" in refused.headers["allow"]
    invalid = await client.get("/api/v1/events", params={"after": "x" * 101})
    assert invalid.status_code == 422
    assert invalid.json()["errors"][0].startswith("query.after:")


async def test_internal_error_is_a_problem_without_details(
    client: httpx.AsyncClient, aggregator: Aggregator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(aggregator.model, "snapshot", lambda: 1 / 0)
    answer = await client.get("/api/v1/fleet")
    assert answer.status_code == 500
    assert "division" not in answer.text


def test_found_value_is_returned_even_if_empty() -> None:
    assert require([], Rejection.NO_MAP, "nothing") == []
    assert require(0, Rejection.NO_MAP, "nothing") == 0


def test_missing_resource_is_a_problem_with_advice() -> None:
    with pytest.raises(ProblemError, match="Start one") as caught:
        require(None, Rejection.NO_MAP, "Start one.")
    assert caught.value.kind is Rejection.NO_MAP


def test_views_are_serialised_unchanged() -> None:
    answer = as_json({"stateAge": None, "robots": ("ä",)})
    assert answer.headers["content-type"] == "application/json"
    assert json.loads(bytes(answer.body)) == {"stateAge": None, "robots": ["ä"]}


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/api/v1/plant", "no-plant-model"),
        ("/api/v1/robots/ACME/none", "unknown-robot"),
        ("/api/v1/nothing", "unknown-resource"),
        ("/api/v1/events?after=" + "x" * 101, "invalid-request"),
        ("/api/v1/control/vehicles", "untrusted-page"),
        ("/readyz", "not-ready"),
    ],
)
async def test_problem_has_a_stable_type_with_a_page(client: httpx.AsyncClient, path: str, kind: str) -> None:
    answer = await client.get(path)
    assert answer.json()["type"] == f"/problems/{kind}"
    assert answer.status_code == DESCRIBED[answer.json()["type"]].status

    page = await client.get(answer.json()["type"])
    assert page.status_code == 200
    assert DESCRIBED[answer.json()["type"]].meaning in page.text


async def test_pages_also_describe_the_problems_that_the_order_service_answers(
    client: httpx.AsyncClient,
) -> None:
    assert "Unknown transport order." in (await client.get("/problems/unknown-order")).text
    assert (await client.get("/problems/none")).status_code == 404
