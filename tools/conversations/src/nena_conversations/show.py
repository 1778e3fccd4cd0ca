"""A conversation in readable form: senders, messages, and changes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime
from math import hypot
from typing import Any

from rich.console import Console
from rich.text import Text

from nena_conversations.message import ReceivedMessage, Sender, parse
from nena_conversations.recording import Entry
from nena_shared.vda5050.action import Action, ActionState, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.request import EdgeRequest, ZoneRequest
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import MobileRobotPosition, State
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.zone_set import ZoneSetTransfer

MOVED = 0.05
"""Minimum reported movement, metres."""


def describe(message: Header, before: State | None) -> list[str]:
    """Describe a message in lines; ``before`` is the robot's previous state, if any."""
    if isinstance(message, State):
        return list(_describe_state(message, before)) or ["no change"]
    return list(_describe_message(message))


def _describe_message(message: Header) -> Iterator[str]:
    match message:
        case Order():
            yield from _describe_order(message)
        case InstantActions():
            yield from (f"do {_describe_action(action)}" for action in message.actions)
        case Connection():
            yield str(message.connection_state)
        case Factsheet():
            actions = message.protocol_features.mobile_robot_actions
            supported = _join_names(action.action_type for action in actions)
            yield f"{message.type_specification.series_name}: supports {supported}"
        case Responses():
            yield from (f"{response.request_id}: {response.grant_type}" for response in message.responses)
        case ZoneSetTransfer():
            zones = message.zone_set.zones
            yield f"zone set '{message.zone_set.zone_set_id}': {_join_names(zone.zone_id for zone in zones)}"


def _describe_order(order: Order) -> Iterator[str]:
    base = [node.node_id for node in order.nodes if node.released]
    horizon = [node.node_id for node in order.nodes if not node.released]
    yield f"order '{order.order_id}' update {order.order_update_id}"
    yield "base " + " → ".join(base) + (", horizon " + " → ".join(horizon) if horizon else "")
    for node in order.nodes:
        yield from (f"on {node.node_id}: {_describe_action(action)}" for action in node.actions)
    for edge in order.edges:
        yield from (f"along {edge.edge_id}: {_describe_action(action)}" for action in edge.actions)


def _describe_action(action: Action) -> str:
    parameters = ", ".join(f"{parameter.key}={parameter.value}" for parameter in action.action_parameters)
    return f"{action.action_type}({parameters}) as '{action.action_id}', {action.blocking_type}"


def _describe_state(now: State, before: State | None) -> Iterator[str]:
    yield from _order_of(now, before)
    for name, text in (
        ("operating_mode", "mode"),
        ("driving", "driving"),
        ("paused", "paused"),
        ("new_base_request", "requests more base"),
    ):
        yield from _changed_value(text, getattr(now, name), getattr(before, name) if before else None)
    yield from _place_changes(now, before)
    yield from _action_changes(now, before)
    yield from _error_changes(now.errors, before.errors if before else ())
    yield from _other_changes(now, before)


def _order_of(now: State, before: State | None) -> Iterator[str]:
    identity = now.order_id, now.order_update_id
    if before is None or identity != (before.order_id, before.order_update_id):
        yield f"order '{now.order_id}' update {now.order_update_id}" if now.order_id else "no order yet"
    last = now.last_node_id, now.last_node_sequence_id
    if before is None or last != (before.last_node_id, before.last_node_sequence_id):
        yield f"last node '{now.last_node_id}' ({now.last_node_sequence_id})"
    left = _remaining_nodes(now)
    if before is None or left != _remaining_nodes(before):
        yield f"nodes left: {left}"


def _remaining_nodes(state: State) -> str:
    base = [node.node_id for node in state.node_states if node.released]
    horizon = [node.node_id for node in state.node_states if not node.released]
    return _join_names(base) + (f", horizon {_join_names(horizon)}" if horizon else "")


def _place_changes(now: State, before: State | None) -> Iterator[str]:
    here, there = now.mobile_robot_position, before.mobile_robot_position if before else None
    if here is None:
        if there:
            yield "position unknown"
        return
    if there is None or _is_moved(here, there):
        yield f"at x {here.x:.2f}, y {here.y:.2f} on '{here.map_id}'"
    if there is None or here.localized is not there.localized:
        yield "localised" if here.localized else "not localised"


def _is_moved(here: MobileRobotPosition, there: MobileRobotPosition) -> bool:
    return hypot(here.x - there.x, here.y - there.y) >= MOVED or here.map_id != there.map_id


def _action_changes(now: State, before: State | None) -> Iterator[str]:
    old = {action.action_id: action.action_status for action in _all_actions(before)}
    for action in _all_actions(now):
        if old.get(action.action_id) is not action.action_status:
            result = f": {action.action_result}" if action.action_result else ""
            yield f"{action.action_type or 'action'} '{action.action_id}' {action.action_status}{result}"
    gone = set(old) - {each.action_id for each in _all_actions(now)}
    if gone:
        yield "no longer listed: " + _join_names(sorted(gone))


def _error_changes(now: Iterable[ErrorEntry], before: Iterable[ErrorEntry]) -> Iterator[str]:
    old, new = tuple(before), tuple(now)
    for each in new:
        if each not in old:
            yield f"{each.error_level} {each.error_type}: {each.error_description or ''}"
    for each in old:
        if each not in new:
            yield f"cleared: {each.error_type}"


