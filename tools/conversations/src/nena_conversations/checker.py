"""Check a conversation message by message against the rules of its version."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta
from typing import Final

from pydantic import JsonValue, ValidationError
from pydantic_core import from_json

from nena_conversations.actions import InstantConversation, order_action_problems, status_problems
from nena_conversations.message import ReceivedMessage, Sender, parse
from nena_conversations.orders import OrderConversation, actions_of
from nena_conversations.pending import BoundedDict
from nena_conversations.recording import Entry
from nena_conversations.rules import Finding, Problem, Rule, Severity
from nena_shared.vda5050.action import STOP_HIBERNATION, Action, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import KINDS
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, MaximumArrayLengths, ProtocolLimits
from nena_shared.vda5050.graph import violations
from nena_shared.vda5050.malformed import TWICE, repeated_key
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.units import units_in_doubt

MAX_REPORTED: Final = 5
"""Maximum number of findings of one rule about one message."""
TIMES: Final = frozenset({"timestamp", "leaseExpiry", "eta"})
ONLY_READ: Final = frozenset({"AUTOACK"})
"""Values of 2.x that the neutral model maps to other fields: not a spelling problem."""
GRAPH_RULES: Final = {
    "sequenceId": Rule.SEQUENCE,
    "released": Rule.BASE,
    "actionId": Rule.ACTION_ID,
}
"""Rule that a problem of a graph breaks, by its field."""


def message_problems(received: ReceivedMessage) -> Iterator[Problem]:
    """Yield the problems of one message: malformed, unknown fields, deviating spelling."""
    if received.message is None:
        broken = _graph_violations(received)
        for problem in received.problems:
            field = problem.partition(":")[0].rpartition(".")[2]
            rule = GRAPH_RULES.get(field, Rule.GRAPH) if problem in broken else Rule.MESSAGE
            yield rule, Severity.ERROR, problem
        return
    if key := repeated_key(received.payload):
        yield Rule.MESSAGE, Severity.ERROR, f"{key}: {TWICE}"
    # 0010: our codecs read misspellings and unknown fields, so only what they would write shows them.
    written: JsonValue = received.message.model_dump(mode="json", by_alias=True)
    deviations = list(_check_form(from_json(received.payload), written, ""))
    for rule in (Rule.FIELD, Rule.SPELLING):
        yield from [deviation for deviation in deviations if deviation[0] is rule][:MAX_REPORTED]


def _graph_violations(received: ReceivedMessage) -> tuple[str, ...]:
    """Return the graph rules broken by an order that is well-formed otherwise."""
    form = received.codec.forms.get(KINDS[received.topic], Header)
    try:
        order = form.model_validate_json(received.payload, by_alias=True, by_name=False)
    except ValidationError:
        return ()
    return violations(order) if isinstance(order, Order) else ()


def _check_form(given: JsonValue, written: JsonValue, path: str) -> Iterator[Problem]:
    """Compare a message with its form as its version writes it; ``path`` is the current field."""
    if isinstance(given, dict) and isinstance(written, dict):
        for key, value in given.items():
            where = f"{path}.{key}" if path else key
            if key in written:
                yield from _check_form(value, written[key], where)
            else:
                yield Rule.FIELD, Severity.WARNING, f"{where} is not a field of this version and is ignored"
    elif isinstance(given, list) and isinstance(written, list):
        for index, (one, other) in enumerate(zip(given, written, strict=False)):
            yield from _check_form(one, other, f"{path}.{index}")
    elif isinstance(given, str):
        yield from _check_spelling(given, written, path)


def _check_spelling(given: str, written: JsonValue, path: str) -> Iterator[Problem]:
    if path.rsplit(".", 1)[-1] in TIMES:
        # Only the zone: versions differ in the digits of a second, and 2.0 contradicts itself about them.
        if not given.endswith("Z"):
            yield (
                Rule.SPELLING,
                Severity.WARNING,
                f"{path} '{given}' is not in UTC with a trailing Z",
            )
    elif given != written and given not in ONLY_READ:
        yield Rule.SPELLING, Severity.ERROR, f"{path} is written '{given}'; this version writes '{written}'"


HEADER_IDS: Final = 2**32


class HeaderChecks:
    """Check headers: IDs increase by one on each topic, timestamps do not go back (7.2)."""

    def __init__(self) -> None:
        self._last: dict[Topic, tuple[int, datetime]] = {}

    def check(self, received: ReceivedMessage, message: Header) -> Iterator[Problem]:
        """Compare a message with the previous one on its topic."""
        if received.codec.major_version != received.major_version:
            text = f"the topic has {received.major_version}, the header {message.version}"
            yield Rule.VERSION, Severity.ERROR, text
        named = RobotKey(message.manufacturer, message.serial_number)
        if named != received.robot:
            text = f"the topic belongs to {received.robot}, the header names {named}"
            yield Rule.ADDRESS, Severity.ERROR, text
        last = self._last.get(received.topic)
        if received.topic is Topic.CONNECTION or received.retained:
            return  # wills and retained messages have older headers
        self._last[received.topic] = message.header_id, message.timestamp
        if last:
            yield from _compare_headers(message, *last)


def _compare_headers(message: Header, last_id: int, last_time: datetime) -> Iterator[Problem]:
    expected = (last_id + 1) % HEADER_IDS
    # VDA 5050 names no start value: a sender that stored none counts from 0 after a restart.
    if message.header_id not in (expected, 0):
        text = f"headerId {message.header_id} follows {last_id}: messages are missing or out of order"
        yield Rule.HEADER_ID, Severity.WARNING, text
    if message.timestamp < last_time:
        text = f"timestamp {message.timestamp:%H:%M:%S.%f} follows {last_time:%H:%M:%S.%f}"
        yield Rule.TIMESTAMP, Severity.WARNING, text


JITTER: Final = 0.5
"""Seconds by which the time between two orders may be too short, because of the broker's delay."""
MAX_STATE_INTERVAL: Final = timedelta(seconds=30)
GRACE: Final = timedelta(seconds=5)
"""Tolerance for the broker's delay and inexact clocks."""

