"""The examples of the standard's digest for 3.0."""

from __future__ import annotations

from typing import Any

import pytest

JsonObject = dict[str, Any]
HEADER = {
    "headerId": 1,
    "timestamp": "2026-01-01T00:00:00.000Z",
    "version": "3.0.0",
    "manufacturer": "ACME",
    "serialNumber": "0001",
}


@pytest.fixture
def header() -> JsonObject:
    """Return the five fields at the top of each message."""
    return dict(HEADER)


@pytest.fixture
def order() -> JsonObject:
    """Return the minimal order of two nodes, as parsed JSON."""
    goal = {"x": 5, "y": 0, "allowedDeviationXY": {"a": 0.3, "b": 0.3, "theta": 0}, "mapId": "m"}
    start = {"x": 0, "y": 0, "mapId": "m"}
    return HEADER | {
        "orderId": "o1",
        "orderUpdateId": 0,
        "nodes": [
            {"nodeId": "A", "sequenceId": 0, "released": True, "nodePosition": start, "actions": []},
            {"nodeId": "B", "sequenceId": 2, "released": True, "nodePosition": goal, "actions": []},
        ],
        "edges": [{"edgeId": "A-B", "sequenceId": 1, "released": True, "actions": []}],
    }


@pytest.fixture
def state() -> JsonObject:
    """Return the smallest valid state, as parsed JSON."""
    return HEADER | {
        "orderId": "",
        "orderUpdateId": 0,
        "lastNodeId": "",
        "lastNodeSequenceId": 0,
        "nodeStates": [],
        "edgeStates": [],
        "driving": False,
        "actionStates": [],
        "instantActionStates": [],
        "powerSupply": {"stateOfCharge": 80, "charging": False},
        "operatingMode": "AUTOMATIC",
        "errors": [],
        "safetyState": {"activeEmergencyStop": "NONE", "fieldViolation": False},
    }


@pytest.fixture
def factsheet() -> JsonObject:
    """Return a factsheet with one action, as parsed JSON."""
    return HEADER | {
        "typeSpecification": {
            "seriesName": "Carrier 1",
            "mobileRobotKinematics": "DIFFERENTIAL",
            "mobileRobotClass": "CARRIER",
            "maximumLoadMass": 100,
            "localizationTypes": ["NATURAL"],
            "navigationTypes": ["FREELY_NAVIGATING"],
        },
        "physicalParameters": {
            "minimumSpeed": 0,
            "maximumSpeed": 1.5,
            "maximumAcceleration": 1,
            "maximumDeceleration": 1,
            "minimumHeight": 0.3,
            "maximumHeight": 0.3,
            "width": 0.6,
            "length": 0.9,
        },
        "protocolLimits": {
            "maximumStringLengths": {},
            "maximumArrayLengths": {"order.nodes": 50},
            "timing": {"minimumOrderInterval": 1, "minimumStateInterval": 0.5},
        },
        "protocolFeatures": {
            "optionalParameters": [],
            "mobileRobotActions": [
                {
                    "actionType": "beep",
                    "actionScopes": ["NODE"],
                    "actionParameters": [{"key": "volume", "valueDataType": "NUMBER"}],
                    "pauseAllowed": True,
                    "cancelAllowed": False,
                }
            ],
        },
        "mobileRobotGeometry": {},
        "loadSpecification": {},
    }


@pytest.fixture
def zone() -> JsonObject:
    """Return a zone that robots must not enter."""
    corners = [{"x": 0, "y": 0}, {"x": 1, "y": 0}, {"x": 0, "y": 1}]
    return {"zoneId": "z", "zoneType": "BLOCKED", "vertices": corners}


@pytest.fixture
def instant_action(header: JsonObject) -> JsonObject:
    """Return a message with one instant action, as parsed JSON."""
    return header | {
        "actions": [{"actionType": "initializePosition", "actionId": "i1", "blockingType": "NONE"}]
    }
