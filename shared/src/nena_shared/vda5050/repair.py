"""Repair messages that deviate from the standard but whose meaning is clear (VDA 5050 3.0 section 7.1).

Only messages that the strict reader rejects are repaired. A value that violates its field's type or limits is

- repaired if its meaning is clear: angles are wrapped to [-π, π], percentages clamped, numbers parsed from
  text, enumeration values matched case-insensitively;
- omitted if it is optional and cannot be repaired;
- replaced by the safest value of its field, if one is defined (``SAFEST``): an unknown error level becomes
  FATAL, an unknown operating mode MANUAL.

Anything else stays unchanged, and the strict reader reports the error. Commands (orders, instant actions) are
repaired only if the meaning is certain: see :class:`Scope`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum, StrEnum, auto
from functools import cache, lru_cache
from math import isfinite, pi, radians, remainder
from typing import Any, Final, NamedTuple

from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticSerializationError, to_json

from nena_shared.clock import iso
from nena_shared.findings import letters_of
from nena_shared.vda5050.action import Action, ActionState, BlockingType
from nena_shared.vda5050.base import ANGLE_LIMIT, Header, Timestamp, WireObject
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.factsheet import (
    ActionParameterDescription,
    Factsheet,
    MobileRobotAction,
    OptionalParameter,
    PhysicalParameters,
    ProtocolFeatures,
    ProtocolLimits,
    Support,
    Timing,
    TypeSpecification,
)
from nena_shared.vda5050.malformed import quoted
from nena_shared.vda5050.order import Edge, NodePosition, Trajectory
from nena_shared.vda5050.shape import Field, Shape, fields_of
from nena_shared.vda5050.state import (
    EdgeState,
    EmergencyStop,
    Load,
    MobileRobotPosition,
    NodeState,
    OperatingMode,
    PowerSupply,
    SafetyState,
    State,
)
from nena_shared.vda5050.visualization import Visualization

BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"

_VERSION: Final = re.compile(r"\s*v?(\d{1,9})(?:\.(\d{1,9}))?(?:\.(\d{1,9}))?\s*", re.ASCII | re.IGNORECASE)
"""A version number, perhaps with a prefix or without minor and patch."""


class RepairKind(StrEnum):
    """How a value was repaired; also a metric label."""

    ANGLE_WRAPPED = "angle_wrapped"
    DEGREES = "degrees"
    """A heading of a robot whose headings are in degrees, as one beyond a full turn in radians has shown."""
    CLAMPED = "clamped"
    SCALED = "scaled"
    """A fraction of 1 was given in percent."""
    LEFT_OUT = "left_out"
    EMPTY_LIST = "empty_list"
    """A missing list, or null, was read as an empty list."""
    REPLACED = "replaced"
    """Replaced by the safest value of the field."""
    TEXT_AS_NUMBER = "text_as_number"
    NUMBER_AS_TEXT = "number_as_text"
    TEXT_AS_BOOLEAN = "text_as_boolean"
    TEXT_AS_LIST = "text_as_list"
    """A text instead of a list with this text."""
    WHOLE_NUMBER = "whole_number"
    """An integer written with decimals, such as 0.0."""
    LETTER_CASE = "letter_case"
    """An enumeration value in other case, or with other separators."""
    UNIX_TIME = "unix_time"
    """A timestamp in seconds, milliseconds, microseconds or nanoseconds since 1970."""
    TIME_OF_ARRIVAL = "time_of_arrival"
    """Used instead of an unreadable timestamp."""
    VERSION_NUMBER = "version_number"
    """Completed to major, minor and patch."""
    REPEATED_KEY = "repeated_key"
    """A key that stands twice in one object, with different values: the last one was read."""
    UNIT_IN_DOUBT = "unit_in_doubt"
    """Unlikely in the unit of the standard; used as it is."""
    BYTE_ORDER_MARK = "byte_order_mark"
    UNKNOWN_VERSION = "unknown_version"
    """Read as the nearest supported version of the topic's major version."""


SUBSTITUTES: Final = frozenset({RepairKind.REPLACED, RepairKind.LEFT_OUT, RepairKind.CLAMPED})
"""Kinds after which another value is used than the received one."""