NOT_ONLINE: Final = {
    ConnectionState.OFFLINE: Severity.ERROR,
    ConnectionState.HIBERNATING: Severity.ERROR,
    # a broker may publish the will of an old connection after the new one is established
    ConnectionState.CONNECTION_BROKEN: Severity.WARNING,
}


UNREACHABLE: Final = (ConnectionState.OFFLINE, ConnectionState.CONNECTION_BROKEN)


class ConnectionChecks:
    """Check that only a connected robot sends states, and at least as often as it must (6.5, 6.6)."""

    def __init__(self) -> None:
        self._interval = MAX_STATE_INTERVAL
        self._connection: ConnectionState | None = None
        self._last: ReceivedMessage | None = None
        """Last state; None while no next state is due."""
        self._reported = False

    def on_factsheet(self, message: Factsheet) -> None:
        """Record the interval that the robot declares, if any."""
        seconds = message.protocol_limits.timing.default_state_interval
        self._interval = timedelta(seconds=seconds) if seconds else MAX_STATE_INTERVAL

    def on_connection(self, message: Connection) -> None:
        """Record the connection state and restart the interval."""
        self._connection = message.connection_state
        self._last = None
        self._reported = False

    def on_request(self, *requests: str) -> Iterator[Problem]:
        """Check what is sent to a robot: while it hibernates, it answers only stopHibernation (6.2.3)."""
        if self._connection in UNREACHABLE:
            text = f"{requests[0]} is sent to a robot whose connection is {self._connection}"
            yield Rule.OFFLINE, Severity.WARNING, text
        if self._connection is ConnectionState.HIBERNATING:
            for request in requests:
                if request != STOP_HIBERNATION:
                    text = f"{request} is sent to a hibernating robot, which answers only {STOP_HIBERNATION}"
                    yield Rule.CONNECTION, Severity.WARNING, text

    def on_state(self, received: ReceivedMessage) -> Iterator[Problem]:
        """Yield problems of the time at which a state arrives."""
        if received.retained:
            return
        if self._connection in NOT_ONLINE and not self._reported:
            self._reported = True
            text = f"the robot sends a state while its connection is {self._connection}"
            yield Rule.CONNECTION, NOT_ONLINE[self._connection], text
        if self._last and received.time - self._last.time > self._interval + GRACE:
            seconds = (received.time - self._last.time).total_seconds()
            yield Rule.STATE_INTERVAL, Severity.ERROR, f"no state for {seconds:.0f} s"
        self._last = received

    def overdue_state(self, now: datetime) -> tuple[ReceivedMessage, Problem] | None:
        """Report once that the state after the last one is overdue at ``now``."""
        last = self._last
        if last is None or now - last.time <= self._interval + GRACE:
            return None
        self._last = None
        text = f"no state follows this one for {(now - last.time).total_seconds():.0f} s"
        return last, (Rule.STATE_INTERVAL, Severity.ERROR, text)


