"""The pages that describe the REST API."""

from __future__ import annotations

import re
from html import escape

import httpx
import pytest

from nena_order_service.api.rest import role_needed
from nena_shared.fleet_api.base import Role
from nena_shared.fleet_api.refusals import TYPES


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


@pytest.mark.parametrize("path", ["/docs", "/redoc", "/docs/files/swagger-ui.css", "/problems/name-taken"])
def test_the_pages_need_no_login_for_reading(path: str) -> None:
    assert role_needed("GET", path) is None


def test_a_path_that_only_begins_like_a_page_needs_one() -> None:
    assert role_needed("GET", "/docs/more") is Role.VIEWER
    assert role_needed("POST", "/docs/files/swagger-ui.css") is Role.OPERATOR


async def test_each_type_of_problem_has_a_page(client: httpx.AsyncClient) -> None:
    for uri, kind in TYPES.items():
        page = await client.get(uri)
        assert page.status_code == 200, uri
        assert escape(kind.meaning) in page.text
        assert "What to do" in page.text


async def test_an_unknown_type_of_problem_has_none(client: httpx.AsyncClient) -> None:
    answer = await client.get("/problems/nothing")
    assert (answer.status_code, answer.json()["type"]) == (404, "/problems/unknown-resource")


def test_types_are_part_of_the_interface_and_never_change() -> None:
    """Hosts compare them; add new ones, and keep these."""
    assert {"/problems/unknown-order", "/problems/name-taken", "/problems/not-saved"} < set(TYPES)
    assert all(re.fullmatch(r"/problems/[a-z]+(-[a-z]+)*", each) for each in TYPES)