class Repair(NamedTuple):
    """One deviation of a message from the standard, and how it was handled."""

    field: str
    """Path of the field on the wire, without list indices; "message" for the whole message."""
    kind: RepairKind
    received: str = ""
    """The received value, shortened."""

    def __str__(self) -> str:
        return f"{self.field} {self.received}: {self.kind.replace('_', ' ')}"


class Scope(Enum):
    """How far a message may be repaired."""

    REPORT = auto()
    """Messages of robots: repair what can be used safely."""
    COMMAND = auto()
    """Commands: repair only what is certain.

    Nothing is omitted. Nothing is clamped except an allowed heading deviation of half to a full turn: from
    half a turn on, any heading is allowed.
    """
    SIGHTING = auto()
    """States that stay unreadable: as REPORT, and required fields that cannot be read become empty.

    Only what such a state says about the robot itself may be used, because its order looks finished.
    """


EVERYWHERE: Final[frozenset[str]] = frozenset()
"""For ``only``: all fields."""


class _UnrepairableError(Exception):
    """The value ``received`` at ``path``, if they are known, cannot be repaired."""

    def __init__(self, path: str = "", received: str = "") -> None:
        self.path, self.received = path, received

    def within(self, path: str, value: object) -> str:
        """Return what makes the ``value`` at ``path`` unreadable: one of its fields, or itself."""
        inner = self.path.removeprefix(f"{path}.")
        return quoted(value) if inner == self.path else f"{inner} {self.received}"


Repairs = dict[tuple[str, RepairKind], str]
"""First received value by path and kind of repair."""
_Fix = Callable[[Any, Repairs], Any]

SAFEST: Final[Mapping[tuple[type[WireObject], str], object]] = {
    (Header, "header_id"): 0,
    (Header, "manufacturer"): "",
    (Header, "serial_number"): "",
    (State, "order_update_id"): 0,
    (State, "last_node_id"): "",
    (State, "last_node_sequence_id"): 0,
    # no orders are sent, and none is believed to be kept (VDA 5050 3.0, 6.6.6 and 6.6.7)
    (State, "operating_mode"): OperatingMode.MANUAL.value,
    (State, "power_supply"): {},
    (State, "safety_state"): {},
    (ErrorEntry, "error_type"): "unknown",
    (ErrorEntry, "error_level"): ErrorLevel.FATAL.value,
    (SafetyState, "active_emergency_stop"): EmergencyStop.MANUAL.value,
    (SafetyState, "field_violation"): False,
    # not ended: the order must not go on as if the action had finished
    (ActionState, "action_status"): "RUNNING",
    (PowerSupply, "state_of_charge"): 0.0,
    (PowerSupply, "charging"): False,
    (MobileRobotPosition, "localized"): False,
    (MobileRobotPosition, "map_id"): "",
    (Visualization, "reference_state_header_id"): 0,
    # nothing, 0 and empty texts of a factsheet count as unknown
    **{
        (form, field.name): {} if issubclass(field.shape.kind, WireObject) else field.shape.kind()
        for form in (
            Factsheet,
            TypeSpecification,
            PhysicalParameters,
            ProtocolLimits,
            Timing,
            ProtocolFeatures,
        )
        for field in fields_of(form)
        if field.name not in Header.model_fields
    },
    (OptionalParameter, "support"): Support.SUPPORTED.value,
    (MobileRobotAction, "pause_allowed"): False,
    (MobileRobotAction, "cancel_allowed"): False,
}
"""Safest values of required fields, for robots' messages in which they are missing or cannot be repaired.

Empty objects are filled with the safest values of their fields."""

_MISSING_IN_COMMANDS: Final[Mapping[tuple[type[WireObject], str], object]] = {
    (Header, "header_id"): 0,
    # nothing else runs, and the robot does not drive: the strictest of all (6.2.2)
    (Action, "blocking_type"): BlockingType.HARD.value,
}
"""Values of required fields that are missing in commands."""

_NEVER_EMPTIED: Final = {(State, "node_states")}
"""Lists that are not read as empty if missing: an order without reported nodes must not look finished."""

_NEVER_DROPPED: Final = (NodeState, EdgeState, ActionState, ErrorEntry, Load, ActionParameterDescription)
"""List elements that are never omitted, as that would change the meaning of the list."""

_SENT_AS: Final = {
    (NodePosition, "allowed_deviation_xy"): Shape(float, least=0.0),
    (Edge, "reach_orientation_before_entering"): Shape(bool),
}
"""Fields that 2.x reads by code of its own, as it sends them."""

