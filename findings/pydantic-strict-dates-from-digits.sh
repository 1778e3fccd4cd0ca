#!/usr/bin/env bash
# pydantic 2.11.7, strict mode, JSON: a *number* is refused as a datetime, as strict mode says, but a *string* of
# digits is read as seconds since 1970. So ISO 8601's basic form "20260101" becomes 23 August 1970, "2026" becomes
# 00:33:46 on 1 January 1970, and the extended form "2026-01-01" of the same day is an error. msgspec 0.19.0 refuses
# all four. A date in the wrong form is thus not rejected but silently 56 years early.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pydantic==2.11.7 msgspec==0.19.0
timeout 60 "$folder/venv/bin/python" - <<'EOF'
import sys
from datetime import datetime

import msgspec
from pydantic import TypeAdapter, ValidationError

adapter = TypeAdapter(datetime)


def by_pydantic(text: str) -> str:
    try:
        return adapter.validate_json(text, strict=True).isoformat()
    except ValidationError as error:
        return error.errors()[0]["type"]


def by_msgspec(text: str) -> str:
    try:
        return msgspec.json.decode(text, type=datetime).isoformat()
    except msgspec.ValidationError:
        return "refused"


texts = ("20260101", '"20260101"', '"2026"', '"2026-01-01"')
seen = {text: (by_pydantic(text), by_msgspec(text)) for text in texts}
expected = {
    "20260101": ("datetime_type", "refused"),
    '"20260101"': ("1970-08-23T11:48:21+00:00", "refused"),
    '"2026"': ("1970-01-01T00:33:46+00:00", "refused"),
    '"2026-01-01"': ("datetime_parsing", "refused"),
}
for text, (pydantic_says, msgspec_says) in seen.items():
    print(f"{text:14} pydantic: {pydantic_says:28} msgspec: {msgspec_says}")
sys.exit(seen != expected)
EOF
