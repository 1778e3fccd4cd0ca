#!/usr/bin/env bash
# uvloop 0.23.0: loop.connect_accepted_socket(factory, socket, ssl=context) returns (transport, protocol) with an internal
# uvloop.loop.SSLProtocol as the protocol; asyncio's own loop returns what the factory has made, as its documentation says
# and as uvloop does without TLS. A server that accepts by itself and keeps the returned protocol, to close it later for
# example, works until TLS is switched on.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check uvloop==0.23.0 trustme==1.2.1
timeout 60 "$folder/venv/bin/python" - <<'EOF'
import asyncio
import socket
import ssl
import sys

import trustme
import uvloop

authority = trustme.CA()
served, trusted = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER), ssl.create_default_context()
authority.issue_cert("localhost").configure_cert(served)
authority.configure_trust(trusted)


class Mine(asyncio.Protocol):
    pass


async def returned_protocol(tls):
    loop = asyncio.get_running_loop()
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.setblocking(False)
        named = {"ssl": trusted, "server_hostname": "localhost"} if tls else {}
        client = asyncio.create_task(asyncio.open_connection(*listening.getsockname(), **named))
        accepted, _ = await loop.sock_accept(listening)
        transport, protocol = await loop.connect_accepted_socket(Mine, accepted, ssl=served if tls else None)
        transport.close()
        (await client)[1].close()
        return type(protocol).__name__


seen = {}
for loop, factory in (("asyncio", asyncio.new_event_loop), ("uvloop", uvloop.new_event_loop)):
    for tls in (False, True):
        with asyncio.Runner(loop_factory=factory) as runner:
            seen[loop, tls] = runner.run(returned_protocol(tls))
            print(f"{loop}, {'TLS' if tls else 'plain'}: {seen[loop, tls]}")
mine, internal = "Mine", "SSLProtocol"
sys.exit(list(seen.values()) != [mine, mine, mine, internal])
EOF
