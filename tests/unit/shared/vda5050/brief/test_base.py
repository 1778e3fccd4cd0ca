from __future__ import annotations

from nena_shared.vda5050.brief.reader import read_brief
from nena_shared.vda5050.brief.state import StateBrief
from nena_shared.vda5050.v2_1 import CODEC
from support.fleet_examples import state


def test_times_are_in_utc() -> None:
    payload = CODEC.encode(state()).replace(b"T00:00:00.00Z", b"T01:00:00+01:00")
    assert b"+01:00" in payload
    assert read_brief(StateBrief, CODEC, payload).timestamp.isoformat() == "2026-01-01T00:00:00+00:00"
