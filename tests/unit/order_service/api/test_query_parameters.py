"""Unknown query parameters are refused: a misspelt filter must not return everything."""

from __future__ import annotations

import re

import httpx
import pytest


@pytest.mark.parametrize(
    "path",
    [
        "/v1/transportOrders?sate=FAILED",
        "/v1/orderSequences?finshed=true",
        "/v1/vehicles?sate=IDLE",
        "/v1/vehicles/Robot-01?state=IDLE",
        "/v1/paths?name=x",
        "/v1/summary?vehicle=Robot-01",
        "/v1/traffic/plan?horizon=10",
        "/v1/zoneSets?map=m",
        "/v1/plantModel?format=xml",
        "/v1/events?kinds=vehicle",
    ],
)
async def test_unknown_query_parameters_are_refused(client: httpx.AsyncClient, path: str) -> None:
    answer = await client.get(path)
    assert answer.status_code == 400, answer.text
    assert path.partition("?")[2].partition("=")[0] in answer.text


async def test_commands_refuse_them_too(client: httpx.AsyncClient) -> None:
    answer = await client.post(
        "/v1/transportOrders?dryRun=true", json={"destinations": [{"locationName": "South 2"}]}
    )
    assert answer.status_code == 400
    assert "dryRun" in answer.text
    assert (await client.get("/v1/transportOrders")).json()["transportOrders"] == []


async def test_the_start_page_leads_to_what_there_is(client: httpx.AsyncClient) -> None:
    page = await client.get("/")
    assert page.status_code == 200
    for path in re.findall('href="([^"]+)"', page.text):
        assert (await client.get(path)).status_code in {200, 503}, path
