"""What each version of VDA 5050 can express of a neutral message, by the digest of the standard.

The oracle of the round trips: it works on messages split into names and values, and shares nothing with the
codecs but the table of error names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from math import ceil, pi
from typing import Any

from nena_shared.vda5050.base import WireObject
from nena_shared.vda5050.v2_1.state import REJECTIONS, WRITTEN

Plain = dict[str, Any]

MISSING_IN_2: Plain = {
    "order_description": None,
    "retriable": None,
    "release_required": None,
    "release_loss_behavior": None,
    "planned_path": None,
    "intermediate_path": None,
    "zone_sets": None,
    "zone_requests": None,
    "edge_requests": None,
    "zone_action_states": None,
    "battery_current": None,
    "supported_zones": None,
    "reference_state_header_id": 0,
    "pause_allowed": False,
    "cancel_allowed": False,
    "battery_charging": None,
    "blocking_types": None,
    "error_description_translations": None,
    "error_hint_translations": None,
}
MISSING_ALSO_IN_2_0: Plain = {
    "corridor": None,
    "maps": None,
    "error_hint": None,
    "minimum_angular_speed": None,
    "maximum_angular_speed": None,
    "mobile_robot_configuration": None,
}
LIMITS_OF_3_0 = {
    "zone_set_zones": None,
    "state_instant_action_states": None,
    "state_zone_action_states": None,
}
ABSENT_PARAMETERS = {
    "2.0.0": ("retriable", "corridor"),
    "2.1.0": ("retriable",),
}
NEAREST = {
    "blocking_type": {"SINGLE": "HARD"},
    "action_status": {"RETRIABLE": "RUNNING"},
    "connection_state": {"HIBERNATING": "ONLINE"},
    "operating_mode": {"STARTUP": "SERVICE", "INTERVENED": "AUTOMATIC"},
}


def plain(value: Any) -> Any:
    """Split a message into names and values, without fields that only one version has."""
    if isinstance(value, WireObject):
        names = _neutral(type(value)).model_fields
        return {name: plain(getattr(value, name)) for name in names}
    return [plain(each) for each in value] if isinstance(value, tuple) else value


def _neutral(kind: type[WireObject]) -> type[WireObject]:
    """Return the class that all versions share: the first one outside the versions' packages."""
    return next(each for each in kind.__mro__ if ".vda5050.v" not in each.__module__)


def nearest(version: str, message: Plain) -> Plain:
    """Return what ``version`` can express of a plain message."""
    result: Plain = _said(version, message) | {"version": version}
    if version < "3" and message.get("operating_mode") == "INTERVENED":
        result["paused"] = True
    if version >= "3" and "actions" in result:
        for action in result["actions"]:
            action["blocking_type"] = "NONE"
    return result