class FactsheetChecks:
    """Check that fleet control keeps to the factsheet (7.10); without one, all pass."""

    def __init__(self) -> None:
        self._scopes: dict[str, tuple[ActionScope, ...]] | None = None
        self._limits: ProtocolLimits | None = None
        self._ordered: datetime | None = None
        """Time of the last order."""

    def on_factsheet(self, message: Factsheet) -> None:
        """Record the actions that the robot supports, and its limits."""
        actions = message.protocol_features.mobile_robot_actions
        self._scopes = {action.action_type: tuple(action.action_scopes) for action in actions}
        self._limits = message.protocol_limits

    def on_message(self, received: ReceivedMessage, message: Order | InstantActions) -> Iterator[Problem]:
        """Check the lengths of a message, and the time between two orders."""
        if self._limits is None:
            return
        longest = self._limits.maximum_string_lengths
        sizes = [("the message", len(received.payload), longest.maximum_message_length)]
        sizes += [(f"the ID '{each}'", len(each), longest.maximum_id_length) for each in _ids_of(message)]
        for what, length, most in [*sizes, *_lengths_of(message, self._limits.maximum_array_lengths)]:
            if most and length > most:
                text = f"{what} has a length of {length}, the factsheet allows {most}"
                yield Rule.LIMITS, Severity.ERROR, text
        if isinstance(message, Order):
            last, self._ordered = self._ordered, received.time
            shortest = self._limits.timing.minimum_order_interval
            if last and (seconds := (received.time - last).total_seconds()) < shortest - JITTER:
                text = f"an order follows after {seconds:.3f} s, the factsheet allows {shortest:g} s"
                yield Rule.ORDER_INTERVAL, Severity.WARNING, text

    def on_order(self, order: Order) -> Iterator[Problem]:
        """Check the actions of an order."""
        for node in order.nodes:
            yield from self.check(node.actions, ActionScope.NODE)
        for edge in order.edges:
            yield from self.check(edge.actions, ActionScope.EDGE)

    def check(self, actions: Iterable[Action], scope: ActionScope) -> Iterator[Problem]:
        """Check actions requested in one scope."""
        # A recording that begins after the factsheet says nothing about what the robot offers.
        for action in actions if self._scopes is not None else ():
            scopes = (self._scopes or {}).get(action.action_type)
            if scopes is None:
                text = f"the factsheet does not list '{action.action_type}' of action '{action.action_id}'"
                yield Rule.NOT_OFFERED, Severity.WARNING, text
            elif scope not in scopes:
                text = f"the factsheet lists '{action.action_type}', but not for {scope}"
                yield Rule.NOT_OFFERED, Severity.WARNING, text


def _ids_of(message: Order | InstantActions) -> Iterator[str]:
    if isinstance(message, InstantActions):
        yield from (action.action_id for action in message.actions)
        return
    yield message.order_id
    yield from (node.node_id for node in message.nodes)
    yield from (edge.edge_id for edge in message.edges)
    yield from (action.action_id for action in actions_of(message))


def _lengths_of(
    message: Order | InstantActions, limits: MaximumArrayLengths
) -> Iterator[tuple[str, int, int | None]]:
    """Yield the lists of a message that have a limit, with their length."""
    if isinstance(message, InstantActions):
        yield "actions", len(message.actions), limits.instant_actions
        actions: Iterable[Action] = message.actions
    else:
        yield "nodes", len(message.nodes), limits.order_nodes
        yield "edges", len(message.edges), limits.order_edges
        for node in message.nodes:
            yield f"actions of node '{node.node_id}'", len(node.actions), limits.node_actions
        for edge in message.edges:
            yield f"actions of edge '{edge.edge_id}'", len(edge.actions), limits.edge_actions
        actions = actions_of(message)
    for action in actions:
        name = f"actionParameters of '{action.action_id}'"
        yield name, len(action.action_parameters), limits.action_parameters


