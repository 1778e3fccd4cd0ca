"""Reasons of the order service: a code, its values and its causes.

The core makes and compares them. Their texts are in ``texts/LANGUAGE.json``, one table per language: hosts,
logs and the CLI get the English ones, the control panel those of its user.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum, auto
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import (
    Field,
    PlainSerializer,
    PlainValidator,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

from nena_shared.clock import iso
from nena_shared.fleet_api.base import Resource

# 0112: JSON, because the control panel reads the same tables
TEXTS: Final = Path(__file__).parent / "texts"
"""The folder with a table of texts for each language; the control panel serves it."""

Value = str | int | float


class CodedReason(Resource):
    """A reason as a code, for clients that put it into words of their own."""

    code: str
    """Code, e.g. ``is_offline``; the text explains codes that a client does not know."""
    values: dict[str, Value] = Field(default_factory=dict)
    """Values of its sentence; times in ISO 8601."""
    causes: tuple[CodedReason, ...] = ()
    """Reasons that its sentence contains."""


def _or_none(value: Any, read: ValidatorFunctionWrapHandler) -> CodedReason | None:  # noqa: ANN401 - anything
    try:
        return read(value)  # type: ignore[no-any-return] # as pydantic declares it
    except ValidationError:
        return None


OptionalReason = Annotated[CodedReason | None, WrapValidator(_or_none)]
"""A reason beside its text; None if there is none, or a newer order service's that cannot be read."""