def _said(version: str, value: Any) -> Any:
    if isinstance(value, list):
        return [_said(version, each) for each in value]
    if isinstance(value, datetime):
        step = 1_000 if version >= "3" else 10_000
        return value.replace(microsecond=value.microsecond // step * step)
    if not isinstance(value, dict):
        return value
    result = dict(value)
    result |= {name: each for name, each in _missing(version).items() if name in value}
    for special in SPECIALS.get(version, _IN_3):
        special(result)
    if "optional_parameters" in result and version in ABSENT_PARAMETERS:
        result["optional_parameters"] = [
            each
            for each in result["optional_parameters"]
            if not any(part in ABSENT_PARAMETERS[version] for part in each["parameter"].split("."))
        ]
    return {
        name: each if name in ("value", "data") else _said(version, each) for name, each in result.items()
    }


def _missing(version: str) -> Plain:
    if version >= "3":
        return {}
    return MISSING_IN_2 | MISSING_ALSO_IN_2_0 if version == "2.0.0" else MISSING_IN_2


def _words(value: Plain) -> None:
    for name, words in NEAREST.items():
        if isinstance(value.get(name), str):
            value[name] = words.get(value[name], value[name])


def _circle(value: Plain) -> None:
    if ellipse := value.get("allowed_deviation_xy"):
        radius = min(ellipse["a"], ellipse["b"])
        value["allowed_deviation_xy"] = {"a": radius, "b": radius, "theta": 0.0}


def _corridor(value: Plain) -> None:
    if (value.get("corridor") or {}).get("release_required"):
        value["corridor"] = None


def _trajectory(value: Plain) -> None:
    if "control_points" not in value:
        return
    degree = value["degree"] = value["degree"] or 1
    if value["knot_vector"] is None:
        spans = len(value["control_points"]) - degree
        inner = [number / spans for number in range(1, spans)]
        value["knot_vector"] = [0.0] * (degree + 1) + inner + [1.0] * (degree + 1)


def _scopes(value: Plain) -> None:
    if "action_scopes" in value:
        value["action_scopes"] = [each for each in value["action_scopes"] if each != "ZONE"]


def _error(value: Plain) -> None:
    if "error_type" in value:
        mild = value["error_level"] in ("WARNING", "URGENT") or value["error_type"] in REJECTIONS
        value["error_level"] = "WARNING" if mild else "FATAL"
        value["error_type"] = WRITTEN.get(value["error_type"], value["error_type"])


def _state(value: Plain) -> None:
    if "power_supply" in value:
        value["action_states"] = value["action_states"] + value["instant_action_states"]
        value["instant_action_states"] = []


def _limits(value: Plain) -> None:
    if "order_nodes" in value:
        value |= LIMITS_OF_3_0


def _health(value: Plain) -> None:
    if value.get("battery_health") is not None:
        value["battery_health"] = float(round(value["battery_health"]))


def _charging(value: Plain) -> None:
    if value.get("minimum_charging_time") is not None:
        value["minimum_charging_time"] = float(ceil(value["minimum_charging_time"]))


def _ellipse(value: Plain) -> None:
    if {"a", "b", "theta"} == set(value):
        turn = value["theta"]
        value["theta"] = turn if abs(turn) <= pi / 2 else turn - pi if turn > 0 else turn + pi


def _node_states(value: Plain) -> None:
    for node in value.get("node_states") or () if "power_supply" in value else ():
        if position := node["node_position"]:
            node["node_position"] = position | {
                "allowed_deviation_xy": None,
                "allowed_deviation_theta": None,
            }


def _node_states_in_2_0(value: Plain) -> None:
    for node in value.get("node_states") or () if "power_supply" in value else ():
        if node["node_position"] and node["node_position"]["theta"] is None:
            node["node_position"] = None


def _zone_set_in_use(value: Plain) -> None:
    if "order_update_id" in value:
        value["zone_set_id"] = None


def _requests(value: Plain) -> None:
    if value.get("request_status") == "QUEUED":
        value["request_status"] = "REQUESTED"


def _zone(value: Plain) -> None:
    if value.get("zone_type") == "RELEASE":
        value["release_loss_behavior"] = value["release_loss_behavior"] or "STOP"
    if "zone_type" in value and value["zone_type"] != "DIRECTED":
        value["directed_limitation"] = None
    if "zone_type" in value and value["zone_type"] != "BIDIRECTED":
        value["bidirected_limitation"] = None


_IN_2_1: tuple[Callable[[Plain], None], ...] = (
    _words,
    _circle,
    _corridor,
    _trajectory,
    _scopes,
    _error,
    _state,
    _node_states,
    _limits,
)
_IN_3: tuple[Callable[[Plain], None], ...] = (
    _ellipse,
    _charging,
    _node_states,
    _zone_set_in_use,
    _requests,
    _zone,
)
SPECIALS: Mapping[str, tuple[Callable[[Plain], None], ...]] = {
    "2.0.0": (*_IN_2_1, _health, _node_states_in_2_0),
    "2.1.0": _IN_2_1,
}
