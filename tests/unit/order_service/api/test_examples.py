"""The examples in the OpenAPI document are complete and valid."""

from __future__ import annotations

from typing import Any

import httpx
import pytest
from pydantic import TypeAdapter

from nena_order_service.api.examples import ANSWERS, BODIES
from nena_shared.fleet_api.operations import OPERATIONS, Operation

BY_NAME = {each.name: each for each in OPERATIONS}


def test_every_operation_with_a_body_has_an_example() -> None:
    assert set(BODIES) == {each.name for each in OPERATIONS if each.request and each.method != "GET"}


@pytest.mark.parametrize("name", BODIES)
def test_bodies_are_valid(name: str) -> None:
    TypeAdapter(BY_NAME[name].request).validate_python(BODIES[name], by_alias=True, by_name=False)


@pytest.mark.parametrize("name", ANSWERS)
def test_answers_have_exactly_the_fields_of_the_operation(name: str) -> None:
    operation: Operation[Any] = BY_NAME[name]
    assert (
        operation.answer.model_validate(ANSWERS[name]).model_dump(mode="json", by_alias=True) == ANSWERS[name]
    )


async def test_the_document_shows_them_and_its_server(client: httpx.AsyncClient) -> None:
    document = (await client.get("/openapi.json")).json()
    assert document["servers"][0]["url"] == "/"
    post = document["paths"]["/v1/transportOrders"]["post"]
    assert post["requestBody"]["content"]["application/json"] == {
        "schema": {"$ref": "#/components/schemas/TransportOrderRequest"},
        "example": BODIES["createTransportOrder"],
    }
    answer = document["paths"]["/v1/locations"]["get"]["responses"]["200"]["content"]["application/json"]
    assert answer["example"] == ANSWERS["locations"]
    assert answer["schema"] == {"$ref": "#/components/schemas/LocationPage"}
