"""The examples in the OpenAPI document are complete and valid."""

from __future__ import annotations

import httpx
from pydantic import TypeAdapter

from nena_order_service.service import OrderService
from nena_shared.fleet_api.operations import OPERATIONS


def test_every_operation_with_a_body_has_a_valid_example(service: OrderService) -> None:
    bodies = {name: each for name, each in service.operations.handlers.items() if each.body is not None}
    assert set(bodies) == {each.name for each in OPERATIONS if each.request and each.method != "GET"}
    for each in bodies.values():
        TypeAdapter(each.operation.request).validate_python(each.body, by_alias=True, by_name=False)


def test_answers_have_exactly_the_fields_of_the_operation(service: OrderService) -> None:
    for each in service.operations.handlers.values():
        if each.answer is not None:
            answer = each.operation.answer.model_validate(each.answer)
            assert answer.model_dump(mode="json", by_alias=True) == each.answer


async def test_the_document_shows_them_and_its_server(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    handlers = service.operations.handlers
    document = (await client.get("/openapi.json")).json()
    assert document["servers"][0]["url"] == "/"
    post = document["paths"]["/v1/transportOrders"]["post"]
    assert post["requestBody"]["content"]["application/json"] == {
        "schema": {"$ref": "#/components/schemas/TransportOrderRequest"},
        "example": handlers["createTransportOrder"].body,
    }
    answer = document["paths"]["/v1/locations"]["get"]["responses"]["200"]["content"]["application/json"]
    assert answer["example"] == handlers["locations"].answer
    assert answer["schema"] == {"$ref": "#/components/schemas/LocationPage"}