class ReasonCode(StrEnum):
    """Codes, each with a text per language.

    In the texts, ``causes`` are the texts of all causes, ``first`` and ``rest`` those of the first one and of
    the others.
    """

    WORDS = auto()
    """Words of a person, a host or a robot."""
    ALL = auto()
    """Several reasons."""
    DETAILS = auto()
    """A reason, and a robot's own descriptions of it."""

    # Life of a transport order
    CREATED = auto()
    WAITS_FOR_CONDITIONS = auto()
    WAITS_FOR_TURN = auto()
    WAITS_FOR_ANOTHER_VEHICLE = auto()
    WAITS_FOR_ORDER = auto()
    WAITS_FOR_ORDERS = auto()
    WAITS_FOR_MORE_ORDERS = auto()
    WAITS_IN_SEQUENCE = auto()
    TRAVELS = auto()
    DESTINATION = auto()
    ADOPTED = auto()
    ADOPTED_RENAMED = auto()
    ANY_VEHICLE = auto()
    OPERATES = auto()
    DESTINATION_DONE = auto()
    BUT = auto()
    DONE = auto()
    DONE_WITHOUT = auto()
    HELD = auto()
    SINCE_THEN = auto()
    RELEASE_PENDING = auto()
    WITHDRAWN = auto()
    WITHDRAWN_UNSENT = auto()
    BASE_FINISHED = auto()
    RELEASED = auto()
    WITHDRAWN_BY_HOST = auto()
    WITHDRAWN_AT_PANEL = auto()
    HELD_AT_PANEL = auto()
    RESUMED_AT_PANEL = auto()
    NO_REASON = auto()
    NOT_STARTED = auto()
    NOT_DONE_SINCE_CREATION = auto()
    NOT_DONE_SINCE_ASSIGNMENT = auto()
    GIVES_WAY = auto()
    DEPENDENCY_ENDED = auto()
    SEQUENCE_FAILED = auto()
    LEVEL_SET = auto()
    VEHICLE_GONE = auto()
    VEHICLE_REPLACED = auto()
    VDA_ORDER_UNREADABLE = auto()
    NOT_POSSIBLE = auto()
    CANNOT_CONTINUE = auto()
    CANNOT_BUILD = auto()

    # Failures, and the failure policy
    STOPPED_OPERATING = auto()
    AVOIDS = auto()
    PASSED_OVER = auto()
    NO_MEASURE = auto()
    UNKNOWN_PROGRESS = auto()
    ROBOT_INCAPABLE = auto()
    STILL_NO_ROUTE = auto()
    DRIVE_NOT_FAILED = auto()
    NO_OTHER_ROUTE = auto()
    CARRIES_ITS_LOAD = auto()
    ROBOT_SILENT = auto()
    NO_OTHER_VEHICLE = auto()
    NO_OPERATION_FAILED = auto()
    UNFIT = auto()
    NEVER_ACCEPTED = auto()
    ACCEPTANCE_UNREADABLE = auto()
    UPDATE_NEVER_ACCEPTED = auto()
    UNDELIVERABLE = auto()
    REFUSED = auto()
    REFUSES_UPDATE = auto()
    ROBOT_FAILED = auto()
    ACTION_FAILED = auto()
    STOPPED_WITH_ERROR = auto()
    ACTIONS_UNREPORTED = auto()
    CANCELLED = auto()
    CANCEL_REFUSED = auto()
    UNKNOWN_UPDATE = auto()
    LOST = auto()
    LOST_TO_OTHER = auto()
    ABANDONED = auto()
    REPORTS_ORDER = auto()
    REPORTS_LAST_NODE = auto()
    ABANDONED_IN_MODE = auto()

    # What a robot's factsheet rules out
    TOO_MANY = auto()
    NODES = auto()
    EDGES = auto()
    NODE_ACTIONS = auto()
    EDGE_ACTIONS = auto()
    NODE_STATES = auto()
    EDGE_STATES = auto()
    ACTION_STATES = auto()
    ACTION_PARAMETERS = auto()
    LONG_LOAD_ID = auto()
    LONG_ID = auto()
    NOT_NUMERIC = auto()
    UNLISTED_ACTION = auto()
    OTHER_SCOPES = auto()
    OTHER_BLOCKING = auto()
    MISSING_PARAMETER = auto()
    UNKNOWN_PARAMETER = auto()
    OTHER_TYPE = auto()
    MISSING_FIELD = auto()
    NO_HEADINGS = auto()
    INEXPRESSIBLE = auto()
    LONG_MESSAGE = auto()

    # Choice of a vehicle; most are predicates that follow a vehicle's name
    WAITS_FOR_VEHICLE = auto()
    WAITS_FOR_ANY_VEHICLE = auto()
    SOMETHING_ELSE = auto()
    NO_VEHICLES = auto()
    VEHICLE_HAS_NO_ROUTE = auto()
    HAS_NO_ROUTE = auto()
    FITS = auto()
    ASSIGNED_LEAST_DRIVING = auto()
    ASSIGNED_FIRST_ORDER = auto()
    ASSIGNED_FIRST = auto()
    ASSIGNED_CHEAPEST = auto()
    ASSIGNED_INTENDED = auto()
    ASSIGNED_ONLY_FREE = auto()
    DOES_IT = auto()
    TAKES_NO_ORDERS = auto()
    NOT_INTENDED = auto()
    INTENDED_IS = auto()
    RESERVED_IS = auto()
    BUSY = auto()
    RESERVED = auto()
    HAS_DISPENSABLE_ORDER = auto()
    ENDS_DISPENSABLE_ORDER = auto()
    RECHARGES = auto()
    MUST_RECHARGE = auto()
    ACCEPTS_NO_TYPE = auto()
    ACCEPTS_OTHER_TYPES = auto()
    LOADED = auto()
    LOADED_SEVERAL = auto()
    AT_PLACE = auto()
    FAILED_BEFORE = auto()
    BOUND_TO_SEQUENCE = auto()
    NOT_OF_SEQUENCE = auto()
    NOT_DISPATCHABLE = auto()
    NOT_IN_PLANT = auto()
    HAS_LEVEL = auto()
    TAKEN_OUT = auto()
    UNKNOWN_ORDER = auto()
    OFF_ROUTE = auto()
    NO_MAP = auto()
    NO_MAP_ENABLED = auto()

    # Routes
    NO_ROUTE = auto()
    NO_ROUTE_ANYWHERE = auto()
    FOR_VEHICLE = auto()
    WITHOUT_NAMES = auto()
    WAY_MISSING = auto()
    WAY_LOCKED = auto()
    WAY_ONE_WAY = auto()
    WAY_NO_SPEED = auto()
    WAY_OTHER_TYPES = auto()
    WAY_LOW = auto()
    WAY_OTHER_MAP = auto()
    WAY_BY_COST = auto()
    WAY_NEEDED = auto()
    NO_ACCESS_POINT = auto()
    CHOSEN_LATER = auto()
    NOTHING_AHEAD = auto()
    BEST_ROUTE = auto()
    FORCED = auto()
    BY_REQUEST = auto()
    PATH_WAS_LOCKED = auto()
    LESS_TRAFFIC = auto()
    OFF_PATHS = auto()
    TOO_EXPENSIVE = auto()
    PATH_LOCKED = auto()

    # Requests that do not fit the plant
    FINDINGS = auto()
    AT_DESTINATION = auto()
    LOCATION_LOCKED = auto()
    UNKNOWN_PLACE = auto()
    UNKNOWN_DEVICE = auto()
    UNKNOWN_VEHICLE = auto()
    UNKNOWN_AVOIDED = auto()
    DID_YOU_MEAN = auto()
    KNOWN_NAMES = auto()
    NONE_KNOWN = auto()
    NOT_AT_POINT = auto()
    NOT_AT_COORDINATE = auto()
    NOT_AT_LOCATION = auto()
    NOT_AT_DEVICE = auto()
    NO_DEVICE = auto()
    NO_LINK = auto()

    # State of a robot
    ROBOT = auto()
    IT = auto()
    NEVER_CONNECTED = auto()
    OTHER_TOPIC = auto()
    IS_OFFLINE = auto()
    IS_HIBERNATING = auto()
    CONNECTION_LOST = auto()
    IS_SILENT = auto()
    UNSEEN_SINCE_TAKEOVER = auto()
    UNSEEN_SINCE_CONNECTION = auto()
    STATELESS = auto()
    NO_BROKER = auto()
    UNREADABLE_STATES = auto()
    OLD_STATES = auto()
    UNREADABLE_CONNECTIONS = auto()
    IN_MODE = auto()
    WORKS_ON_ORDER = auto()
    UNREAD_ACTION = auto()
    WORKS_ON_VDA_ORDER = auto()
    FATAL_ERROR = auto()
    NO_NAVIGATION = auto()
    NOT_LOCALISED = auto()
    SAFEST_READING = auto()
    EMERGENCY_STOP = auto()
    IS_PAUSED = auto()
    IS_FREE = auto()
    CANCEL_UNCONFIRMED = auto()
    IS_LEAVING = auto()
    NO_FACTSHEET = auto()
    ORDER_UNCONFIRMED = auto()
    ORDER_INTERVAL = auto()
    END_UNCONFIRMED = auto()
    KEEPS_STATES = auto()
    NO_POSE = auto()
    INVALID_POSITION = auto()
    UNKNOWN_FRAME = auto()
    OTHER_MAP = auto()
    NO_POINTS = auto()
    NO_STATE = auto()
    POSITION_UNKNOWN = auto()
    TOO_FAR = auto()
    UNSEEN_BY_TRAFFIC = auto()
    WAITS_FOR_UNREADABLE = auto()
    JOINS_TRACK = auto()

    # Traffic, stops and devices
    YIELDS_TO = auto()
    YIELDS_TO_SEVERAL = auto()
    STANDS_ON = auto()
    STAND_ON = auto()
    GOES_FIRST = auto()
    GO_FIRST = auto()
    WOULD_TURN_BACK = auto()
    WOULD_BLOCK = auto()
    WAITED_LONGER = auto()
    MAKES_ROOM = auto()
    MAKES_ROOM_FIRST = auto()
    SHARES = auto()
    FIRST_STATE = auto()
    FIRST_STATES = auto()
    RETRIES_AT = auto()
    IS_STOPPED = auto()
    ALL_PAUSED = auto()
    AREA_PAUSED = auto()
    CROSSES_PAUSED_AREA = auto()
    PAUSE_UNCONFIRMED = auto()
    PAUSE_FAILED = auto()
    WAITS_FOR_PERIPHERAL = auto()
    PERIPHERAL_FAILED = auto()
    PERIPHERAL_FAILED_BY = auto()

    # Idle vehicles
    NO_ORDERS = auto()
    NO_ORDER_FITS = auto()
    WAITS_FOR_SEQUENCE = auto()
    CANNOT_RECHARGE = auto()
    CANNOT_PARK = auto()
    IS_TAKEN = auto()
    IS_UNREACHABLE = auto()
    IS_BARRED = auto()
    ASSIGNED_PARKING = auto()
    NO_POINT = auto()
    NO_PARKING_POSITIONS = auto()
    PARKING_BARRED = auto()
    NO_PARKING_FREE = auto()
    ASSIGNED_RECHARGE = auto()
    NO_RECHARGE_LOCATION = auto()
    RECHARGE_TAKEN = auto()

    # Peripheral jobs
    DEVICE_WAITS = auto()
    TO_EXECUTE = auto()
    TO_ACKNOWLEDGE = auto()
    TO_FINISH = auto()
    TO_EXECUTE_REPORTS = auto()
    TO_ACKNOWLEDGE_REPORTS = auto()
    TO_FINISH_REPORTS = auto()
    TO_EXECUTE_AFTER = auto()
    TO_EXECUTE_USED = auto()
    JOB_NEEDLESS = auto()
    JOBS_TOO_MANY = auto()
    DEVICE_SLOW = auto()
    DEVICE_SLOW_REPORTS = auto()
    DEVICE_SILENT = auto()
    DEVICE_GIVES_NO_REASON = auto()

    # Instant actions
    ACTION_DONE = auto()
    ACTION_NOT_DONE = auto()
    ACTION_FORGOTTEN = auto()
    ACTION_SHOWN_BY_LINK = auto()
    ACTION_UNSEEN = auto()
    ACTION_UNFINISHED = auto()
    ACTION_PENDING = auto()
    ACTION_UNCERTAIN = auto()
    ACTION_NOT_SENT = auto()
    ACTION_UNFIT = auto()
    ACTIONS_TOO_MANY = auto()
    ACTION_ID_USED = auto()
    INTERVENED = auto()
    MODE_WITHOUT_ACTIONS = auto()

    # Schedules
    RUN_LATE = auto()
    RUNS_SKIPPED = auto()
    RUNS_LONG_AGO = auto()
    ORDER_EXISTS = auto()
    ORDERS_OPEN = auto()


