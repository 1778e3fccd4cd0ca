"""The pages that describe the REST API."""

from __future__ import annotations

import re

import httpx
import pytest

from nena_order_service.api.rest import role_needed
from nena_shared.fleet_api.base import Role


@pytest.mark.parametrize("path", ["/docs", "/redoc"])
async def test_a_page_finds_all_of_its_files_at_the_service(client: httpx.AsyncClient, path: str) -> None:
    page = await client.get(path)
    files = re.findall(r'(?:src|href)="(docs/[^"]+)"', page.text)
    assert len(files) == 2
    for file in files:
        assert (await client.get(f"/{file}")).status_code == 200, file
    assert "://" not in page.text, "sites have no internet access"


async def test_openapi_tells_how_to_log_in(client: httpx.AsyncClient) -> None:
    document = (await client.get("/openapi.json")).json()
    assert document["security"] == [{}, {"bearer": []}]
    assert document["components"]["securitySchemes"]["bearer"]["scheme"] == "bearer"


@pytest.mark.parametrize("path", ["/docs", "/redoc", "/docs/files/swagger-ui.css"])
def test_the_pages_need_no_login_for_reading(path: str) -> None:
    assert role_needed("GET", path) is None


def test_a_path_that_only_begins_like_a_page_needs_one() -> None:
    assert role_needed("GET", "/docs/more") is Role.VIEWER
    assert role_needed("POST", "/docs/files/swagger-ui.css") is Role.OPERATOR
