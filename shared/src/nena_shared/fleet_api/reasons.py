"""Reasons of the order service: a code, its values and its causes, and the English text made from them.

Everything that explains a state carries both: the text for logs, hosts and the CLI, and the code, which the
control panel puts into the words of its language.
"""

from __future__ import annotations

from datetime import datetime
from enum import Enum
from typing import Annotated, Any, Final, Self

from pydantic import Field, ValidationError, ValidatorFunctionWrapHandler, WrapValidator

from nena_shared.clock import iso
from nena_shared.fleet_api.base import Resource


class CodedReason(Resource):
    """A reason as a code, for clients that put it into words of their own."""

    code: str
    """Code, e.g. ``is_offline``; the text explains codes that a client does not know."""
    values: dict[str, str | int | float] = Field(default_factory=dict)
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


class ReasonCode(Enum):
    """Codes, each with its English sentence; the code is the name in lower case.

    ``causes`` are the texts of all causes, ``first`` and ``rest`` those of the first one and of the others.
    """

    WORDS = "{text}"
    """Words of a person, a host or a robot."""
    ALL = "{causes}"
    """Several reasons."""
    DETAILS = "{first}: {rest}"
    """A reason, and a robot's own descriptions of it."""

    # Life of a transport order
    CREATED = "created"
    WAITS_FOR_CONDITIONS = "waits for its conditions"
    WAITS_FOR_TURN = "waits for its turn"
    WAITS_FOR_ANOTHER_VEHICLE = "waits for another vehicle"
    WAITS_FOR_ORDER = "waits until {orders} is FINISHED"
    WAITS_FOR_ORDERS = "waits until {orders} are FINISHED"
    WAITS_FOR_MORE_ORDERS = "waits until {orders} and {count} more are FINISHED"
    WAITS_IN_SEQUENCE = "waits for its turn in order sequence {sequence!r}, after {order!r}"
    TRAVELS = "vehicle {vehicle} travels to destination {number} of {total}"
    DESTINATION = "destination {number} of {total}"
    ADOPTED = "vehicle {vehicle}"
    ADOPTED_RENAMED = "vehicle {vehicle}, which was {before}"
    ANY_VEHICLE = "any vehicle"
    OPERATES = "vehicle {vehicle} executes {operation!r} at destination {number}"
    DESTINATION_DONE = "vehicle {vehicle} is done at destination {number} of {total}"
    BUT = "{first}, but {rest}"
    DONE = "done by vehicle {vehicle}"
    DONE_WITHOUT = "done by vehicle {vehicle}, operations left out: {count}"
    HELD = "held by {by} since {since:%Y-%m-%d %H:%M:%S} UTC: {causes}"
    SINCE_THEN = "{first}; since then: {rest}"
    RELEASE_PENDING = "{causes}; waiting for vehicle {vehicle} to release it"
    WITHDRAWN = "withdrawn: {causes}"
    WITHDRAWN_UNSENT = "withdrawn before the vehicle had started: {causes}"
    BASE_FINISHED = "the vehicle had finished its base"
    RELEASED = "the vehicle has released it"
    WITHDRAWN_BY_HOST = "withdrawn by a host"
    WITHDRAWN_AT_PANEL = "withdrawn at the control panel"
    HELD_AT_PANEL = "held at the control panel"
    RESUMED_AT_PANEL = "resumed at the control panel"
    NO_REASON = "no reason given"
    NOT_STARTED = "its vehicle did not start it"
    NOT_DONE_SINCE_CREATION = "timeout: not done within {limit:g} s of its creation"
    NOT_DONE_SINCE_ASSIGNMENT = "timeout: not done within {limit:g} s of its assignment"
    GIVES_WAY = "gives way to order {order}"
    DEPENDENCY_ENDED = "order {order!r}, on which it depends, is {state}"
    SEQUENCE_FAILED = "order {order!r} of its sequence {sequence!r} is {state}: {causes}"
    LEVEL_SET = "the integration level of vehicle {vehicle} was set to {level}"
    VEHICLE_GONE = "vehicle {vehicle!r} no longer exists"
    VEHICLE_REPLACED = "vehicle {vehicle!r} is now another robot with another order"
    VDA_ORDER_UNREADABLE = "the VDA order of the vehicle is unreadable"
    NOT_POSSIBLE = "no longer possible in this plant: {causes}"
    CANNOT_CONTINUE = "vehicle {vehicle} cannot continue: {causes}"
    CANNOT_BUILD = "cannot build a VDA 5050 order: {causes}"

    # Failures, and the failure policy
    STOPPED_OPERATING = "the vehicle was stopped during its operation; check what it has done"
    AVOIDS = "{causes}; avoids {names}"
    PASSED_OVER = "{first} ({rest})"
    NO_MEASURE = "no {measure}: {causes}"
    UNKNOWN_PROGRESS = "it is unknown what the robot has done"
    ROBOT_INCAPABLE = "the robot cannot execute it"
    STILL_NO_ROUTE = "there would still be no route"
    DRIVE_NOT_FAILED = "the drive has not failed"
    NO_OTHER_ROUTE = "there is no other route"
    CARRIES_ITS_LOAD = "the vehicle carries a load of the order, so no other one can continue"
    ROBOT_SILENT = "the robot is silent, so it is unknown what it does"
    NO_OTHER_VEHICLE = "there is no other suitable vehicle"
    NO_OPERATION_FAILED = "no operation has failed"
    UNFIT = "the robot cannot execute the order: {causes}"
    NEVER_ACCEPTED = "the order was sent {count} times, but the robot never accepted it"
    ACCEPTANCE_UNREADABLE = (
        "the order was sent {count} times, and it is unknown whether the robot has accepted it: it {causes}"
    )
    UPDATE_NEVER_ACCEPTED = "an update was sent {count} times, but the robot never accepted it"
    UNDELIVERABLE = (
        "the MQTT broker ends the connection at messages on {topic}, so the robot cannot be reached"
    )
    REFUSED = "the robot refuses the order"
    REFUSES_UPDATE = "the robot refuses to continue the order"
    ROBOT_FAILED = "the robot cannot continue the order"
    ACTION_FAILED = "the action {action!r} has failed"
    STOPPED_WITH_ERROR = "the robot has stopped with an error"
    ACTIONS_UNREPORTED = "the robot does not report the actions of the order"
    CANCELLED = "cancelled"
    CANCEL_REFUSED = "{first}, but the robot does not confirm cancelOrder: {rest}"
    UNKNOWN_UPDATE = (
        "the robot has update {update} of the order, and update {known} is the last one known here: "
        "the store may be an older copy"
    )
    LOST = "the robot no longer has the order: it has no order; it may have restarted"
    LOST_TO_OTHER = "the robot no longer has the order: it has the order {order!r}; it may have restarted"
    ABANDONED = "the robot abandoned the order"
    ABANDONED_IN_MODE = "the robot abandoned the order when it changed to operating mode {mode}"

    # What a robot's factsheet rules out
    TOO_MANY = "its factsheet allows {limit} {causes}, not {count}"
    NODES = "nodes"
    EDGES = "edges"
    NODE_ACTIONS = "actions on node '{node}'"
    EDGE_ACTIONS = "actions on edge '{edge}'"
    NODE_STATES = "nodes to go in its state"
    EDGE_STATES = "edges to go in its state"
    ACTION_STATES = "actions in its state"
    ACTION_PARAMETERS = "parameters of the action '{action}'"
    LONG_LOAD_ID = "the loadId '{load}' is longer than {limit} characters"
    LONG_ID = "the id '{id}' is longer than {limit} characters"
    NOT_NUMERIC = "its factsheet requires numeric IDs, not '{id}'"
    UNLISTED_ACTION = "its factsheet does not list the action '{action}'"
    OTHER_SCOPES = "its factsheet lists the action '{action}' for {scopes}, not for {scope}"
    OTHER_BLOCKING = "its factsheet lists the action '{action}' for the blocking types {types}"
    MISSING_PARAMETER = "the action '{action}' requires the parameter '{parameter}' there"
    UNKNOWN_PARAMETER = "the action '{action}' has no parameter '{parameter}' there, only {known}"
    OTHER_TYPE = "the parameter '{parameter}' of '{action}' must be {type}, not {given}"
    MISSING_FIELD = "its factsheet requires the field '{field}', which cannot be filled here"
    NO_HEADINGS = "its factsheet does not list headings, so coordinates cannot have one"
    INEXPRESSIBLE = "it cannot be expressed in VDA 5050 {version}: {causes}"
    LONG_MESSAGE = "its factsheet allows messages of {limit} bytes, not {count}"

    # Choice of a vehicle; most are predicates that follow a vehicle's name
    WAITS_FOR_VEHICLE = "waits for vehicle {vehicle!r}, which {causes}"
    WAITS_FOR_ANY_VEHICLE = "waits for a vehicle: each of them {causes}"
    SOMETHING_ELSE = "something else"
    NO_VEHICLES = "waits for a vehicle: none in the plant model takes orders"
    VEHICLE_HAS_NO_ROUTE = "waits: vehicle {vehicle!r} has no route: {causes}"
    HAS_NO_ROUTE = "has no route: {causes}"
    FITS = "could do it now"
    ASSIGNED_LEAST_DRIVING = "least driving in total ({cost:.0f}), {count} free vehicles"
    ASSIGNED_FIRST_ORDER = "first by {key} of {count} orders for it"
    ASSIGNED_FIRST = "first by {key} of {count} free vehicles"
    ASSIGNED_CHEAPEST = "cheapest route ({cost:.0f}) of {count} free vehicles"
    ASSIGNED_INTENDED = "it is the intended vehicle"
    ASSIGNED_ONLY_FREE = "it is the only free vehicle"
    DOES_IT = "does it"
    TAKES_NO_ORDERS = "takes no orders"
    NOT_INTENDED = "is not the intended vehicle"
    INTENDED_IS = "is not {vehicle!r}, the intended vehicle"
    RESERVED_IS = "is not {vehicle!r}, which is reserved for it"
    BUSY = "works on another order"
    RESERVED = "is reserved for another order"
    HAS_DISPENSABLE_ORDER = "has a dispensable order"
    ENDS_DISPENSABLE_ORDER = "ends a dispensable order first"
    RECHARGES = "recharging until its energy is {level} %"
    MUST_RECHARGE = "must recharge first: critical energy (at most {level} %)"
    ACCEPTS_NO_TYPE = "accepts no orders of any type"
    ACCEPTS_OTHER_TYPES = "accepts no orders of type {type!r}, only {types}"
    LOADED = "carries a load and has no room for another one{causes}"
    LOADED_SEVERAL = "carries {count} loads and has no room for another one{causes}"
    AT_PLACE = " at {place!r}"
    FAILED_BEFORE = "has failed at this order"
    BOUND_TO_SEQUENCE = "is bound to order sequence {sequence!r}"
    NOT_OF_SEQUENCE = "is not the vehicle of order sequence {sequence!r}, which is {vehicle!r}"
    NOT_DISPATCHABLE = "cannot be dispatched: {causes}"
    NOT_IN_PLANT = "is not in the plant model"
    HAS_LEVEL = "has the integration level {level}"
    TAKEN_OUT = (
        "was taken out of dispatching, because {count} orders in a row have failed at it: "
        "check it, and set its integration level to TO_BE_UTILIZED. The last failure: {causes}"
    )
    UNKNOWN_ORDER = (
        "still works on the order {order!r}, which the order service does not know: "
        "wait for its end or cancel it"
    )
    OFF_ROUTE = "left its route or moves on its own, and has not been seen standing since"
    NO_MAP = "does not have map {map!r} (downloadMap, enableMap)"
    NO_MAP_ENABLED = "has no version of map {map!r} enabled (enableMap)"

    # Routes
    NO_ROUTE = (
        "No route from {source!r} to {goal}{causes}. "
        "Check the plant model for locked paths, missing reverse speeds and one-way tracks, "
        "and for restrictions of vehicle type, size or map."
    )
    NO_ROUTE_ANYWHERE = (
        "No route from {source!r} to an unreachable place{causes}. "
        "Check the plant model for locked paths, missing reverse speeds and one-way tracks, "
        "and for restrictions of vehicle type, size or map."
    )
    FOR_VEHICLE = " for vehicle {vehicle!r}"
    WITHOUT_NAMES = " without {names}"
    NO_ACCESS_POINT = "The first destination has no access point."
    CHOSEN_LATER = "its route is chosen when it starts"
    NOTHING_AHEAD = (
        "its whole route is released and stays as it is; a forced rerouting starts at the robot's position"
    )
    BEST_ROUTE = "it already has the best route"
    FORCED = "forced: it stops and continues from its position"
    BY_REQUEST = "requested by a host"
    PATH_WAS_LOCKED = "a path ahead was locked"
    LESS_TRAFFIC = "it waited, and there is less traffic"
    OFF_PATHS = "it drives to a coordinate, off the paths"
    TOO_EXPENSIVE = "the route is too expensive"
    PATH_LOCKED = "it waits until a path is unlocked: {causes}"

    # Requests that do not fit the plant
    FINDINGS = "{first} {rest}"
    AT_DESTINATION = "Destination {number}: {causes}"
    LOCATION_LOCKED = "location {location!r} is locked; unlock it or choose another one."
    UNKNOWN_PLACE = "unknown location or point {name!r}.{causes}"
    UNKNOWN_DEVICE = "unknown location {location!r} of a peripheral operation.{causes}"
    UNKNOWN_VEHICLE = "Unknown vehicle {vehicle!r}.{causes}"
    UNKNOWN_AVOIDED = "Property {property}: unknown point, path or location {name!r}."
    DID_YOU_MEAN = " Did you mean {causes}?"
    KNOWN_NAMES = " Known: {names}."
    NONE_KNOWN = " Known: none."
    NOT_AT_POINT = "operation {operation!r} is not possible at point {name!r}; only MOVE or PARK."
    NOT_AT_COORDINATE = "operation {operation!r} is not possible at a coordinate; only MOVE or PARK."
    NOT_AT_LOCATION = "operation {operation!r} is not possible at location {location!r}; possible: {names}."
    NOT_AT_DEVICE = "peripheral operation {operation!r} is not possible at {location!r}; possible: {names}."
    NO_DEVICE = "peripheral operation {operation!r} is not possible at {location!r}; possible: none."
    NO_LINK = "location {location!r} has no link to a point, so no vehicle can reach it."

    # State of a robot
    ROBOT = "the robot {causes}"
    IT = "it {causes}"
    NEVER_CONNECTED = "has never connected"
    IS_OFFLINE = "is offline: it has disconnected from the broker"
    IS_HIBERNATING = "is hibernating"
    CONNECTION_LOST = "has lost its connection to the broker"
    IS_SILENT = "is silent: it has not reported its state for too long"
    UNSEEN_SINCE_TAKEOVER = "has not reported its state since the order service took over"
    UNSEEN_SINCE_CONNECTION = "has not reported its state since it connected"
    STATELESS = "has not reported its state yet"
    NO_BROKER = "cannot be reached: the order service has no connection to the MQTT broker"
    UNREADABLE_STATES = "sends states that are unreadable: {causes}"
    OLD_STATES = (
        "sends states that are ignored, because neither headerId nor timestamp increases "
        "(received {received} after {last})"
    )
    UNREADABLE_CONNECTIONS = "sends connection messages that are unreadable: {causes}"
    IN_MODE = "is in operating mode {mode}, which takes no orders"
    WORKS_ON_ORDER = "still works on the order {order!r}"
    WORKS_ON_VDA_ORDER = "works on the VDA order {order!r}"
    FATAL_ERROR = "has a fatal error: {causes}"
    NO_NAVIGATION = "waits: {causes}"
    NOT_LOCALISED = "is not localised: set its initial position"
    EMERGENCY_STOP = "has an active emergency stop"
    IS_PAUSED = "is paused"
    IS_FREE = "is free"
    CANCEL_UNCONFIRMED = "has not yet confirmed a cancelOrder"
    IS_LEAVING = "is about to hibernate or to shut down"
    NO_FACTSHEET = "has not sent its factsheet yet"
    ORDER_UNCONFIRMED = "has not yet confirmed the order"
    END_UNCONFIRMED = "has not yet confirmed the end of the order"
    KEEPS_STATES = (
        "stands at the last node of its order, '{node}', but still lists {names} in its {field}: "
        "it must empty them (with {key}: to turn to the node's heading)"
    )
    NO_POSE = "it reports neither a trusted pose nor a known point: set its initial pose"
    INVALID_POSITION = "it reports an invalid position: x {x}, y {y}"
    UNKNOWN_FRAME = "its factsheet has not arrived, so the frame of its position is unknown"
    OTHER_MAP = "it is on map {map!r}, but its orders are on map {own!r}"
    NO_POINTS = "the plant model has no points"
    NO_STATE = "it has not reported its state yet"
    POSITION_UNKNOWN = "its position is unknown"
    TOO_FAR = (
        "its position is {metres} m from the nearest point {point!r}: check the units and the map transform"
    )
    UNSEEN_BY_TRAFFIC = "traffic control does not know where it stands and keeps nothing away from it"
    WAITS_FOR_UNREADABLE = "{first} ({vehicle} {rest})"
    JOINS_TRACK = "{causes}; it first drives {metres} m straight to {point!r}"

    # Traffic, stops and devices
    YIELDS_TO = "waits for {vehicles}, which passes {at!r} first"
    YIELDS_TO_SEVERAL = "waits for {vehicles}, which pass {at!r} first"
    STANDS_ON = "waits for {vehicles}, which stands on {at!r}"
    STAND_ON = "waits for {vehicles}, which stand on {at!r}"
    GOES_FIRST = "waits for {vehicles}, which goes first at {at!r} ({causes})"
    GO_FIRST = "waits for {vehicles}, which go first at {at!r} ({causes})"
    WOULD_TURN_BACK = "it would have to turn back {metres} m otherwise"
    WOULD_BLOCK = "they would block each other otherwise"
    WAITED_LONGER = "it has waited longer"
    MAKES_ROOM = "makes room for others"
    MAKES_ROOM_FIRST = "it makes room for others first"
    SHARES = "stands on {at!r} together with {vehicle}"
    FIRST_STATE = "it waits for the first state of {vehicles}"
    FIRST_STATES = "it waits for the first state of each robot"
    RETRIES_AT = "it retries at {time:%H:%M:%S} UTC"
    IS_STOPPED = "is stopped: {causes}"
    ALL_PAUSED = "all robots are paused by {by}: {causes}"
    AREA_PAUSED = "this area is paused by {by}: {causes}"
    CROSSES_PAUSED_AREA = "it would drive through an area that is paused by {by}: {causes}"
    PAUSE_UNCONFIRMED = "has not confirmed the pause yet"
    PAUSE_FAILED = "cannot be paused: {causes}"
    WAITS_FOR_PERIPHERAL = "it waits for peripheral {location!r} {causes}"
    PERIPHERAL_FAILED = "peripheral {location!r} has not executed {operation!r}"
    PERIPHERAL_FAILED_BY = "peripheral {location!r} has not executed {operation!r}: {causes}"

    # Idle vehicles
    NO_ORDERS = "idle: no waiting orders"
    NO_ORDER_FITS = (
        "idle: the waiting orders are for other vehicles or of types that it does not accept, are "
        "unreachable, or need room for another load"
    )
    WAITS_FOR_SEQUENCE = "waits for the next order of order sequence {sequence!r}"
    CANNOT_RECHARGE = "it should recharge, but {causes}"
    CANNOT_PARK = "it should park, but {causes}"
    IS_TAKEN = "is taken"
    IS_UNREACHABLE = "cannot be reached"
    IS_BARRED = "is behind vehicles that have already made room"
    ASSIGNED_PARKING = "its assigned parking position {point!r} {causes}"
    NO_POINT = "is not a point of the plant model"
    NO_PARKING_POSITIONS = "the plant model has no parking positions"
    PARKING_BARRED = "each free parking position near it is behind vehicles that have already made room"
    NO_PARKING_FREE = "no reachable parking position is free"
    RECHARGE_UNREACHABLE = (
        "it cannot recharge at its assigned recharge location {location!r}: it is unknown or unreachable"
    )
    NO_RECHARGE_LOCATION = "there is no reachable recharge location"
    ASSIGNED_RECHARGE_TAKEN = "its assigned recharge location {location!r} is taken"
    RECHARGE_TAKEN = "each recharge location is taken"

    # Peripheral jobs
    DEVICE_WAITS = "waits for the device {causes}"
    TO_EXECUTE = "to execute {operation!r}"
    TO_ACKNOWLEDGE = "to acknowledge {operation!r}"
    TO_FINISH = "to finish {operation!r}"
    TO_EXECUTE_REPORTS = "to execute {operation!r}; it reports {reported}"
    TO_ACKNOWLEDGE_REPORTS = "to acknowledge {operation!r}; it reports {reported}"
    TO_FINISH_REPORTS = "to finish {operation!r}; it reports {reported}"
    TO_EXECUTE_AFTER = "to execute {operation!r} after {other!r}"
    TO_EXECUTE_USED = "to execute {operation!r}; {vehicles} uses it"
    JOB_NEEDLESS = "its vehicle no longer needs it"
    JOBS_TOO_MANY = "more than {count} jobs wait for the device"
    DEVICE_SLOW = "peripheral {location!r} has not finished it within {limit:g} s"
    DEVICE_SLOW_REPORTS = (
        "peripheral {location!r} has not finished it within {limit:g} s; it reports {reported}"
    )
    DEVICE_SILENT = "peripheral {location!r} has not answered {count} requests"
    DEVICE_GIVES_NO_REASON = "the device gives no reason"

    # Instant actions
    ACTION_DONE = "done"
    ACTION_NOT_DONE = "the robot failed to execute it"
    ACTION_FORGOTTEN = "the robot no longer reports it; it may have restarted"
    ACTION_SHOWN_BY_LINK = "done: the robot is {link}"
    ACTION_UNSEEN = "sent {count} times, but the robot never reported it"
    ACTION_UNFINISHED = "the robot did not finish it within {limit:g} s"
    ACTION_PENDING = "the robot has not reported its end yet"
    ACTION_UNCERTAIN = "{causes}; it is unknown whether it received the action"
    ACTION_NOT_SENT = "not sent: {causes}"
    ACTION_UNFIT = "the robot cannot execute it: {causes}"
    ACTIONS_TOO_MANY = "{count} instant actions are active at the robot"
    ACTION_ID_USED = "the actionId {action!r} has been used before"
    INTERVENED = "is in operating mode INTERVENED, in which cancelOrder is the only instant action"
    MODE_WITHOUT_ACTIONS = "is in operating mode {mode}, which takes no instant actions"

    # Schedules
    RUN_LATE = "created late: the order service was not active at this time"
    RUNS_SKIPPED = "{count} skipped: the order service was not active at their planned times"
    RUNS_LONG_AGO = "skipped with all other runs that were missed more than {days} days ago"
    ORDER_EXISTS = "there is already an order {order}"
    ORDERS_OPEN = "open orders: {count} (maxOpenOrders)"

    @property
    def code(self) -> str:
        """The code, as sent."""
        return self._name_.lower()