_TABLE: Final[dict[str, str]] = json.loads((TEXTS / "en.json").read_text(encoding="utf-8"))

_FORMS: Final = {code: re.sub(r"'\{(\w+)\}'", r"{\1!r}", _TABLE[code]) for code in ReasonCode}
"""The English texts; names with quotes or control characters are escaped."""

_SHOWN: Final = {"cost": "{:.0f}", "since": "{:%Y-%m-%d %H:%M:%S} UTC", "time": "{:%H:%M:%S} UTC"}
"""How values are shown in English, by name; others as they are."""

_ENUMERATIONS: Final = ("level", "link", "measure", "mode", "reported", "state")
"""Values that are names of enumerations, in words in English: in small letters, except the levels."""

_LEVELS: Final = {
    "TO_BE_UTILIZED": "In use",
    "TO_BE_RESPECTED": "Out of use",
    "TO_BE_NOTICED": "Shown only",
    "TO_BE_IGNORED": "Ignored",
}

_JOINED: Final = {
    ReasonCode.WAITS_FOR_ANY_VEHICLE: _TABLE["or"],
    ReasonCode.FINDINGS: " ",
    ReasonCode.DID_YOU_MEAN: _TABLE["or"],
    ReasonCode.NO_ROUTE: "",
    ReasonCode.NO_ROUTE_ANYWHERE: "",
}
"""What stands between the causes of a reason; of all others: a semicolon. The panel has the same."""

