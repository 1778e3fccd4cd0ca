"""LIF files for tests, from short descriptions."""

from __future__ import annotations

import json
from typing import Any


def node(name: str, x: float = 0.0, y: float = 0.0, *types: str, **more: Any) -> dict[str, Any]:
    """Return a node on map ``m`` that these types may use; default: ``t``."""
    uses = [{"vehicleTypeId": each} for each in types or ("t",)]
    place = {"x": x, "y": y}
    return {
        "nodeId": name,
        "mapId": "m",
        "nodePosition": place,
        "vehicleTypeNodeProperties": uses,
        **more,
    }


def use(vehicle_type: str = "t", **more: Any) -> dict[str, Any]:
    """Return the properties of an edge for a vehicle type."""
    return {"vehicleTypeId": vehicle_type, "rotationAllowed": False, **more}


def edge(ends: str, *uses: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return the edge ``A-B`` from ``"A B"``, for these types; default: ``t``."""
    start, end = ends.split()
    return {
        "edgeId": f"{start}-{end}",
        "startNodeId": start,
        "endNodeId": end,
        "vehicleTypeEdgeProperties": list(uses or (use(),)),
        **more,
    }


def action(action_type: str, **more: Any) -> dict[str, Any]:
    return {"actionType": action_type, "blockingType": "HARD", "requirementType": "CONDITIONAL", **more}


def layout(*parts: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return a layout of nodes, edges and stations."""
    return {
        "layoutId": "hall",
        "layoutVersion": "1",
        "nodes": [part for part in parts if "nodeId" in part],
        "edges": [part for part in parts if "edgeId" in part],
        "stations": [part for part in parts if "stationId" in part],
        **more,
    }


def lif(*layouts: dict[str, Any], version: str = "1.0.0") -> bytes:
    """Return a file of these layouts."""
    meta = {
        "projectIdentification": "plant",
        "creator": "tests",
        "exportTimestamp": "2026-11-20T10:00:00.00Z",
        "lifVersion": version,
    }
    return json.dumps({"metaInformation": meta, "layouts": layouts}).encode()


def robot_types(names: str) -> list[dict[str, str]]:
    """Return types of mobile robots, from ``"ACME.T1 ACME.T2"``."""
    split = (name.partition(".") for name in names.split())
    return [{"manufacturer": maker, "seriesName": series} for maker, _, series in split]


def robot_node(name: str, x: float = 0.0, y: float = 0.0, types: str = "M.t", **rules: Any) -> dict[str, Any]:
    """Return a node of LIF 2.0 on map ``m`` with rules for these types."""
    return {
        "nodeId": name,
        "mapId": "m",
        "nodePosition": {"x": x, "y": y},
        "mobileRobotTypeNodeProperties": [{"mobileRobotTypes": robot_types(types), **rules}],
    }


def robot_edge(ends: str, types: str = "M.t", **rules: Any) -> dict[str, Any]:
    """Return the LIF 2.0 edge ``A-B`` from ``"A B"``, with rules for these types."""
    start, end = ends.split()
    return {
        "edgeId": f"{start}-{end}",
        "startNodeId": start,
        "endNodeId": end,
        "mobileRobotTypeEdgeProperties": [{"mobileRobotTypes": robot_types(types), **rules}],
    }


def robot_action(action_type: str, **more: Any) -> dict[str, Any]:
    return {"actionType": action_type, "blockingType": "SOFT", **more}


def origin(*layouts: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"originId": "O", "layouts": list(layouts), **more}


def lif_2_0(*origins: dict[str, Any], version: str = "2.0.0") -> bytes:
    """Return a LIF 2.0 file of these origins."""
    meta = {
        "lifId": "plant",
        "creator": "tests",
        "exportTimestamp": "2026-11-20T10:00:00.000Z",
        "lifVersion": version,
    }
    return json.dumps({"metaInformation": meta, "origins": origins}).encode()


def lif_2_0_of(*parts: dict[str, Any]) -> bytes:
    """Return a LIF 2.0 file of one layout."""
    return lif_2_0(origin(layout(*parts)))


def lif_of(*parts: dict[str, Any]) -> bytes:
    """Return a file of one layout."""
    return lif(layout(*parts))
