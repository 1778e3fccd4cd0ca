#!/usr/bin/env bash
# FastAPI 0.165.0 (Starlette 1.10.0) with max_body_size: the same too long body gets two different answers. With a
# Content-Length the answer is 413 as text/plain, and no exception handler of the application sees it, whether or not the
# route reads a body. In chunks, a route with a body answers through the handler, in the application's own format, and a
# route without one answers 200. So an API whose errors are all application/problem+json has one that is not, and a
# client that parses it fails.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check fastapi==0.165.0 starlette==1.10.0 httpx==0.28.1
timeout 60 "$folder/venv/bin/python" - <<'EOF'
import asyncio
import sys

import httpx
from fastapi import FastAPI
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException

app = FastAPI(max_body_size=10)
BODY = b'{"name": "longer than ten bytes"}'


class Item(BaseModel):
    name: str


@app.exception_handler(HTTPException)
async def as_problem(_request, error):
    return JSONResponse({"detail": error.detail}, error.status_code, media_type="application/problem+json")


@app.post("/with-body")
async def with_body(item: Item):
    return {}


@app.post("/without-body")
async def without_body():
    return {}


async def chunks():
    yield BODY[:9]
    yield BODY[9:]


async def main():
    seen = {}
    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
        for path in ("/with-body", "/without-body"):
            for form, content in (("whole", BODY), ("chunked", chunks())):
                answer = await client.post(path, content=content, headers={"content-type": "application/json"})
                seen[path, form] = answer.status_code, answer.headers["content-type"].partition(";")[0]
    return seen


seen = asyncio.run(main())
for case, answer in seen.items():
    print(*case, *answer)
sys.exit(
    seen
    != {
        ("/with-body", "whole"): (413, "text/plain"),
        ("/with-body", "chunked"): (413, "application/problem+json"),
        ("/without-body", "whole"): (413, "text/plain"),
        ("/without-body", "chunked"): (200, "application/json"),
    }
)
EOF
