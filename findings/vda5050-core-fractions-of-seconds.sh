#!/usr/bin/env bash
# vda5050-core 0.1.0rc2 (CPython 3.12 on) reads the digits after the point of a timestamp as a count of milliseconds,
# however many they are: "…:00.5Z" is 5 ms, and "…:00.123456Z", as Python's isoformat() writes it, is 2 min 3.456 s
# later. "…:00Z" is refused. What follows the digits is not read: an offset of +01:00 is taken for UTC. All four are
# date-times of RFC 3339, which the schemas of VDA 5050 ask for ("format": "date-time"); only three digits and a Z, as
# in the text of the standard, are read right. Whoever sends to such a peer has to write exactly these.
set -euo pipefail
for python in python3 python3.12 python3.13 none; do
  "$python" -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 12), (3, 13)))' 2>/dev/null && break
done
[ "$python" != none ] || { echo "needs CPython 3.12 or 3.13" >&2; exit 2; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$python" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check vda5050-core==0.1.0rc2
timeout 60 "$folder/venv/bin/python" - <<'EOF'
import sys

from vda5050_core.types import Connection

MESSAGE = {
    "headerId": 1,
    "version": "2.1.0",
    "manufacturer": "ACME",
    "serialNumber": "1",
    "connectionState": "ONLINE",
}


def read(timestamp: str) -> str:
    try:
        return Connection.from_json({**MESSAGE, "timestamp": timestamp}).json()["timestamp"]
    except RuntimeError as error:
        return str(error)


expected = {
    "2026-01-01T00:00:00.500Z": "2026-01-01T00:00:00.500Z",
    "2026-01-01T00:00:00.5Z": "2026-01-01T00:00:00.005Z",
    "2026-01-01T00:00:00.123456Z": "2026-01-01T00:02:03.456Z",
    "2026-01-01T01:00:00.000+01:00": "2026-01-01T01:00:00.000Z",
    "2026-01-01T00:00:00Z": "JSON parsing error for Header: Unexpected character after seconds in timestamp.",
}
seen = {timestamp: read(timestamp) for timestamp in expected}
for timestamp, result in seen.items():
    print(f"{timestamp:32}{result}")
sys.exit(seen != expected)
EOF