_NOTED: Final = {_TABLE[code]: code for code in ReasonCode if "{" not in _TABLE[code]}
"""Reasons without values by their texts: a host may use them as words of its own."""


@dataclass(frozen=True, init=False)
class Reason:
    """A reason; two are equal if their codes, values and causes are. ``str`` returns the English text."""

    code: ReasonCode
    # a dictionary has no hash; equality compares it nevertheless
    values: dict[str, Value] = field(hash=False)
    """As they are sent: times in ISO 8601."""
    causes: tuple[Reason, ...]

    def __init__(self, code: ReasonCode, /, *causes: Reason | str, **values: str | float | datetime) -> None:
        """Store a reason; a cause without a code is taken as someone's words."""
        object.__setattr__(self, "code", code)
        object.__setattr__(self, "values", {name: _sent(value) for name, value in values.items()})
        object.__setattr__(self, "causes", tuple(map(Reason.of, causes)))

    @classmethod
    def of(cls, text: Reason | str, coded: CodedReason | None = None) -> Reason:
        """Return the reason of a text that was stored or sent with its code.

        Without a code, or with one of another version, the text is someone's words, or a noted reason.
        """
        if isinstance(text, Reason):
            return text
        if coded is None:
            # 0112: the panel sends such texts as a person's words, and each user reads them in their language
            code = _NOTED.get(text)
            return Reason(code) if code else Reason(ReasonCode.WORDS, text=text)
        try:
            return _read(coded)
        except ValueError:
            return Reason(ReasonCode.WORDS, text=text)

    def is_sent_as(self, coded: CodedReason | None) -> bool:
        """Return whether a status already has this reason; cheaper than to compare with :attr:`coded`."""
        return (
            coded is not None
            # 0112: codes, not texts: each decision asks this for each waiting order
            and (self.code, self.values) == (coded.code, coded.values)
            and len(self.causes) == len(coded.causes)
            and all(map(Reason.is_sent_as, self.causes, coded.causes))
        )

    @cached_property
    def coded(self) -> CodedReason:
        """The reason as it is sent."""
        return CodedReason(
            code=self.code.value, values=self.values, causes=tuple(cause.coded for cause in self.causes)
        )

    def __str__(self) -> str:
        return self._text

    @cached_property
    def _text(self) -> str:
        between = _JOINED.get(self.code, "; ")
        first, *rest = map(str, self.causes) if self.causes else [""]
        words = {"causes": between.join([first, *rest]), "first": first, "rest": between.join(rest)}
        for name, value in self.values.items():
            words[name] = _shown(name, value)
        return _FORMS[self.code].format_map(words)