JOINED: Final = {
    ReasonCode.WAITS_FOR_ANY_VEHICLE: " or ",
    ReasonCode.FINDINGS: " ",
    ReasonCode.DID_YOU_MEAN: " or ",
    ReasonCode.NO_ROUTE: "",
    ReasonCode.NO_ROUTE_ANYWHERE: "",
}
"""What stands between the causes of a reason; of all others: a semicolon."""

NOTED: Final = {code.value: code for code in ReasonCode if "{" not in code.value}
"""Reasons without values by their texts: a host may use them as words of its own."""


class Reason(str):
    """A reason: its English text, with the code, values and causes that the text is made from."""

    __slots__ = ("_coded", "_parts")

    _coded: CodedReason | None
    _parts: tuple[ReasonCode, tuple[str, ...], dict[str, str | float | datetime]] | None

    def __new__(cls, code: ReasonCode, /, *causes: str, **values: str | float | datetime) -> Self:
        """Return the reason of a code; a cause without a code is taken as someone's words."""
        words = {**values, "causes": "", "first": "", "rest": ""}
        if causes:
            between = JOINED.get(code, "; ")
            words |= {"causes": between.join(causes), "first": causes[0], "rest": between.join(causes[1:])}
        reason = str.__new__(cls, code._value_.format_map(words))
        reason._coded, reason._parts = None, (code, causes, values)  # noqa: SLF001 - its own
        return reason

    @classmethod
    def of(cls, text: str, coded: CodedReason | None = None) -> Reason:
        """Return a text with its code; without one, the text is someone's words, or a noted reason."""
        if isinstance(text, Reason):
            return text
        if coded is None:
            code = NOTED.get(text)
            return Reason(code) if code else Reason(ReasonCode.WORDS, text=text)
        reason = str.__new__(cls, text)
        reason._coded, reason._parts = coded, None  # noqa: SLF001 - its own
        return reason

    @property
    def coded(self) -> CodedReason:
        """The code, values and causes."""
        if self._coded is None:
            assert self._parts, "a reason has parts or a code"  # noqa: S101 - for the type
            code, causes, values = self._parts
            self._coded = CodedReason(
                code=code.code,
                values={name: _sent(each) for name, each in values.items()},
                causes=tuple(Reason.of(each).coded for each in causes),
            )
        return self._coded


_PLAIN: Final = (str, int, float)
"""Types of values that are the same in JSON, unlike times and enumerations."""


def _sent(value: str | float | datetime) -> str | float:
    """Return a value as in JSON; enumerations as text."""
    if type(value) in _PLAIN:
        return value  # type: ignore[return-value] # no time is plain
    if isinstance(value, datetime):
        return iso(value)
    return str(value) if isinstance(value, str) else value


def explained(reason: str) -> dict[str, Any]:
    """Return the fields ``reason`` and ``coded_reason`` of a status; without a reason, both are unset."""
    return {"reason": str(reason), "coded_reason": Reason.of(reason).coded if reason else None}


def reason_of(error: Exception) -> Reason:
    """Return the reason that an error was raised with; of other errors, the text."""
    first = error.args[0] if error.args else ""
    return first if isinstance(first, Reason) else Reason.of(str(error))