_PERCENT: Final = 100.0
_TOLERANCE: Final = 50.0
"""Percentages farther beyond their limits are invalid, e.g. 255 for "unknown"."""
FULL_TURN: Final = 2 * pi + 1e-3
"""The greatest heading that may be in radians."""
FULL_TURN_DEGREES: Final = 360.0
_TIME: Final[TypeAdapter[datetime]] = TypeAdapter(Timestamp)


def without_mark(payload: bytes, repairs: Repairs) -> bytes:
    """Return a message without its byte order mark, and without the zeros that end a text in C."""
    if payload.endswith(b"\0"):
        repairs["message", RepairKind.LEFT_OUT] = "00"
        payload = payload.rstrip(b"\0")
    if not payload.startswith(BYTE_ORDER_MARK):
        return payload
    repairs["message", RepairKind.BYTE_ORDER_MARK] = "EF BB BF"
    return payload[len(BYTE_ORDER_MARK) :]


@cache
def names_in(form: type[WireObject]) -> frozenset[str]:
    """Return the names on the wire of all fields of a form and its parts."""
    parts = [(field.shape.item or field.shape).kind for field in fields_of(form)]
    inner = [names_in(part) for part in parts if issubclass(part, WireObject)]
    return frozenset(name for field in fields_of(form) for name in field.wire).union(*inner)


@cache
def _names_by_letters(form: type[WireObject]) -> Mapping[str, str]:
    return {name.casefold(): name for name in names_in(form)}


