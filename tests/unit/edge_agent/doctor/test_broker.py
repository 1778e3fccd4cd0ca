from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.doctor.broker import client_id, map_ids
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import MqttSettings


def test_map_ids_are_found_wherever_a_plant_model_has_properties() -> None:
    plant = {
        "points": [{"properties": {"vda5050:mapId": "hall", "other": "x"}}, {"properties": {}}],
        "vehicles": [{"name": "v", "properties": {"vda5050:mapId": "yard"}}],
        "vda5050:mapId": 7,
    }

    assert map_ids(json.dumps(plant).encode()) == {"hall", "yard"}


@given(st.binary(max_size=200))
def test_an_invalid_plant_model_has_no_maps(payload: bytes) -> None:
    assert map_ids(payload) == frozenset()


def test_deeply_nested_json_is_not_a_plant_model() -> None:
    assert map_ids(b"[" * 100_000 + b"]" * 100_000) == frozenset()


@pytest.mark.parametrize(
    ("mqtt", "expected"),
    [
        (MqttSettings(), "nena-edge-agent-uagv-ACME-0001-doctor"),
        (MqttSettings(client_id="robot-7"), "robot-7-doctor"),
    ],
)
def test_a_running_agent_keeps_its_client_id(mqtt: MqttSettings, expected: str) -> None:
    settings = EdgeAgentSettings(manufacturer="ACME", serial_number="0001", mqtt=mqtt)

    assert client_id(settings) == expected