def _read(coded: CodedReason) -> Reason:
    """Return a reason that was sent; raises ValueError if this version does not know its code."""
    return Reason(ReasonCode(coded.code), *map(_read, coded.causes), **coded.values)


_PLAIN: Final = (str, int, float)
"""Types of values that are the same in JSON, unlike times and enumerations."""


def _sent(value: str | float | datetime) -> Value:
    """Return a value as in JSON; enumerations as text."""
    # exactly these types: an enumeration is a text, too, but is sent as a plain one
    if type(value) in _PLAIN:
        return value  # type: ignore[return-value] # no time is plain
    if isinstance(value, datetime):
        return iso(value)
    return str(value) if isinstance(value, str) else value


def _shown(name: str, value: Value) -> str:
    """Return a value as it is shown in English."""
    if form := _SHOWN.get(name):
        return form.format(datetime.fromisoformat(value) if isinstance(value, str) else value)
    if name in _ENUMERATIONS and isinstance(value, str):
        return _LEVELS.get(value) or value.replace("_", " ").lower()
    return f"{value:g}" if name == "limit" and isinstance(value, float) else str(value)


def _read_text(text: Reason | str) -> Reason:
    return Reason.of(text)


StoredReason = Annotated[Reason, PlainValidator(_read_text), PlainSerializer(str)]
"""A reason in a document that has no field for its code: stored as text, and read as someone's words."""


def explained(reason: Reason | str | None) -> dict[str, Any]:
    """Return the fields ``reason`` and ``coded_reason`` of a status; without a reason, both are unset."""
    if not reason:
        return {"reason": "", "coded_reason": None}
    reason = Reason.of(reason)
    return {"reason": str(reason), "coded_reason": reason.coded}


def reason_of(error: Exception) -> Reason:
    """Return the reason that an error was raised with; of other errors, the text."""
    first = getattr(error, "reason", None) or (error.args[0] if error.args else "")
    return first if isinstance(first, Reason) else Reason.of(str(error))
