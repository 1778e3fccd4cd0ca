#!/usr/bin/env bash
# vda5050-core 0.1.0rc2 (CPython 3.12 on) reads the value of an action parameter only if it is a string. The schemas of
# VDA 5050 2.0.0 and 2.1.0 allow arrays, booleans, numbers and strings (2.1.0 also objects): one parameter such as
# {"key": "stationHeight", "value": 1.2} makes the whole order unreadable, and its error names neither order nor key.
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

from vda5050_core.types import Order


def order(value: object) -> dict[str, object]:
    lift = {
        "actionId": "a",
        "actionType": "pick",
        "blockingType": "HARD",
        "actionParameters": [{"key": "stationHeight", "value": value}],
    }
    return {
        "headerId": 1,
        "timestamp": "2026-01-01T00:00:00.000Z",
        "version": "2.1.0",
        "manufacturer": "ACME",
        "serialNumber": "1",
        "orderId": "o",
        "orderUpdateId": 0,
        "nodes": [{"nodeId": "n", "sequenceId": 0, "released": True, "actions": [lift]}],
        "edges": [],
    }


def read(value: object) -> str:
    try:
        return repr(Order.from_json(order(value)).nodes[0].actions[0].action_parameters[0].value)
    except RuntimeError as error:
        return str(error)


seen = {repr(value): read(value) for value in ("1.2", 1.2, True, [1.2])}
refused = "[json.exception.type_error.302] type must be string, but is"
expected = {"'1.2'": "'1.2'", "1.2": f"{refused} number", "True": f"{refused} boolean", "[1.2]": f"{refused} array"}
for value, result in seen.items():
    print(f"{value:8}{result}")
sys.exit(seen != expected)
EOF
