"""The description of the REST API as pages: ``/docs`` to try requests, ``/redoc`` to read.

Their scripts come from the package ``fastapi-offline``, because many sites have no internet access. The pages
contain nothing of the site and need no login. The description needs one: the pages ask for a token.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fastapi_offline
from fastapi import APIRouter, FastAPI
from starlette.responses import HTMLResponse, Response
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles

from nena_shared.fleet_api.refusals import TYPES
from nena_shared.web.problem import make_problem_router

DOCS, REDOC = "/docs", "/redoc"
FILES = f"{DOCS}/files"
_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>NeNa order service: REST API</title><link rel="icon" href="data:,">
<link rel="stylesheet" href="docs/files/swagger-ui.css">
<style>body { margin: 0 } form { padding: 2rem }</style>
<form hidden><label>API token <input type="password" autocomplete="off" required></label>
<button>Show</button>
<output></output></form><div id="api"></div>
<script src="docs/files/SCRIPT"></script><script>
const form = document.querySelector("form");
async function load(token) {
  const headers = token ? {Authorization: `Bearer ${token}`} : {};
  const answer = await fetch("openapi.json", {headers});
  form.hidden = answer.ok;
  form.querySelector("output").textContent = answer.ok || !token ? "" : (await answer.json()).detail;
  if (answer.ok) show(await answer.json(), token);
}
function show(spec, token) { SHOW }
form.addEventListener("submit", (event) => {
  event.preventDefault();
  load(form.querySelector("input").value);
});
load();
</script></html>
"""
_SWAGGER_UI = """
  const ui = SwaggerUIBundle({spec, dom_id: "#api", deepLinking: true});
  if (token) ui.preauthorizeApiKey("bearer", token);
"""
_REDOC = 'Redoc.init(spec, {}, document.querySelector("#api"));'
BEARER = {
    "type": "http",
    "scheme": "bearer",
    "description": "Needed if the service has users (setting `http.users`) or an issuer (`http.oidc`).",
}


def documentation() -> APIRouter:
    """Create the routes of the pages."""
    router = APIRouter()
    static = Path(fastapi_offline.__file__).parent / "static"
    router.routes.append(Mount(FILES, StaticFiles(directory=static), name="documentation"))

    @router.get(DOCS, include_in_schema=False)
    async def docs() -> Response:
        """Show the operations, and send requests."""
        return _make_page("swagger-ui-bundle.js", _SWAGGER_UI)

    @router.get(REDOC, include_in_schema=False)
    async def redoc() -> Response:
        """Show the operations as one page."""
        return _make_page("redoc.standalone.js", _REDOC)

    router.include_router(make_problem_router(TYPES, DOCS))
    return router


def _make_page(script: str, show: str) -> Response:
    return HTMLResponse(_PAGE.replace("SCRIPT", script).replace("SHOW", show))


def describe_login(app: FastAPI) -> None:
    """Add to OpenAPI how a client logs in."""
    plain = app.openapi

    def described() -> dict[str, Any]:
        document = plain()
        document.setdefault("components", {})["securitySchemes"] = {"bearer": BEARER}
        # OpenAPI: the empty requirement makes the login optional, because a service may have no users.
        document["security"] = [{}, {"bearer": []}]
        return document

    app.openapi = described  # type: ignore[method-assign]