def _other_changes(now: State, before: State | None) -> Iterator[str]:
    old = before.power_supply if before else None
    if old is None or round(now.power_supply.state_of_charge) != round(old.state_of_charge):
        yield f"battery {now.power_supply.state_of_charge:.0f} %"
    yield from _changed_value("charging", now.power_supply.charging, old.charging if old else None)
    yield from _changed_value("loads", _list_loads(now), _list_loads(before) if before else None)
    yield from _changed_value(
        "emergency stop", now.safety_state.active_emergency_stop.value, _emergency_stop(before)
    )
    yield from _changed_value(
        "field violation", now.safety_state.field_violation, before and before.safety_state.field_violation
    )
    yield from _changed_value(
        "maps", _list_held(now.maps, "map_id"), _list_held(before.maps, "map_id") if before else None
    )
    yield from _changed_value(
        "zone sets",
        _list_held(now.zone_sets, "zone_set_id"),
        _list_held(before.zone_sets, "zone_set_id") if before else None,
    )
    yield from _changed_value("requests", _list_requests(now), _list_requests(before) if before else None)


def _changed_value(name: str, now: Any, before: Any) -> Iterator[str]:  # noqa: ANN401 - any two values of one field
    """Yield a changed value; an empty one only if it was not empty before."""
    if now != before and (now or before):
        shown = {True: "yes", False: "no", None: "unknown", "": "none"}.get(now, now)
        yield f"{name}: {shown}"


def _all_actions(state: State | None) -> tuple[ActionState, ...]:
    return (*state.action_states, *state.instant_action_states) if state else ()


def _list_loads(state: State) -> str:
    return (
        _join_names(load.load_id or load.load_type or "a load" for load in state.loads or ())
        if state.loads
        else ""
    )


def _emergency_stop(state: State | None) -> str:
    return state.safety_state.active_emergency_stop.value if state else "NONE"


def _list_held(held: Iterable[Any] | None, name: str) -> str:
    def status(each: Any) -> str:  # noqa: ANN401 - a map or a zone set
        return str(getattr(each, "map_status", None) or getattr(each, "zone_set_status", ""))

    return ", ".join(f"{getattr(each, name)} {status(each)}" for each in held or ())


def _list_requests(state: State) -> str:
    requests: list[ZoneRequest | EdgeRequest] = [*(state.zone_requests or ()), *(state.edge_requests or ())]
    return ", ".join(f"{request.request_id} {request.request_status}" for request in requests)


def _join_names(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


QUIET = (Topic.VISUALIZATION,)
"""Topics that are shown only on request."""


def show(
    entries: Iterable[Entry], console: Console, *, robot: str | None = None, everything: bool = False
) -> int:
    """Print a conversation, of one robot (``manufacturer/serialNumber``) or of all; return the count."""
    shown = 0
    for received, lines in readable(entries):
        if robot not in (None, str(received.robot)) or (received.topic in QUIET and not everything):
            continue
        if lines == ["no change"] and not everything:
            continue
        shown += 1
        console.print(
            _heading_of(received), *(f"    {line}" for line in lines), sep="\n", markup=False, highlight=False
        )
    return shown


def readable(entries: Iterable[Entry]) -> Iterator[tuple[ReceivedMessage, list[str]]]:
    """Yield each message of VDA 5050 with its description; states by their changes."""
    states: dict[RobotKey, State] = {}
    unsupported: set[tuple[RobotKey, str]] = set()
    for number, entry in enumerate(entries, start=1):
        received = parse(entry, number)
        if received is None:
            continue
        lines = [f"malformed: {problem}" for problem in received.problems]
        if received.message is not None:
            before = states.get(received.robot)
            lines += describe(received.message, before)
            if isinstance(received.message, State):
                states[received.robot] = _with_shown_position(received.message, before)
        if received.unsupported and (received.robot, received.unsupported) not in unsupported:
            unsupported.add((received.robot, received.unsupported))
            lines.insert(0, received.unsupported)
        if lines:
            yield received, lines


def _with_shown_position(now: State, before: State | None) -> State:
    """Return a state with the position that was shown last: small moves add up."""
    here, there = now.mobile_robot_position, before.mobile_robot_position if before else None
    if here and there and not _is_moved(here, there):
        here = here.model_copy(update={"x": there.x, "y": there.y})
    return now.model_copy(update={"mobile_robot_position": here})


def _heading_of(received: ReceivedMessage) -> Text:
    to_robot = received.sender is Sender.FLEET
    direction = f"fleet → {received.robot}" if to_robot else f"{received.robot} → fleet"
    colour = "cyan" if to_robot else "green"
    if received.message is None:
        colour = "red"
    retained = " (retained)" if received.retained else ""
    return Text.assemble(
        (f"{received.number:>6} {_clock_time(received.time)} ", "dim"),
        (f"{direction} {received.topic}", colour),
        (f" {received.version}{retained}", "dim"),
    )


def _clock_time(time: datetime) -> str:
    return f"{time:%H:%M:%S}.{time.microsecond // 1000:03d}"
