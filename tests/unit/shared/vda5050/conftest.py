"""The examples of the standard's digest, unchanged."""

from __future__ import annotations

import json
from typing import Any

import pytest

from support.json_messages import FACTSHEET

HEADER = {
    "headerId": 1,
    "timestamp": "2026-01-01T00:00:00.00Z",
    "version": "2.1.0",
    "manufacturer": "ACME",
    "serialNumber": "0001",
}


@pytest.fixture
def order() -> dict[str, Any]:
    """Return the minimal order of two nodes, as parsed JSON."""
    start = {"x": 0, "y": 0, "mapId": "m"}
    goal = {"x": 5, "y": 0, "allowedDeviationXY": 0.3, "mapId": "m"}
    return HEADER | {
        "orderId": "o1",
        "orderUpdateId": 0,
        "nodes": [
            {"nodeId": "A", "sequenceId": 0, "released": True, "nodePosition": start, "actions": []},
            {"nodeId": "B", "sequenceId": 2, "released": True, "nodePosition": goal, "actions": []},
        ],
        "edges": [
            {
                "edgeId": "A-B",
                "sequenceId": 1,
                "released": True,
                "startNodeId": "A",
                "endNodeId": "B",
                "actions": [],
            }
        ],
    }


@pytest.fixture
def state() -> dict[str, Any]:
    """Return the smallest valid state, as parsed JSON."""
    text = """{"headerId":7,"timestamp":"2026-01-01T00:00:00.00Z","version":"2.1.0","manufacturer":"ACME",
        "serialNumber":"0001","orderId":"","orderUpdateId":0,"lastNodeId":"","lastNodeSequenceId":0,
        "nodeStates":[],"edgeStates":[],"driving":false,"actionStates":[],
        "batteryState":{"batteryCharge":80,"charging":false},"operatingMode":"AUTOMATIC","errors":[],
        "safetyState":{"eStop":"NONE","fieldViolation":false}}"""
    content: dict[str, Any] = json.loads(text)
    return content


@pytest.fixture
def instant_action() -> dict[str, Any]:
    """Return a message with one instant action, as parsed JSON."""
    action = {"actionType": "initPosition", "actionId": "i1", "blockingType": "NONE"}
    return HEADER | {"actions": [action | {"actionParameters": [{"key": "x", "value": 1.5}]}]}


@pytest.fixture
def factsheet() -> dict[str, Any]:
    """Return a factsheet with one action and one limit, as parsed JSON."""
    parameter = {"key": "volume", "valueDataType": "FLOAT"}
    beep = {"actionType": "beep", "actionScopes": ["NODE"], "actionParameters": [parameter]}
    limits = {
        "maxStringLens": {},
        "maxArrayLens": {"order.nodes": 50},
        "timing": {"minOrderInterval": 1, "minStateInterval": 0.5},
    }
    features = {"optionalParameters": [], "agvActions": [beep]}
    return HEADER | FACTSHEET | {"protocolLimits": limits, "protocolFeatures": features}
