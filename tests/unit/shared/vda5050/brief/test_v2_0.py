from __future__ import annotations

from nena_shared.vda5050.brief.reader import read_brief
from nena_shared.vda5050.brief.state import StateBrief
from nena_shared.vda5050.v2_0 import CODEC as CODEC_2_0
from nena_shared.vda5050.v2_1 import CODEC as CODEC_2_1
from support.fleet_examples import state


def test_maps_are_passed_over() -> None:
    held = {"map_id": "hall", "map_version": "1", "map_status": "ENABLED"}
    payload = CODEC_2_1.encode(state(maps=(held,)))
    assert read_brief(StateBrief, CODEC_2_1, payload).maps
    assert read_brief(StateBrief, CODEC_2_0, payload.replace(b'"2.1.0"', b'"2.0.0"')).maps is None