class ActionIds:
    """Check that an actionId identifies one action, ever (7.3)."""

    def __init__(self) -> None:
        self._known: BoundedDict[str, tuple[str, str]] = BoundedDict()

    def check(self, actions: Iterable[Action], within: str) -> Iterator[Problem]:
        """Check actions that are sent ``within`` an order or as instant actions."""
        for action in actions:
            known = self._known.get(action.action_id)
            if known is None:
                known = self._known[action.action_id] = action.action_type, within
            if known[0] != action.action_type:
                text = f"actionId '{action.action_id}' identifies '{known[0]}' and '{action.action_type}'"
                yield Rule.ACTION_ID, Severity.ERROR, text
            elif known[1] != within:
                text = f"actionId '{action.action_id}' was already used in {known[1]}"
                yield Rule.ACTION_ID, Severity.WARNING, text


class RobotConversation:
    """Follow the conversation of one robot with fleet control; it may begin in the middle of an order."""

    def __init__(self) -> None:
        self._headers = HeaderChecks()
        self._connection = ConnectionChecks()
        self._factsheet = FactsheetChecks()
        self._action_ids = ActionIds()
        self._orders = OrderConversation()
        self._instants = InstantConversation()
        self._requests: BoundedDict[str, None] = BoundedDict()
        self._state: State | None = None
        self._reported_unsupported = False
        self._units: set[str] = set()
        """Fields whose unit is in doubt, each reported once."""
        self._cleared: str | None = None
        """Order at the last state in a mode that clears orders; later states may still show parts of it."""

    def check(self, received: ReceivedMessage) -> Iterator[Problem]:
        """Check the next message and yield its problems."""
        if received.unsupported and not self._reported_unsupported:
            self._reported_unsupported = True
            yield Rule.VERSION, Severity.ERROR, received.unsupported
        yield from message_problems(received)
        if received.message is None:
            return
        for doubt in units_in_doubt(received.message):
            if doubt.field not in self._units:
                self._units.add(doubt.field)
                yield Rule.MESSAGE, Severity.WARNING, str(doubt)
        yield from self._headers.check(received, received.message)
        if received.retained and received.sender is Sender.FLEET:
            text = f"the broker keeps a message of {received.topic}, which robots get at each connect"
            yield Rule.RETAINED, Severity.WARNING, text
            return  # an old command, which robots ignore
        yield from self._check_content(received, received.message)

    def overdue(self, now: datetime, *, ended: bool = False) -> Iterator[tuple[ReceivedMessage, Problem]]:
        """Yield, once, messages without an answer and an overdue state at ``now``.

        ``ended``: the conversation ends here, so no answer will follow.
        """
        yield from self._orders.unanswered(now, ended=ended)
        yield from self._instants.unanswered(now, ended=ended)
        if overdue := self._connection.overdue_state(now):
            yield overdue

    def _check_content(self, received: ReceivedMessage, message: Header) -> Iterator[Problem]:
        match message:
            case Order():
                yield from self._check_order(received, message)
            case InstantActions():
                yield from self._factsheet.on_message(received, message)
                yield from self._action_ids.check(message.actions, "instantActions")
                yield from self._factsheet.check(message.actions, ActionScope.INSTANT)
                yield from self._connection.on_request(*(action.action_type for action in message.actions))
                newest = self._orders.newest
                yield from self._instants.on_instant_actions(received, message, self._state, newest)
            case Responses():
                yield from self._check_responses(message)
            case State():
                yield from self._on_state(received, message)
            case Connection():
                self._connection.on_connection(message)
                if message.connection_state is ConnectionState.HIBERNATING:
                    yield from self._instants.on_hibernation()
            case Factsheet():
                self._factsheet.on_factsheet(message)
                self._connection.on_factsheet(message)

    def _check_order(self, received: ReceivedMessage, order: Order) -> Iterator[Problem]:
        yield from self._action_ids.check(actions_of(order), f"order '{order.order_id}'")
        yield from self._factsheet.on_message(received, order)
        yield from self._factsheet.on_order(order)
        yield from self._connection.on_request(f"order '{order.order_id}'")
        cancelled = self._instants.ends(order.order_id)
        yield from self._orders.on_order(received, order, self._state, cancelled=cancelled)

    def _on_state(self, received: ReceivedMessage, state: State) -> Iterator[Problem]:
        yield from self._connection.on_state(received)
        yield from self._instants.on_state(state)
        # VDA 5050 3.0, 6.6.7: the mode clears the order; 2.x names only MANUAL, and is judged alike.
        if state.operating_mode.clears_order:
            self._cleared = state.order_id
        ends_early = state.order_id == self._cleared or self._instants.ends(state.order_id)
        yield from self._orders.on_state(state, self._state, ends_early=ends_early)
        if order := self._orders.current:
            yield from order_action_problems(state, order)
        yield from status_problems(self._state, state)
        for request_id in _request_ids(state):
            self._requests[request_id] = None
        self._state = state

    def _check_responses(self, message: Responses) -> Iterator[Problem]:
        for response in message.responses:
            # Before the first state, requests may be older than the conversation.
            if self._state and response.request_id not in self._requests:
                text = f"the robot did not send the request '{response.request_id}'"
                yield Rule.RESPONSE, Severity.WARNING, text


