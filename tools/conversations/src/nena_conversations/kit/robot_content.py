"""What is right in states and factsheets, and the orders that robots refuse: tables of clauses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from itertools import chain
from typing import Any, Final, TypeVar

from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, Support
from nena_shared.vda5050.state import MapStatus, RobotZoneSetStatus, State

M_contra = TypeVar("M_contra", contravariant=True)
Wrong = Callable[[M_contra], str]
"""Returns what is wrong in a message, or nothing."""
Edit = Callable[[dict[str, Any]], object]
"""Makes an order of two nodes wrong."""
Sections = tuple[str | None, str]

FAR: Final = 10_000.0
"""Distance to a place that is no part of any plan, m."""
STILL: Final = 0.05
"""Velocity of a robot that stands, m/s or rad/s."""
LONGEST_INTERVAL: Final = 30.0


def _repeated(names: Iterable[str], what: str) -> str:
    found = [name for name, count in Counter(names).items() if count > 1]
    return f"{what} {', '.join(map(repr, found))} is listed twice" if found else ""


def _map_is_enabled(state: State) -> str:
    place, maps = state.mobile_robot_position, state.maps
    if not place or not maps:
        return ""
    enabled = [each.map_id for each in maps if each.map_status is MapStatus.ENABLED]
    return "" if place.map_id in enabled else f"the robot's map {place.map_id!r} is not ENABLED in maps"


def _one_map_version(state: State) -> str:
    maps = [each.map_id for each in state.maps or () if each.map_status is MapStatus.ENABLED]
    return _repeated(maps, "the ENABLED map")


def _one_zone_set(state: State) -> str:
    sets = state.zone_sets or ()
    enabled = [each.map_id for each in sets if each.zone_set_status is RobotZoneSetStatus.ENABLED]
    return _repeated(enabled, "a zone set for the map")


def _idle_content(state: State) -> str:
    if state.order_id or not (state.node_states or state.edge_states):
        return ""
    return "there are nodes or edges, and no orderId"


def _standing(state: State) -> str:
    speed = state.velocity
    if state.driving or speed is None:
        return ""
    fast = [each for each in (speed.vx, speed.vy, speed.omega) if each and abs(each) > STILL]
    return f"driving is false, and the velocity {fast[0]:g}" if fast else ""


def _action_ids(state: State) -> str:
    return _repeated((each.action_id for each in state.action_states), "the actionId")


def _instants_apart(state: State) -> str:
    return _repeated(
        (each.action_id for each in (*state.action_states, *state.instant_action_states)), "the actionId"
    )


def _node_numbers(state: State) -> str:
    odd = [str(each.sequence_id) for each in state.node_states if each.sequence_id % 2]
    return f"nodes have the odd sequenceIds {', '.join(odd)}" if odd else ""


def _last_node(state: State) -> str:
    number = state.last_node_sequence_id
    return (
        f"lastNodeId is empty, and lastNodeSequenceId {number}" if number and not state.last_node_id else ""
    )


def _base_request(state: State) -> str:
    horizon = any(not node.released for node in state.node_states)
    return "newBaseRequest is true without a horizon" if state.new_base_request and not horizon else ""


def _error_types(state: State) -> str:
    return "" if all(each.error_type for each in state.errors) else "an error has no type"


STATES: Final[tuple[tuple[str, str, Sections, Wrong[State]], ...]] = (
    ("map", "The robot's map is one of its ENABLED maps", ("6.10.6", "7.8"), _map_is_enabled),
    ("maps", "One version of each map is ENABLED", ("6.10.6", "6.3"), _one_map_version),
    ("zoneSets", "One zone set of each map is ENABLED", (None, "6.4"), _one_zone_set),
    ("idle", "Without an order there are no nodes and edges", ("6.10.6", "7.8"), _idle_content),
    ("standing", "A robot that does not drive has no velocity", ("6.10.6", "7.8"), _standing),
    ("actionIds", "Each action has one state", ("6.11", "6.6.9"), _action_ids),
    ("instantActions", "Instant actions have states of their own", (None, "6.6.9"), _instants_apart),
    ("sequenceIds", "Nodes of the state have even sequenceIds", ("6.10.6", "7.8"), _node_numbers),
    ("lastNode", "Without a last node, its sequenceId is 0", ("6.10.6", "7.8"), _last_node),
    ("newBaseRequest", "A new base is requested only with a horizon", ("6.10.6", "7.8"), _base_request),
    ("errorTypes", "Each error has a type", ("6.10.5", "6.6.5"), _error_types),
)


def _speeds(sheet: Factsheet) -> str:
    body = sheet.physical_parameters
    if not body.maximum_speed:
        return "the maximum speed is 0"
    too_low = body.minimum_speed > body.maximum_speed
    return "the minimum speed is above the maximum speed" if too_low else ""


def _turns(sheet: Factsheet) -> str:
    body = sheet.physical_parameters
    low, high = body.minimum_angular_speed, body.maximum_angular_speed
    too_low = low is not None and high is not None and low > high
    return "the minimum angular speed is above the maximum one" if too_low else ""


def _sizes(sheet: Factsheet) -> str:
    body = sheet.physical_parameters
    return "" if body.length and body.width else f"the robot is {body.length:g} m by {body.width:g} m"


def _heights(sheet: Factsheet) -> str:
    body = sheet.physical_parameters
    too_low = body.minimum_height > body.maximum_height
    return "the minimum height is above the maximum height" if too_low else ""


def _accelerations(sheet: Factsheet) -> str:
    body = sheet.physical_parameters
    stuck = not body.maximum_acceleration or not body.maximum_deceleration
    return "an acceleration or deceleration is 0" if stuck else ""


def _kind(sheet: Factsheet) -> str:
    kind = sheet.type_specification
    texts = (kind.series_name, kind.mobile_robot_kinematics, kind.mobile_robot_class)
    return "" if all(texts) else "series, kinematics or class is empty"


def _localization(sheet: Factsheet) -> str:
    return "" if sheet.type_specification.localization_types else "localizationTypes is empty"


def _navigation(sheet: Factsheet) -> str:
    return "" if sheet.type_specification.navigation_types else "navigationTypes is empty"


def _intervals(sheet: Factsheet) -> str:
    times = sheet.protocol_limits.timing
    longest = max(times.minimum_state_interval, times.default_state_interval or 0.0)
    return f"an interval of states is {longest:g} s" if longest > LONGEST_INTERVAL else ""


def _state_intervals(sheet: Factsheet) -> str:
    times = sheet.protocol_limits.timing
    usual = times.default_state_interval
    wrong = usual is not None and usual < times.minimum_state_interval
    return f"defaultStateInterval {usual} is below minimumStateInterval" if wrong else ""


def _room_for_orders(sheet: Factsheet) -> str:
    lists = sheet.protocol_limits.maximum_array_lengths
    nodes, edges = lists.order_nodes or FAR, lists.order_edges or FAR
    return "" if nodes > 1 and edges >= 1 else f"orders have at most {nodes:g} nodes and {edges:g} edges"


def _room_for_states(sheet: Factsheet) -> str:
    lists = sheet.protocol_limits.maximum_array_lengths
    nodes, states = lists.order_nodes, lists.state_node_states
    small = bool(nodes and states and states < nodes - 1)
    return f"orders may have {nodes} nodes, states only {states}" if small else ""


def _one_description(sheet: Factsheet) -> str:
    actions = sheet.protocol_features.mobile_robot_actions
    return _repeated((f"{each.action_type} {scope}" for each in actions for scope in each.action_scopes), "")


def _scopes(sheet: Factsheet) -> str:
    bare = [
        each.action_type for each in sheet.protocol_features.mobile_robot_actions if not each.action_scopes
    ]
    return f"{', '.join(bare)} has no scope" if bare else ""


def _parameters(sheet: Factsheet) -> str:
    lists = (each.action_parameters or () for each in sheet.protocol_features.mobile_robot_actions)
    found = (_repeated((each.key for each in keys), "the parameter") for keys in lists)
    return next(filter(None, found), "") or _unnamed(sheet)


def _unnamed(sheet: Factsheet) -> str:
    lists = (each.action_parameters or () for each in sheet.protocol_features.mobile_robot_actions)
    return "" if all(each.key for each in chain.from_iterable(lists)) else "a parameter has no key"


def _instant_blocking(sheet: Factsheet) -> str:
    actions = sheet.protocol_features.mobile_robot_actions
    instant = [each for each in actions if each.action_scopes == (ActionScope.INSTANT,)]
    wrong = [
        each.action_type
        for each in instant
        if each.blocking_types and BlockingType.NONE not in each.blocking_types
    ]
    return f"{', '.join(wrong)} cannot be sent: instant actions have NONE" if wrong else ""


def _fields(sheet: Factsheet) -> str:
    return _repeated((each.parameter for each in sheet.protocol_features.optional_parameters), "the field")


def _required_fields(sheet: Factsheet) -> str:
    fields = sheet.protocol_features.optional_parameters
    names = [
        each.parameter for each in fields if each.support is Support.REQUIRED and "." not in each.parameter
    ]
    return f"{', '.join(names)} is required, and no path to a field" if names else ""


def _loads(sheet: Factsheet) -> str:
    load = sheet.load_specification
    unknown = set(chain.from_iterable(each.load_positions or () for each in load.load_sets or ()))
    unknown -= set(load.load_positions or ())
    return f"load sets name unknown positions {', '.join(sorted(unknown))}" if unknown else ""


SHEET: Final[Sections] = ("6.15", "7.10")
FACTSHEETS: Final[tuple[tuple[str, str, Sections, Wrong[Factsheet]], ...]] = (
    ("speeds", "Speeds are those of a robot", SHEET, _speeds),
    ("turns", "Angular speeds are in order", SHEET, _turns),
    ("sizes", "The robot has a length and a width", SHEET, _sizes),
    ("heights", "Heights are in order", SHEET, _heights),
    ("accelerations", "The robot can accelerate and brake", SHEET, _accelerations),
    ("kind", "Series, kinematics and class are named", SHEET, _kind),
    ("localization", "A type of localization is named", SHEET, _localization),
    ("navigation", "A type of navigation is named", SHEET, _navigation),
    ("intervals", "States come at least every 30 s", SHEET, _intervals),
    ("stateIntervals", "Intervals of states are in order", SHEET, _state_intervals),
    ("orderLength", "Orders may have two nodes", SHEET, _room_for_orders),
    ("stateLength", "States have room for the longest order", SHEET, _room_for_states),
    ("uniqueActions", "Each action is described once", SHEET, _one_description),
    ("scopes", "Each action has a scope", SHEET, _scopes),
    ("parameters", "Parameters of actions have keys, each once", SHEET, _parameters),
    ("blocking", "Instant actions may have the blockingType NONE", (None, "6.2.2"), _instant_blocking),
    ("fields", "Each optional field is listed once", SHEET, _fields),
    ("requiredFields", "Required fields have paths", SHEET, _required_fields),
    ("loads", "Load sets name load positions of the robot", SHEET, _loads),
)


def _acts(place: str, *actions: dict[str, object]) -> Edit:
    """Return an edit that gives the first node or edge actions."""
    return lambda order: order[place][0].update(actions=list(actions))


def _dance(action_id: str = "a", **fields: object) -> dict[str, object]:
    return {"actionType": "danceAtNode", "actionId": action_id, "blockingType": "HARD", **fields}


GRAPH: Final[Sections] = ("6.6.1", "6.1.1")
FORM: Final[Sections] = ("6.6.4.1", "6.1.4.1")
NO_MAP: Final = "no-such-map-7f3a"
REFUSED: Final[tuple[tuple[str, str, Sections, Edit], ...]] = (
    ("noNodes", "An order without nodes", GRAPH, lambda order: order.update(nodes=[], edges=[])),
    ("missingEdge", "Two nodes without an edge", GRAPH, lambda order: order.update(edges=[])),
    ("missingNode", "An edge without an end", GRAPH, lambda order: order["nodes"].pop()),
    (
        "sequence",
        "Sequence IDs that do not alternate",
        GRAPH,
        lambda order: order["nodes"][1].update(sequenceId=1),
    ),
    ("gap", "Sequence IDs with a gap", GRAPH, lambda order: order["nodes"][1].update(sequenceId=4)),
    (
        "edgeSequence",
        "An even sequence ID of an edge",
        GRAPH,
        lambda order: order["edges"][0].update(sequenceId=2),
    ),
    (
        "unreleased",
        "A first node that is not released",
        GRAPH,
        lambda order: order["nodes"][0].update(released=False),
    ),
    ("hole", "A base behind a horizon", GRAPH, lambda order: order["edges"][0].update(released=False)),
    ("sameActions", "Two actions with one actionId", GRAPH, _acts("nodes", _dance(), _dance())),
    ("noNodeId", "A node without a nodeId", FORM, lambda order: order["nodes"][0].pop("nodeId")),
    ("noSequence", "A node without a sequenceId", FORM, lambda order: order["nodes"][1].pop("sequenceId")),
    (
        "text",
        "A sequenceId that is no number",
        FORM,
        lambda order: order["nodes"][1].update(sequenceId="two"),
    ),
    ("negative", "A negative sequenceId", FORM, lambda order: order["nodes"][0].update(sequenceId=-2)),
    ("noEdges", "An order without a list of edges", FORM, lambda order: order.pop("edges")),
    ("noUpdateId", "An order without an orderUpdateId", FORM, lambda order: order.pop("orderUpdateId")),
    ("noPlace", "A position without x", FORM, lambda order: order["nodes"][1]["nodePosition"].pop("x")),
    ("blockingType", "An unknown blockingType", FORM, _acts("nodes", _dance(blockingType="MAYBE"))),
    (
        "startFar",
        "A first node that is out of reach",
        ("6.6.4.1", "6.1.4.7"),
        lambda order: order["nodes"][0]["nodePosition"].update(x=FAR, y=FAR),
    ),
    (
        "unknownMap",
        "A map that the robot does not have",
        ("6.6.4.1", "6.1.4.10"),
        lambda order: [node["nodePosition"].update(mapId=NO_MAP) for node in order["nodes"]],
    ),
    (
        "unknownAction",
        "An action that the robot does not have",
        ("6.6.4.2", "6.1.4.3"),
        _acts("nodes", _dance()),
    ),
    ("edgeAction", "Such an action on an edge", ("6.6.4.2", "6.1.4.3"), _acts("edges", _dance())),
    (
        "firstUpdateId",
        "A new order with another orderUpdateId than 0",
        (None, "6.1.1"),
        lambda order: order.update(orderUpdateId=3),
    ),
)
