"""How robots deviate from VDA 5050, and what becomes of each under the order service: one table.

``tests/integration/order_service/test_deviations.py`` tries each row; docs/compatibility.md shows them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Any, Final

from nena_shared.vda5050.topics import Topic

MISSING: Final[Any] = object()
"""Instead of a value: the field is not there."""


def of_states(count: int) -> str:
    """Return how many of the public states deviate so."""
    return f"{count} of 49 states"


def of_orders(count: int) -> str:
    """Return how many of the public orders deviate so."""
    return f"{count} of 58 orders"


def of_factsheets(count: int) -> str:
    """Return how many of the public factsheets deviate so."""
    return f"{count} of 21 factsheets"


@dataclass(frozen=True)
class Deviation:
    """One way to deviate, on every message of a topic."""

    words: str
    """What the robot sends."""
    fields: Mapping[str, Any] = field(default_factory=dict)
    """Value by path of names; ``*`` stands for all elements of a list."""
    report: str = ""
    """Begins what the order service says of the field; empty: it says nothing."""
    refusal: str = ""
    """Why the robot is given no order; empty: it finishes its order."""
    topic: Topic = Topic.STATE
    version: str = "2.1.0"
    raw: bytes = b""
    """Stands before the message."""
    capitals: bool = False
    """Whether the names of all its members begin with a capital letter."""
    wrapped: str = ""
    """The only member of the message, whose value is what the standard demands."""
    first: str = ""
    """Stands in the message before its other members."""
    seen: str = ""
    """How often it is seen in public messages, see docs/compatibility.md."""

    def applied(self, payload: bytes) -> bytes:
        """Return a message as the robot sends it."""
        content = json.loads(payload)
        for path, value in self.fields.items():
            _put(content, path.split("."), value)
        if self.capitals:
            content = {name[0].upper() + name[1:]: value for name, value in content.items()}
        content = {self.wrapped: content} if self.wrapped else content
        return self.raw + json.dumps(content).replace("{", "{" + self.first, 1).encode()


def _put(place: Any, path: list[str], value: Any) -> None:
    first, *rest = path
    if first == "*":
        for each in place:
            _put(each, rest, value)
    elif rest:
        if first in place:
            _put(place[first], rest, value)
    else:
        value = value(place.get(first)) if callable(value) else value
        if value is MISSING:
            place.pop(first, None)
        else:
            place[first] = value


def _error(**fields: Any) -> list[dict[str, Any]]:
    """Return a list with a warning."""
    made = {"errorType": "lamp", "errorLevel": "WARNING", "errorReferences": []} | fields
    return [{name: value for name, value in made.items() if value is not MISSING}]


def _references(value: Any) -> list[dict[str, Any]]:
    return _error(errorReferences=[{"referenceKey": "lamp", "referenceValue": value}])


def _of_position() -> Iterator[Deviation]:
    at, wrapped = "state.agvPosition.theta", "angle wrapped"
    yield Deviation("heading 3.1416", {"agvPosition.theta": 3.1416})
    yield Deviation("heading 3.2 in 2.0", {"agvPosition.theta": 3.2}, f"{at} 3.2: {wrapped}", version="2.0.0")
    yield Deviation(
        "heading 3.1416 in 3.0",
        {"mobileRobotPosition.theta": 3.1416},
        version="3.0.0",
    )
    yield Deviation(
        "heading 90: degrees from then on", {"agvPosition.theta": 90}, f"{at} 90: degrees", seen=of_orders(4)
    )
    yield Deviation(
        "no heading",
        {"agvPosition.theta": MISSING},
        "state.agvPosition theta missing: left out",
        "cannot be dispatched: it reports neither a trusted pose",
    )
    yield Deviation(
        "no positionInitialized",
        {"agvPosition.positionInitialized": MISSING},
        "state.agvPosition.positionInitialized missing: replaced",
        "is not localised",
    )
    map_id = "state.agvPosition.mapId"
    yield Deviation(
        "empty mapId, plant with one map",
        {"agvPosition.mapId": ""},
        f'{map_id} "": replaced',
        seen=of_states(4),
    )
    yield Deviation(
        "no mapId, plant with one map", {"agvPosition.mapId": MISSING}, f"{map_id} missing: replaced"
    )
    yield Deviation(
        "mapId in capitals, plant with one map",
        {"agvPosition.mapId": str.upper},
        f'{map_id} "HALL": letter case',
    )
    yield Deviation(
        "coordinates as texts with a decimal comma",
        {"agvPosition.x": "0,0"},
        'state.agvPosition x "0,0": left out',
        "cannot be dispatched: it reports neither a trusted pose",
    )
    yield Deviation("heading as text", {"agvPosition.theta": "0.5"}, f'{at} "0.5": text as number')
    yield Deviation(
        "localizationScore 95",
        {"agvPosition.localizationScore": 95},
        "state.agvPosition.localizationScore 95: scaled",
    )
    yield Deviation(
        "localizationScore -5",
        {"agvPosition.localizationScore": -5},
        "state.agvPosition.localizationScore -5: left out",
    )
    yield Deviation(
        "deviationRange -1",
        {"agvPosition.deviationRange": -1},
        "state.agvPosition.deviationRange -1: left out",
    )
    yield Deviation(
        "positionInitialized as text",
        {"agvPosition.positionInitialized": "true"},
        'state.agvPosition.positionInitialized "true": text as boolean',
    )
    yield Deviation(
        "positionInitialized 1",
        {"agvPosition.positionInitialized": 1},
        "state.agvPosition.positionInitialized 1: text as boolean",
    )


def _of_battery() -> Iterator[Deviation]:
    at = "state.batteryState.batteryCharge"
    yield Deviation("battery 101.3 %", {"batteryState.batteryCharge": 101.3}, f"{at} 101.3: clamped")
    yield Deviation("battery as text", {"batteryState.batteryCharge": "80"}, f'{at} "80": text as number')
    yield Deviation(
        "batteryHealth 120",
        {"batteryState.batteryHealth": 120},
        "state.batteryState.batteryHealth 120: clamped",
    )
    yield Deviation(
        "batteryVoltage NaN",
        {"batteryState.batteryVoltage": nan},
        "state.batteryState.batteryVoltage nan: left out",
    )
    yield Deviation(
        "charging as text",
        {"batteryState.charging": "FALSE"},
        'state.batteryState.charging "FALSE": text as boolean',
    )
    for words, value in (("null", None), ("255 for unknown", 255), ("with its unit", "85 %")):
        yield Deviation(
            f"battery {words}",
            {"batteryState.batteryCharge": value},
            f"{at} {json.dumps(value)}: replaced",
            "must recharge first: critical energy",
        )
    yield Deviation(
        "battery 0.85, a fraction",
        {"batteryState.batteryCharge": 0.85},
        f"{at} 0.85 (a fraction?): unit in doubt",
        "must recharge first: critical energy",
    )
    yield Deviation(
        "battery -1 %",
        {"batteryState.batteryCharge": -1},
        f"{at} -1: clamped",
        "must recharge first: critical energy",
    )


def _of_motion() -> Iterator[Deviation]:
    yield Deviation("velocity NaN", {"velocity": {"vx": nan}}, "state.velocity.vx nan: left out")
    yield Deviation("velocity as a list", {"velocity": []}, "state.velocity []: left out")
    yield Deviation("velocity null", {"velocity": None})
    yield Deviation("driving 0 or 1", {"driving": int}, "state.driving 0: text as boolean")
    yield Deviation(
        "driving true, at rest as well", {"driving": True}, refusal="left its route or moves on its own"
    )
    yield Deviation("driving as text", {"driving": str}, 'state.driving "False": text as boolean')
    yield Deviation("paused 'yes'", {"paused": "yes"}, 'state.paused "yes": left out')
    yield Deviation(
        "distanceSinceLastNode -0.01",
        {"distanceSinceLastNode": -0.01},
        "state.distanceSinceLastNode -0.01: left out",
    )


def _of_errors() -> Iterator[Deviation]:
    level = "state.errors.errorLevel"
    fatal = "has a fatal error: "
    yield Deviation("errorLevel as number", {"errors": _error(errorLevel=2)}, f"{level} 2: replaced", fatal)
    yield Deviation(
        "unknown errorLevel", {"errors": _error(errorLevel="ERROR")}, f'{level} "ERROR": replaced', fatal
    )
    yield Deviation(
        "no errorLevel", {"errors": _error(errorLevel=MISSING)}, f"{level} missing: replaced", fatal
    )
    yield Deviation(
        "errorLevel in small letters",
        {"errors": _error(errorLevel="warning")},
        f'{level} "warning": letter case',
    )
    yield Deviation(
        "no errorType", {"errors": _error(errorType=MISSING)}, "state.errors.errorType missing: replaced"
    )
    yield Deviation(
        "errorReferences null",
        {"errors": _error(errorReferences=None)},
        "state.errors.errorReferences null: empty list",
    )
    yield Deviation(
        "referenceValue as number",
        {"errors": _references(7)},
        "state.errors.errorReferences.referenceValue 7: number as text",
    )
    yield Deviation("referenceValue as a list", {"errors": _references([])}, "state.errors.errorReferences ")
    yield Deviation(
        "infoLevel WARN",
        {"information": [{"infoType": "i", "infoLevel": "WARN"}]},
        "state.information ",
    )


def _of_lists() -> Iterator[Deviation]:
    yield Deviation("errors an empty object", {"errors": {}}, "state.errors {}: empty list")
    for name, seen in (("errors", ""), ("edgeStates", of_states(6)), ("actionStates", of_states(7))):
        yield Deviation(f"{name} null", {name: None}, f"state.{name} null: empty list")
        yield Deviation(f"no {name}", {name: MISSING}, f"state.{name} missing: empty list", seen=seen)
    yield Deviation(
        "nodeStates null where empty", {"nodeStates": lambda value: value or None}, "state.nodeStates null"
    )
    yield Deviation("loads and information null", {"loads": None, "information": None})
    yield Deviation("load with weight -3", {"loads": [{"weight": -3}]}, "state.loads.weight -3: left out")
    yield Deviation("fields of its own", {"vendor": {"a": [1]}, "agvPosition.vendor": 1})
    yield Deviation(
        "no instantActionStates in 3.0",
        {"instantActionStates": MISSING},
        "state.instantActionStates missing: empty list",
        version="3.0.0",
    )


def _of_numbers() -> Iterator[Deviation]:
    at = "state.nodeStates.sequenceId"
    yield Deviation("sequenceId 2.0", {"nodeStates.*.sequenceId": float}, f"{at} 2.0: whole number")
    yield Deviation("sequenceId as text", {"nodeStates.*.sequenceId": str}, f'{at} "2": text as number')
    yield Deviation(
        "lastNodeSequenceId 0.0",
        {"lastNodeSequenceId": float},
        "state.lastNodeSequenceId 0.0: whole number",
    )
    yield Deviation(
        "orderUpdateId as text", {"orderUpdateId": str}, 'state.orderUpdateId "0": text as number'
    )
    yield Deviation("headerId as text", {"headerId": str}, "state.headerId ")
    yield Deviation("headerId with decimals", {"headerId": float}, "state.headerId ")
    yield Deviation("no headerId", {"headerId": MISSING}, "state.headerId missing: replaced")
    yield Deviation(
        "orderId null without an order",
        {"orderId": lambda value: value or None},
        "state.orderId null: replaced",
        seen=of_states(1),
    )
    yield Deviation(
        "no orderId without an order",
        {"orderId": lambda value: value or MISSING},
        "state.orderId missing: replaced",
        seen=of_states(1),
    )


def _of_headers() -> Iterator[Deviation]:
    arrival = "time of arrival"
    unix = "unix time"
    yield Deviation(
        "timestamp in seconds",
        {"timestamp": 1_700_000_000},
        f"state.timestamp 1700000000: {unix}",
        seen=of_states(1),
    )
    for topic in (Topic.CONNECTION, Topic.FACTSHEET):
        yield Deviation(
            f"timestamp in seconds ({topic})",
            {"timestamp": 1_700_000_000},
            f"{topic}.timestamp 1700000000: {unix}",
            topic=topic,
        )
    yield Deviation(
        "timestamp of a PLC (factsheet)",
        {"timestamp": "DT#2026-01-01-11:41:32"},
        f'factsheet.timestamp "DT#2026-01-01-11:41:32": {arrival}',
        topic=Topic.FACTSHEET,
        seen=of_factsheets(1),
    )
    yield Deviation(
        "timestamp in milliseconds, as text",
        {"timestamp": "1700000000000"},
        f'state.timestamp "1700000000000": {unix}',
    )
    yield Deviation(
        "timestamp in microseconds",
        {"timestamp": 1_700_000_000_000_000},
        f"state.timestamp 1700000000000000: {unix}",
    )
    yield Deviation(
        "the same headerId and timestamp always",
        {"headerId": 0, "timestamp": "1970-01-01T00:00:00.000Z"},
        seen=of_states(3),
    )
    yield Deviation(
        "neither headerId nor timestamp",
        {"headerId": MISSING, "timestamp": MISSING},
        f"state.timestamp null: {arrival}",
        seen=of_states(3),
    )
    yield Deviation("timestamp empty", {"timestamp": ""}, f'state.timestamp "": {arrival}')
    yield Deviation("timestamp null", {"timestamp": None}, f"state.timestamp null: {arrival}")
    yield Deviation(
        "timestamp a date", {"timestamp": "2026-01-01"}, f'state.timestamp "2026-01-01": {arrival}'
    )
    number = "version number"
    yield Deviation("version 2.1", {"version": "2.1"}, f'state.version "2.1": {number}')
    yield Deviation("version v2.1.0", {"version": "v2.1.0"}, f'state.version "v2.1.0": {number}')
    yield Deviation("version as number", {"version": 2.1}, f"state.version 2.1: {number}")
    yield Deviation("version null", {"version": None}, f"state.version null: {number}")
    yield Deviation(
        "version 2.7.0", {"version": "2.7.0"}, "state.version 2.7.0, read as 2.1.0: unknown version"
    )
    yield Deviation("no version", {"version": MISSING}, f"state.version null: {number}", seen=of_states(6))
    yield Deviation("version VDA1_1", {"version": "VDA1_1"}, f'state.version "VDA1_1": {number}', seen="seen")
    for version, seen in (("1.3.2", of_states(3)), ("0.8.4", "seen"), ("5.0.0", "seen"), ("3.0.0", "")):
        report = f"version {version}, read as 2.1.0: unknown version"
        yield Deviation(f"version {version}", {"version": version}, f"state.{report}", seen=seen)
    yield Deviation(
        "version 2.1.0 on a topic of 3.0",
        {"version": "2.1.0"},
        "state.version 2.1.0, read as 3.0.1: unknown version",
        version="3.0.0",
    )
    for topic in (Topic.CONNECTION, Topic.FACTSHEET):
        yield Deviation(
            f"version 1.3.2 ({topic})",
            {"version": "1.3.2"},
            f"{topic}.version 1.3.2, read as 2.1.0: unknown version",
            topic=topic,
        )
    yield Deviation(
        "no manufacturer",
        {"manufacturer": MISSING},
        "state.manufacturer missing: replaced",
        seen=of_states(6),
    )
    yield Deviation("serial number of another", {"serialNumber": "R"}, 'state.serialNumber "R": replaced')
    yield Deviation(
        "manufacturer in other letters",
        {"manufacturer": str.upper},
        'state.manufacturer "DEVIATING": letter case',
    )
    yield Deviation("version 3.0.1", {"version": "3.0.1"}, version="3.0.0")
    yield Deviation("byte order mark", report="state.message EF BB BF: byte order mark", raw=b"\xef\xbb\xbf")


def _of_words() -> Iterator[Deviation]:
    yield Deviation(
        "operatingMode in small letters",
        {"operatingMode": "automatic"},
        'state.operatingMode "automatic": letter case',
    )
    yield Deviation("lastNodeId in small letters", {"lastNodeId": str.lower}, 'state.lastNodeId "a')
    yield Deviation("orderId in small letters", {"orderId": str.lower}, 'state.orderId "t')
    yield Deviation("names of fields with capitals", report='state.headerId "HeaderId"', capitals=True)
    yield Deviation("orderId twice", report="state.orderId twice: repeated key", first='"orderId": "?", ')
    yield Deviation(
        "unknown operatingMode",
        {"operatingMode": "FLYING"},
        'state.operatingMode "FLYING": replaced',
        "is in operating mode manual, which takes no orders",
    )
    yield Deviation(
        "eStop in small letters", {"safetyState.eStop": "none"}, 'state.safetyState.eStop "none": letter case'
    )
    yield Deviation(
        "unknown actionStatus",
        {"actionStates": [{"actionId": "a", "actionType": "pick", "actionStatus": "DONE"}]},
        'state.actionStates.actionStatus "DONE": replaced',
        'has an action that counts as RUNNING because of actionStates.actionStatus "DONE"; allowed are '
        "WAITING",
    )
    yield Deviation(
        "unknown eStop",
        {"safetyState.eStop": "PRESSED"},
        'state.safetyState.eStop "PRESSED": replaced',
        "has an active emergency stop",
    )
    yield Deviation(
        "eStop as boolean",
        {"safetyState.eStop": False},
        "state.safetyState.eStop false: replaced",
        "has an active emergency stop",
    )
    yield Deviation(
        "fieldViolation as text",
        {"safetyState.fieldViolation": "false"},
        'state.safetyState.fieldViolation "false": text as boolean',
    )
    yield Deviation(
        "connectionState in small letters",
        {"connectionState": "online"},
        'connection.connectionState "online": letter case',
        topic=Topic.CONNECTION,
    )
    yield Deviation(
        "connectionState CONNECTED",
        {"connectionState": "CONNECTED"},
        'connection.connectionState "CONNECTED": left out',
        topic=Topic.CONNECTION,
    )
    yield Deviation(
        "factsheet with lists null",
        {"protocolFeatures.optionalParameters": None},
        "factsheet.protocolFeatures.optionalParameters null: empty list",
        topic=Topic.FACTSHEET,
    )
    for name, value, unit in (("length", 1100.0, "mm"), ("speedMax", 1500.0, "mm/s")):
        yield Deviation(
            f"factsheet with a {name} of {value:g}",
            {f"physicalParameters.{name}": value},
            f"factsheet.physicalParameters.{name} {value:g} ({unit}?): unit in doubt",
            topic=Topic.FACTSHEET,
        )
    for name, seen in (
        ("protocolLimits", of_factsheets(8)),
        ("agvGeometry", of_factsheets(5)),
        ("loadSpecification", of_factsheets(5)),
        ("physicalParameters.speedMax", of_factsheets(5)),
    ):
        yield Deviation(
            f"factsheet without {name}",
            {name: MISSING},
            f"factsheet.{name} missing: replaced",
            topic=Topic.FACTSHEET,
            seen=seen,
        )
    yield Deviation(
        "factsheet with another word",
        {"protocolFeatures.optionalParameters": [{"parameter": "order.zoneSetId", "support": "OPTIONAL"}]},
        'factsheet.protocolFeatures.optionalParameters.support "OPTIONAL": replaced',
        topic=Topic.FACTSHEET,
        seen=of_factsheets(4),
    )


def _unreadable() -> Iterator[Deviation]:
    sends = "sends states that are unreadable: "
    yield Deviation(
        "no orderId, with an order either",
        {"orderId": MISSING},
        "state.orderId missing: replaced",
        f"{sends}orderId: is missing",
    )
    yield Deviation(
        "no nodeStates",
        {"nodeStates": MISSING},
        refusal=f"{sends}nodeStates: is missing",
        seen=of_states(6),
    )
    yield Deviation(
        "no batteryState",
        {"batteryState": MISSING},
        "state.batteryState missing: replaced",
        "must recharge first: critical energy",
        seen=of_states(3),
    )
    yield Deviation(
        "no safetyState",
        {"safetyState": MISSING},
        "state.safetyState missing: replaced",
        "has an active emergency stop",
        seen=of_states(9),
    )
    yield Deviation(
        "safetyState null",
        {"safetyState": None},
        "state.safetyState null: replaced",
        "has an active emergency stop",
    )
    yield Deviation(
        "message of 3.0 on a topic of 2.x",
        {"agvPosition": MISSING, "batteryState": MISSING, "powerSupply": {}},
        refusal=f"{sends}message: has powerSupply, a field of VDA 5050 3.x",
    )
    yield Deviation(
        "state in an object of its own",
        refusal=f'{sends}message: has no field of a message of this topic, but "state"',
        wrapped="state",
    )
    yield Deviation("what is no JSON", refusal=f"{sends}message: Invalid JSON", raw=b"<state>")


DEVIATIONS: Final = tuple(
    each
    for part in (
        _of_position,
        _of_battery,
        _of_motion,
        _of_errors,
        _of_lists,
        _of_numbers,
        _of_headers,
        _of_words,
        _unreadable,
    )
    for each in part()
)
