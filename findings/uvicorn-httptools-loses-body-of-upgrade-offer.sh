#!/usr/bin/env bash
# uvicorn 0.54.0 with httptools 0.7.1: a POST that offers an upgrade to h2c reaches the application with an empty body and
# is answered 200; with h11, the other parser of the same uvicorn, the body arrives. Clients offer this upgrade without
# being asked: java.net.http.HttpClient does so in its first request to each plain http address. An order posted by such
# a host is thus read as empty, once per connection, and only if httptools is installed, which uvicorn then prefers.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check uvicorn==0.54.0 httptools==0.7.1 h11==0.16.0
timeout 60 "$folder/venv/bin/python" - <<'EOF'
import asyncio
import sys

import uvicorn

BODY = b'{"order": 1}'
REQUEST = (
    b"POST /orders HTTP/1.1\r\nHost: service\r\nConnection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\n"
    b"HTTP2-Settings: AAEAAEAAAAIAAAABAAMAAABkAAQBAAAAAAUAAEAA\r\nContent-Type: application/json\r\n"
    b"Content-Length: %d\r\n\r\n%s" % (len(BODY), BODY)
)


async def received_by(parser):
    bodies = []

    async def application(_scope, receive, send):
        body, more = b"", True
        while more:
            message = await receive()
            body, more = body + message.get("body", b""), message.get("more_body", False)
        bodies.append(body)
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"0")]})
        await send({"type": "http.response.body"})

    server = uvicorn.Server(
        uvicorn.Config(application, "127.0.0.1", 0, http=parser, lifespan="off", log_level="error")
    )
    serving = asyncio.create_task(server.serve())
    while not server.started:
        await asyncio.sleep(0.02)
    reader, writer = await asyncio.open_connection(*server.servers[0].sockets[0].getsockname())
    writer.write(REQUEST)
    status = (await asyncio.wait_for(reader.readline(), 5)).decode().strip()
    writer.close()
    server.should_exit = True
    await serving
    return status, bodies


seen = {parser: asyncio.run(received_by(parser)) for parser in ("h11", "httptools")}
for parser, (status, bodies) in seen.items():
    print(f"{parser:10} {status}, body {bodies}")
sys.exit(seen != {"h11": ("HTTP/1.1 200 OK", [BODY]), "httptools": ("HTTP/1.1 200 OK", [b""])})
EOF