def respell(form: type[WireObject], content: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
    """Return a message with the field names of its form where they differ in letter case alone."""
    if isinstance(content, list):
        return [respell(form, each, repairs) for each in content]
    if not isinstance(content, dict):
        return content
    names, spelled = _names_by_letters(form), {}
    for key, value in content.items():
        name = key if key in names_in(form) else names.get(key.casefold(), key)
        if name != key and name not in content:
            repairs[name, RepairKind.LETTER_CASE] = quoted(key)
        # the values of action parameters have names of their own
        spelled[key if name in content else name] = (
            value if name == "value" else respell(form, value, repairs)
        )
    return spelled


def repair(
    form: type[Header],
    content: dict[str, Any],
    repairs: Repairs,
    *,
    version: str,
    now: datetime,
    scope: Scope,
    only: frozenset[str] = EVERYWHERE,
) -> None:
    """Repair a message in place as far as possible; the rest stays unchanged.

    Args:
        form: form of the message in the version used for reading.
        content: the message.
        repairs: receives what was repaired.
        version: number of that version, for messages without one.
        now: time of arrival.
        scope: which repairs are allowed.
        only: paths of the fields to check.
    """
    required = _required_fields(form)
    if not only or "version" in only:
        stated = content.get("version")
        complete = version_number(stated)
        if ("version" in content or "version" in required) and not (complete and complete == stated):
            content["version"] = complete or version
            repairs["version", RepairKind.VERSION_NUMBER] = quoted(stated)
    if not only or "timestamp" in only:
        time = content.get("timestamp")
        if ("timestamp" in content or "timestamp" in required) and not _is_time(time):
            unix_time = _unix_time(time)
            content["timestamp"] = iso(unix_time or now)
            kind = RepairKind.TIME_OF_ARRIVAL if unix_time is None else RepairKind.UNIX_TIME
            repairs["timestamp", kind] = quoted(time)
    if scope is Scope.COMMAND:
        _convert_degrees(form, content, repairs)
    stated_update = {name: content[name] for name in ("orderUpdateId",) if name in content}
    for field in _fields_of(form, "", scope, only):
        try:
            field.apply(content, repairs)
        except _UnrepairableError:
            if scope is Scope.SIGHTING:
                field.empty_in(content)
    if scope is Scope.REPORT and content.get("orderId") and ("orderUpdateId", RepairKind.REPLACED) in repairs:
        del content["orderUpdateId"]  # a wrong number would look as if the robot had lost its order
        content.update(stated_update)


def repair_order_id(content: dict[str, Any], repairs: Repairs) -> bool:
    """Complete a state that lacks an orderId because there is no order; return False if there is one."""
    # a list that is not parsed yet tells nothing, nor do missing nodeStates
    lists = content.get("nodeStates", ...), content.get("edgeStates")
    if content.get("orderId") is not None:
        return True
    if all(each in ([], None) for each in lists):
        repairs["orderId", RepairKind.REPLACED] = "null" if "orderId" in content else "missing"
        content["orderId"] = ""
    return not any(isinstance(each, list) and each for each in lists)


def meant_map(said: object, maps: Collection[str]) -> str | None:
    """Return the only map that an empty mapId, or one in other letters, can mean; None: it is as it is."""
    letters = str(said or "").casefold()
    alike = [each for each in maps if letters in ("", each.casefold())]
    return alike[0] if said not in maps and len(alike) == 1 else None


def repair_map(position: dict[str, Any], maps: Collection[str], repairs: Repairs, at: str) -> None:
    """Replace a mapId that can only mean one of these ``maps``; ``at`` is the path of the position."""
    said = position.get("mapId")
    if meant := meant_map(said, maps):
        kind = RepairKind.LETTER_CASE if said else RepairKind.REPLACED
        repairs[f"{at}.mapId", kind] = quoted(said) if "mapId" in position else "missing"
        position["mapId"] = meant


POSITIONS: Final = frozenset({"agvPosition", "mobileRobotPosition"})
"""The robot's position in 2.x, and in 3.0."""


def repair_position(
    content: dict[str, Any], repairs: Repairs, *, in_degrees: bool, only_map: str = ""
) -> bool:
    """Convert a heading in degrees, and replace a mapId that means ``only_map``; return ``in_degrees``.

    Headings are in degrees from the first one that is beyond a full turn in radians.
    """
    for name in POSITIONS & content.keys():
        position = content[name]
        if not isinstance(position, dict):
            continue
        repair_map(position, [only_map] if only_map else [], repairs, name)
        theta = position.get("theta")
        heading: Any = _parse_number(theta) if isinstance(theta, str) else theta
        if type(heading) not in (int, float) or not _is_finite(heading):
            continue
        if in_degrees or abs(heading) > FULL_TURN:
            position["theta"] = remainder(radians(heading), 2 * pi)
            repairs[f"{name}.theta", RepairKind.DEGREES] = quoted(theta)
            in_degrees = True
    return in_degrees


def written(content: dict[str, Any]) -> bytes | None:
    """Serialise a repaired message; None if a value cannot be written as JSON."""
    try:
        return to_json(content, inf_nan_mode="constants")
    except (ValueError, RecursionError):
        return None


def repairs_of(repairs: Repairs) -> tuple[Repair, ...]:
    """Return the repairs, each field and kind once."""
    return tuple([Repair(field, kind, received) for (field, kind), received in repairs.items()])


def version_number(value: object) -> str | None:
    """Complete a version number of a robot (``2.1``, ``v2.1.0``, 2.1); None if it is not one."""
    return _complete_version(str(value)) if isinstance(value, str | int | float) else None


@lru_cache(maxsize=100)
def _complete_version(text: str) -> str | None:
    written = _VERSION.fullmatch(text)
    return ".".join(str(int(part or "0")) for part in written.groups()) if written else None


def _unix_time(value: object) -> datetime | None:
    """Return the time that a Unix time means: s of 10 digits, ms of 13, μs of 16 or ns of 19."""
    number = _parse_number(value) if isinstance(value, str) else value
    if isinstance(number, bool) or not isinstance(number, int | float):
        return None
    for unit in (1, 10**3, 10**6, 10**9):
        if 10**9 * unit <= number < 10**10 * unit:  # not divided: JSON integers may exceed floats
            return datetime.fromtimestamp(number / unit, UTC)
    return None


@cache
def _required_fields(form: type[Header]) -> frozenset[str]:
    return frozenset(field.name for field in fields_of(form) if field.required)


def _is_time(value: object) -> bool:
    # pydantic reads a Unix time in a text as a time; VDA 5050 3.0, 7.2 has ISO 8601 only
    if not isinstance(value, str) or _parse_number(value) is not None:
        return False
    try:
        _TIME.validate_json(to_json(value), strict=True)
    except (ValidationError, PydanticSerializationError):
        return False
    return True


@lru_cache(maxsize=10_000)
def _fields_of(
    form: type[WireObject], at: str, scope: Scope, only: frozenset[str]
) -> tuple[_FieldRepair, ...]:
    fields = (_FieldRepair.of(form, field, at, scope, only) for field in fields_of(form))
    return tuple(
        field
        for field in fields
        if not only or any(path == field.path or path.startswith(f"{field.path}.") for path in only)
    )


def _object_of(form: type[WireObject], at: str, scope: Scope, only: frozenset[str]) -> _Fix:
    """Return a function that repairs an object of ``form`` at the path ``at``, in place."""
    fields = _fields_of(form, at, scope, frozenset() if at in only else only)

    def fix(content: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
        if type(content) is not dict:
            raise _UnrepairableError
        problem: _UnrepairableError | None = None
        for field in fields:
            try:
                field.apply(content, repairs)
            except _UnrepairableError as error:
                problem = problem or error  # the others are repaired, so that only this one is reported
        if problem:
            raise problem
        return content

    return fix


@dataclass(frozen=True, slots=True)
class _FieldRepair:
    """Repairs one field of an object."""

    field: Field
    path: str
    fix: _Fix
    plain: type | None
    """Values of this type need no check."""
    empty: bool
    """Whether a missing value is read as an empty list."""
    optional: bool
    """Whether the field may be omitted."""
    safest: object
    default: object
    """Replaces a missing value."""

    @classmethod
    def of(
        cls, form: type[WireObject], field: Field, at: str, scope: Scope, only: frozenset[str]
    ) -> _FieldRepair:
        path = f"{at}.{field.wire[0]}" if at else field.wire[0]
        # a version's form overrides neutral fields, so the neutral class is among its bases
        keys = [(base, field.name) for base in form.__mro__]
        report = scope is not Scope.COMMAND
        nowhere = any(key in _NEVER_EMPTIED for key in keys)
        # a trajectory without one of its fields is another curve, so it is left out as a whole
        optional = report and not field.required and not issubclass(form, Trajectory)
        safest = next((SAFEST[key] for key in keys if key in SAFEST), None) if report else None
        missing = next((_MISSING_IN_COMMANDS[key] for key in keys if key in _MISSING_IN_COMMANDS), None)
        sent_as = next((_SENT_AS[key] for key in keys if key in _SENT_AS), None)
        emptied = report or bool(at) or field.name == "edges"  # an order may have a single node
        return cls(
            field=field,
            path=path,
            fix=_scalar_of_a_version(_fix_of(sent_as, path, scope, only))
            if sent_as and field.shape.kind is object
            else _fix_of(field.shape, path, scope, only),
            plain=field.shape.kind if field.shape.kind is bool else None,
            empty=field.shape.kind is tuple and field.required and not nowhere and emptied,
            optional=optional,
            safest=safest,
            default=safest if report else missing,
        )

    def apply(self, content: dict[str, Any], repairs: Repairs) -> None:
        name = self.field.wire[0]
        if name not in content:
            name = next((older for older in self.field.wire if older in content), name)
        value = content.get(name)
        if value is None:
            if self.field.required or (name in content and not self.field.nullable):
                self._replace_missing(content, name, repairs)
            return
        if type(value) is self.plain:
            return
        try:
            fixed = self.fix(value, repairs)
        except _UnrepairableError as error:
            if self.safest is not None:
                content[name] = self._safest_value()
                repairs[self.path, RepairKind.REPLACED] = quoted(value)
            elif self.optional:
                del content[name]
                repairs[self.path, RepairKind.LEFT_OUT] = error.within(self.path, value)
            else:
                raise _UnrepairableError(error.path or self.path, error.received or quoted(value)) from None
        else:
            if fixed is not value:
                content[name] = fixed

    def _replace_missing(self, content: dict[str, Any], name: str, repairs: Repairs) -> None:
        """Set a value that is missing or null."""
        received = "null" if name in content else "missing"
        if self.empty or (name in content and self.field.shape.kind is tuple):
            content[name] = []
            repairs[self.path, RepairKind.EMPTY_LIST] = received
        elif self.default is not None:
            content[name] = self._safest_value() if self.safest == {} else self.default
            repairs[self.path, RepairKind.REPLACED] = received
        elif self.optional:
            del content[name]
            repairs[self.path, RepairKind.LEFT_OUT] = "null"
        else:
            raise _UnrepairableError(self.path, received)

    def _safest_value(self) -> object:
        return self.fix({}, {}) if self.safest == {} else self.safest

    def empty_in(self, content: dict[str, Any]) -> None:
        """Leave out a field that cannot be repaired, or make it empty if it is required."""
        for name in self.field.wire:
            content.pop(name, None)
        if self.field.required:
            content[self.field.wire[0]] = [] if self.field.shape.kind is tuple else self.field.shape.kind()


def _fix_of(shape: Shape, at: str, scope: Scope, only: frozenset[str]) -> _Fix:
    kind = shape.kind
    if issubclass(kind, WireObject):
        return _object_of(kind, at, scope, only)
    if kind is tuple:
        return _list_of(shape, at, scope, only)
    if issubclass(kind, StrEnum):
        return _word_of(shape, at)
    if kind in (int, float):
        return _number_of(shape, at, scope)
    simple: dict[type, _Fix] = {str: _text_of(shape, at), bool: _boolean_of(at), datetime: _time_of(at)}
    return simple.get(kind, _keep_value)


def _keep_value(value: Any, _found: Repairs) -> Any:  # noqa: ANN401 - JSON
    return value


def _scalar_of_a_version(fix: _Fix) -> _Fix:
    """Return a fix of texts and numbers; whatever else is read by the version's own code."""
    return lambda value, repairs: fix(value, repairs) if isinstance(value, str | int | float) else value


def _time_of(at: str) -> _Fix:
    def fix(value: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
        if _is_time(value):
            return value
        time = _unix_time(value)
        if time is None:
            raise _UnrepairableError
        repairs[at, RepairKind.UNIX_TIME] = quoted(value)
        return iso(time)

    return fix


def _list_of(shape: Shape, at: str, scope: Scope, only: frozenset[str]) -> _Fix:
    item = shape.item or Shape(object)
    fix_item = _fix_of(item, at, scope, only)
    droppable = scope is not Scope.COMMAND and issubclass(item.kind, WireObject | StrEnum)
    droppable = droppable and not issubclass(item.kind, _NEVER_DROPPED)

    def fix(value: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
        if type(value) is str and value and scope is not Scope.COMMAND and issubclass(item.kind, str):
            repairs[at, RepairKind.TEXT_AS_LIST] = quoted(value)
            value = [value]
        if value == {}:  # so Lua and PHP write an empty list
            repairs[at, RepairKind.EMPTY_LIST] = "{}"
            value = []
        if type(value) is not list:
            raise _UnrepairableError
        kept: list[Any] = []
        problem: _UnrepairableError | None = None
        for element in value:
            try:
                kept.append(fix_item(element, repairs))
            except _UnrepairableError as error:
                if droppable:
                    repairs[at, RepairKind.LEFT_OUT] = error.within(at, element)
                else:
                    problem = problem or error
                    kept.append(element)
        value[:] = kept
        if problem:
            raise problem
        return value

    return fix


def _word_of(shape: Shape, at: str) -> _Fix:
    words = [*(member.value for member in shape.kind), *(shape.names or ())]  # type: ignore[attr-defined] # an enumeration
    accepted = frozenset(words)
    # reversed: if two words have the same letters, the enumeration's own wins over an older name
    by_letters = {letters_of(word): word for word in reversed(words)}

    def fix(value: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
        if type(value) is not str:
            raise _UnrepairableError
        if value in accepted:
            return value
        word = by_letters.get(letters_of(value))
        if word is None:
            raise _UnrepairableError
        repairs[at, RepairKind.LETTER_CASE] = quoted(value)
        return word

    return fix


def _text_of(shape: Shape, at: str) -> _Fix:
    def fix(value: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
        if type(value) is not str:
            if not isinstance(value, int | float):
                raise _UnrepairableError
            repairs[at, RepairKind.NUMBER_AS_TEXT] = quoted(value)
            value = to_json(value, inf_nan_mode="constants").decode()
        if shape.longest is not None and len(value) > shape.longest:
            raise _UnrepairableError
        return value

    return fix


def _boolean_of(at: str) -> _Fix:
    booleans = {"true": True, "false": False, "1": True, "0": False}

    def fix(value: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
        if type(value) is bool:
            return value
        word = str(value).strip().casefold() if isinstance(value, str | int) else ""
        if word not in booleans:
            raise _UnrepairableError
        repairs[at, RepairKind.TEXT_AS_BOOLEAN] = quoted(value)
        return booleans[word]

    return fix


def _number_of(shape: Shape, at: str, scope: Scope) -> _Fix:
    least, above, most, whole = shape.least, shape.above, shape.most, shape.kind is int

    def fix(value: Any, repairs: Repairs) -> Any:  # noqa: ANN401 - JSON
        number = value
        if type(number) is str:
            number = _parse_number(number)
            kind: RepairKind | None = RepairKind.TEXT_AS_NUMBER
        else:
            kind = None
        if type(number) not in (int, float) or not _is_finite(number):
            raise _UnrepairableError
        if whole and type(number) is float:
            if not number.is_integer():
                raise _UnrepairableError
            number, kind = int(number), kind or RepairKind.WHOLE_NUMBER
        if (
            (least is not None and number < least)
            or (most is not None and number > most)
            or (above is not None and number <= above)
        ):
            number, kind = _within_limits(number, shape, at, scope)
        if kind is None:
            return value
        repairs[at, kind] = quoted(value)
        return number

    return fix


def _is_finite(number: float) -> bool:
    try:
        return isfinite(number)
    except OverflowError:  # an integer beyond the range of floats
        return False


def _parse_number(text: str) -> float | int | None:
    if "_" in text:
        return None  # only Python accepts such a number
    try:
        return int(text) if text.strip().lstrip("+-").isdigit() else float(text)
    except ValueError:
        return None


def _within_limits(number: float, shape: Shape, at: str, scope: Scope) -> tuple[float, RepairKind]:
    """Clamp a number to the limits of its field, or wrap it.

    Raises:
        _UnrepairableError: the intended value is unclear.
    """
    any_heading = shape.least == 0 and number >= FULL_TURN_DEGREES / 2  # in either unit
    if shape.most == ANGLE_LIMIT and scope is Scope.COMMAND and abs(number) > FULL_TURN and not any_heading:
        raise _UnrepairableError  # may be degrees
    if shape.most == ANGLE_LIMIT and shape.least == 0:  # an allowed deviation; 2.x permits negative ones
        return min(max(number, 0.0), pi), RepairKind.CLAMPED
    if shape.most == ANGLE_LIMIT and shape.least == -ANGLE_LIMIT:
        return remainder(number, 2 * pi), RepairKind.ANGLE_WRAPPED
    of_percent = shape.most == _PERCENT and shape.least == 0
    if scope is not Scope.COMMAND and of_percent and -_TOLERANCE <= number <= _PERCENT + _TOLERANCE:
        return min(max(number, 0.0), _PERCENT), RepairKind.CLAMPED
    if scope is not Scope.COMMAND and at.endswith("localizationScore") and 1 < number <= _PERCENT:
        return number / _PERCENT, RepairKind.SCALED
    raise _UnrepairableError


def _convert_degrees(form: type[Header], content: dict[str, Any], repairs: Repairs) -> None:
    """Convert all angles of a command to radians if one of its headings can only be in degrees."""
    angles = list(_angles_in(form, content))
    beyond = [abs(value) > FULL_TURN and shape.least != 0 for _, _, _, value, shape in angles]
    # beyond a full turn in degrees, the unit is unknown
    if not any(beyond) or any(abs(value) > FULL_TURN_DEGREES for *_, value, _ in angles):
        return
    for parent, name, path, value, shape in angles:
        repairs[path, RepairKind.DEGREES] = quoted(parent[name])
        turn = radians(value)
        parent[name] = min(turn, pi) if shape.least == 0 else remainder(turn, 2 * pi)


def _angles_in(
    form: type[WireObject], content: dict[str, Any], at: str = ""
) -> Iterator[tuple[dict[str, Any], str, str, float, Shape]]:
    """Yield each readable angle of a message: its object, name, path, value and limits."""
    for field in fields_of(form):
        name = next((name for name in field.wire if name in content), field.wire[0])
        value, shape, path = content.get(name), field.shape.item or field.shape, f"{at}{field.wire[0]}"
        if issubclass(shape.kind, WireObject):
            for part in value if isinstance(value, list) else [value]:
                if isinstance(part, dict):
                    yield from _angles_in(shape.kind, part, f"{path}.")
        elif shape.most == ANGLE_LIMIT:
            number: Any = _parse_number(value) if isinstance(value, str) else value
            if type(number) in (int, float) and _is_finite(number):
                yield content, name, path, number, shape