def _request_ids(state: State) -> Iterator[str]:
    yield from (request.request_id for request in state.zone_requests or ())
    yield from (request.request_id for request in state.edge_requests or ())


MAX_ROBOTS: Final = 10_000
"""Robots that are followed at a time; beyond, the oldest is dropped."""
OVERDUE_INTERVAL: Final = timedelta(seconds=1)
"""Conversation time between two checks for overdue messages."""


class Checker:
    """Check messages one by one; ``checked`` counts those of VDA 5050."""

    def __init__(self) -> None:
        self.checked = 0
        self.other_topic = ""
        """The first topic that is not one of VDA 5050."""
        self._number = 0
        self._now: datetime | None = None
        self._overdue_checked: datetime | None = None
        self._robots: BoundedDict[str, RobotConversation] = BoundedDict(MAX_ROBOTS)
        """By topic prefix: a robot that changes its major version starts a new conversation."""

    def add(self, entry: Entry) -> Iterator[Finding]:
        """Check the next message, and what is overdue by now."""
        self._number += 1
        received = parse(entry, self._number)
        if received is None:
            self.other_topic = self.other_topic or entry.topic
            return
        self.checked += 1
        yield from self._advance_time(received.time)
        if received.topic_prefix not in self._robots:
            self._robots[received.topic_prefix] = RobotConversation()
        for problem in self._robots[received.topic_prefix].check(received):
            yield from _findings_of(received, problem)

    def skip(self) -> None:
        """Count a message that is not checked, so that numbers match the recording."""
        self._number += 1

    def end(self) -> Iterator[Finding]:
        """Yield messages without an answer at the end of the conversation."""
        if self._now is not None:
            yield from self._overdue_findings(self._now, ended=True)

    def _advance_time(self, now: datetime) -> Iterator[Finding]:
        self._now = now
        if self._overdue_checked is None or now - self._overdue_checked >= OVERDUE_INTERVAL:
            self._overdue_checked = now
            yield from self._overdue_findings(now, ended=False)

    def _overdue_findings(self, now: datetime, *, ended: bool) -> Iterator[Finding]:
        for robot in self._robots.values():
            for late, problem in robot.overdue(now, ended=ended):
                yield from _findings_of(late, problem)


def _findings_of(received: ReceivedMessage, problem: Problem) -> Iterator[Finding]:
    """Yield a finding if the message's version has the rule."""
    rule, severity, text = problem
    section = rule.section(received.codec.version, received.topic)
    if section is not None:
        yield Finding(
            number=received.number,
            time=received.time,
            robot=received.robot,
            topic=received.topic,
            version=received.version if rule is Rule.VERSION else received.codec.version,
            rule=rule,
            section=section,
            severity=severity,
            text=text,
        )


def check(entries: Iterable[Entry]) -> Iterator[Finding]:
    """Check a whole conversation."""
    checker = Checker()
    for entry in entries:
        yield from checker.add(entry)
    yield from checker.end()
