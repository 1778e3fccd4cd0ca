"""Fit messages to a robot's factsheet, and explain why they cannot be sent (VDA 5050 3.0, section 7.10)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import chain, pairwise
from math import atan2, hypot, pi
from types import MappingProxyType
from typing import Any, Final, TypeVar

from pydantic import BaseModel, JsonValue, ValidationError
from pydantic_core import from_json

from nena_order_service.fleet.position import GOAL_PREFIX
from nena_order_service.fleet.robot import DEVIATION_THETA_FIELD, DEVIATION_XY_FIELD, THETA_FIELD, Abilities
from nena_order_service.fleet.vda_order import STATION_PARAMETERS, VdaOrder
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.vda5050.action import (
    LOAD_HANDLING_DEVICE,
    STATION_ACTIONS,
    Action,
    ActionParameter,
    InstantActions,
    text_of,
)
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.factsheet import (
    ActionParameterDescription,
    ActionScope,
    MobileRobotAction,
    ValueDataType,
)
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import Edge, Node, NodePosition, Order

R = ReasonCode

ACTION_DESCRIPTOR: Final = "nodes.actions.actionDescriptor"

P = TypeVar("P", bound=BaseModel)

_Ends = tuple[NodePosition | None, NodePosition | None]
"""The positions of an edge's nodes."""


def fitted_order(vda_order: VdaOrder, abilities: Abilities | None) -> VdaOrder:
    """Remove optional fields that the robot does not support, and fill required ones (section 7.1.1).

    Fields that matter for the order are kept, and :func:`order_problem` reports them: positions, and the
    heading at a coordinate.
    """
    if abilities is None:
        # 6.1.4: a robot may refuse an order with fields that it does not support. Those that only refine the
        # drive are not worth that.
        nothing = {"maximum_speed": None, **dict.fromkeys(_RULED.values())}
        edges = tuple(_with_changes(edge, _with_planned_turns(edge, nothing)) for edge in vda_order.edges)
        return VdaOrder(order_id=vda_order.order_id, nodes=vda_order.nodes, edges=edges)
    rules, nodes = _EdgeRules.from_abilities(abilities), list[Node]()
    previous: Node | None = None
    heading = 0.0
    for node in vda_order.nodes:
        # The heading, rad, of a robot that drives straight and forwards. It does not depend on later nodes,
        # so that an update repeats the node unchanged (6.1.2).
        start, end = previous and previous.node_position, node.node_position
        if start and end and (start.x, start.y) != (end.x, end.y):
            heading = atan2(end.y - start.y, end.x - start.x)
        changes: dict[str, Any] = {}
        if node.actions:
            changes["actions"] = tuple(_fitted_in_order(action, abilities) for action in node.actions)
        if node.node_position is not None and not abilities.takes_positions:
            changes["node_position"] = _fitted_position(node, node.node_position, heading, abilities)
        if "nodes.nodeDescriptor" in abilities.required_fields:
            changes["node_descriptor"] = node.node_id
        nodes.append(_with_changes(node, changes))
        previous = node
    edges = tuple(
        _fitted_edge(edge, (start.node_position, end.node_position), abilities, rules)
        for edge, (start, end) in zip(vda_order.edges, pairwise(vda_order.nodes), strict=True)
    )
    return VdaOrder(order_id=vda_order.order_id, nodes=tuple(nodes), edges=edges)


def fitted_action(action: Action, abilities: Abilities) -> Action:
    """Return the action with its parameters converted to the declared types, if that is unambiguous."""
    # Station and load type are fleet control's own additions: a robot that lists others might refuse them.
    wanted = abilities.declared_parameters(action)
    parameters = tuple(
        _convert_parameter(parameter, wanted.get(parameter.key))
        for parameter in _with_listed_device(action, wanted, abilities)
        if not wanted or parameter.key in wanted or parameter.key not in STATION_PARAMETERS
    )
    return _with_changes(action, {"action_parameters": parameters})


def _with_listed_device(
    action: Action, wanted: Mapping[str, ActionParameterDescription], abilities: Abilities
) -> Iterator[ActionParameter]:
    """Yield an action's parameters, with the load handling device under the name that the robot lists."""
    # 3.0.1 renamed ``lhd`` of pick and drop. A robot that lists neither name is sent that of its version.
    listed = next((key for key in LOAD_HANDLING_DEVICE if key in wanted), None)
    if listed is None and abilities.codec:
        listed = abilities.codec.rules.load_handling_device_key
    for parameter in action.action_parameters:
        renamed = action.action_type in STATION_ACTIONS and parameter.key in LOAD_HANDLING_DEVICE
        yield parameter.model_copy(update={"key": listed}) if renamed and listed else parameter


def _with_changes(part: P, changes: Mapping[str, object]) -> P:
    """Return a part of an order with changes; usually nothing changes, and it is the same object."""
    # Orders have hundreds of nodes and edges, and pydantic's copies cost more than these comparisons.
    fields = vars(part)
    new = {
        name: value for name, value in changes.items() if fields[name] is not value and fields[name] != value
    }
    return part.model_copy(update=new) if new else part


def _fitted_in_order(action: Action, abilities: Abilities) -> Action:
    action = fitted_action(action, abilities)
    if action.retriable and not abilities.takes_retries:
        action = action.model_copy(update={"retriable": None})
    if ACTION_DESCRIPTOR in abilities.required_fields:
        return action.model_copy(update={"action_descriptor": action.action_descriptor or action.action_type})
    if not abilities.takes_field(ACTION_DESCRIPTOR):
        return action.model_copy(update={"action_descriptor": None})
    return action


def _fitted_position(
    node: Node, position: NodePosition, heading: float, abilities: Abilities
) -> NodePosition:
    """Remove or fill fields of a position."""
    demanded = abilities.required_fields
    changes: dict[str, Any] = {}
    if not abilities.takes_field(DEVIATION_XY_FIELD):
        changes["allowed_deviation_xy"] = None
    if not abilities.takes_field(THETA_FIELD) and not node.node_id.startswith(GOAL_PREFIX):
        changes["theta"] = None
    is_free = changes.get("theta", position.theta) is None
    if is_free and THETA_FIELD in demanded and abilities.takes_field(DEVIATION_THETA_FIELD):
        # With a deviation of pi any heading will do: the field is there, and demands nothing.
        changes |= {"theta": heading, "allowed_deviation_theta": pi}
    elif is_free and DEVIATION_THETA_FIELD in demanded:
        changes["allowed_deviation_theta"] = pi
    if not abilities.takes_field(DEVIATION_THETA_FIELD):
        changes["allowed_deviation_theta"] = None
    return _with_changes(position, changes)


def _fitted_edge(edge: Edge, ends: _Ends, abilities: Abilities, rules: _EdgeRules) -> Edge:
    changes = _with_planned_turns(edge, dict.fromkeys(rules.unlisted))
    if edge.actions:
        changes["actions"] = tuple(_fitted_in_order(action, abilities) for action in edge.actions)
    if edge.maximum_speed is not None and not _limits_speed(edge.maximum_speed, abilities):
        changes["maximum_speed"] = None
    changes |= {
        field: fill(edge, ends, abilities)
        for field, fill in rules.required
        if field not in _RULED.values() or getattr(edge, field) is None
    }
    return _with_changes(edge, changes)


def _with_planned_turns(edge: Edge, changes: dict[str, object]) -> dict[str, object]:
    """Return changes that leave the orientation and rotation that properties of the path set."""
    if not edge.turns_as_planned:
        return changes
    return {**{name: each for name, each in changes.items() if name not in _TURNS}, "turns_as_planned": None}


_TURNS: Final = ("orientation", "reach_orientation_before_entering")
_RULED: Final[Mapping[str, str]] = MappingProxyType(
    {
        "edges.orientation": "orientation",
        "edges.orientationType": "orientation_type",
        "edges.reachOrientationBeforeEntering": "reach_orientation_before_entering",
        "edges.maximumRotationSpeed": "maximum_rotation_speed",
        "edges.maximumMobileRobotHeight": "maximum_mobile_robot_height",
        "edges.minimumLoadHandlingDeviceHeight": "minimum_load_handling_device_height",
        "edges.direction": "direction",
        "edges.length": "length",
        "edges.corridor": "corridor",
        "edges.trajectory": "trajectory",
    }
)
"""Edge fields that layouts define; sent only to robots that list them, because others may refuse them."""


def _distance_between(_: Edge, ends: _Ends, __: Abilities) -> float | None:
    start, end = ends
    return hypot(end.x - start.x, end.y - start.y) if start and end else None


def _limits_speed(speed: float, abilities: Abilities) -> bool:
    """Return whether a limit is below the robot's maximum speed, and its factsheet lists the field."""
    own = abilities.factsheet.physical_parameters.maximum_speed
    return abilities.lists_field("edges.maximumSpeed") and (not own or speed < own)


_Fill = Callable[[Edge, _Ends, Abilities], object]
_EDGE_FIELDS: Final[Mapping[str, tuple[str, _Fill]]] = MappingProxyType(
    {
        "edges.edgeDescriptor": ("edge_descriptor", lambda edge, *_: edge.edge_id),
        "edges.length": ("length", _distance_between),
        "edges.maximumSpeed": (
            "maximum_speed",
            lambda edge, _, abilities: (
                edge.maximum_speed
                if edge.maximum_speed is not None and _limits_speed(edge.maximum_speed, abilities)
                else abilities.factsheet.physical_parameters.maximum_speed or None
            ),
        ),
        "edges.maximumRotationSpeed": (
            "maximum_rotation_speed",
            lambda _, __, abilities: abilities.factsheet.physical_parameters.maximum_angular_speed or None,
        ),
        "edges.reachOrientationBeforeEntering": (
            "reach_orientation_before_entering",
            lambda *_: False,
        ),
    }
)
"""Neutral values for edge fields that the robot requires; they do not change the order."""


@dataclass(frozen=True, slots=True)
class _EdgeRules:
    """The fields of edges that a robot must not be sent, and those that it requires."""

    unlisted: tuple[str, ...] = ()
    required: tuple[tuple[str, _Fill], ...] = ()

    @classmethod
    def from_abilities(cls, abilities: Abilities) -> _EdgeRules:
        """Read the rules from a robot's factsheet."""
        demanded = abilities.required_fields
        return cls(
            tuple(field for path, field in _RULED.items() if not abilities.lists_field(path)),
            tuple(filling for path, filling in _EDGE_FIELDS.items() if path in demanded),
        )


def _convert_parameter(
    parameter: ActionParameter, wanted: ActionParameterDescription | None
) -> ActionParameter:
    """Convert text to the declared type, or a number to text; keep values that cannot be converted."""
    if wanted is None:
        return parameter
    if wanted.value_data_type is ValueDataType.STRING and isinstance(parameter.value, int | float):
        return ActionParameter(key=parameter.key, value=text_of(parameter.value))
    if not isinstance(parameter.value, str):
        return parameter
    with suppress(ValueError, KeyError):
        return ActionParameter(key=parameter.key, value=_PARSERS[wanted.value_data_type](parameter.value))
    return parameter


def _parse_json(text: str) -> JsonValue:
    value: JsonValue = from_json(text)  # rejects values nested deeper than messages may be
    return value if isinstance(value, dict | list) else text


_PARSERS: Final[Mapping[ValueDataType, Callable[[str], JsonValue]]] = MappingProxyType(
    {
        ValueDataType.BOOL: lambda text: {"true": True, "false": False}[text.strip().lower()],
        ValueDataType.NUMBER: float,
        ValueDataType.INTEGER: int,
        ValueDataType.STRING: str,
        ValueDataType.OBJECT: _parse_json,
        ValueDataType.ARRAY: _parse_json,
    }
)


ALWAYS_THERE: Final = frozenset({"cancelOrder", "stateRequest", "factsheetRequest"})
"""Instant actions that every robot must support, whether or not its factsheet lists them."""

_TYPE_CHECKS: Final[Mapping[ValueDataType, Callable[[JsonValue], bool]]] = MappingProxyType(
    {
        ValueDataType.BOOL: lambda value: isinstance(value, bool),
        ValueDataType.NUMBER: lambda value: isinstance(value, int | float) and not isinstance(value, bool),
        ValueDataType.INTEGER: lambda value: isinstance(value, int) and not isinstance(value, bool),
        ValueDataType.STRING: lambda value: isinstance(value, str),
        ValueDataType.OBJECT: lambda value: isinstance(value, dict),
        ValueDataType.ARRAY: lambda value: isinstance(value, list | tuple),
    }
)

_LONGEST_HEADER: Final[Mapping[str, Any]] = MappingProxyType(
    {"header_id": 2**32 - 1, "timestamp": datetime(2026, 1, 1, tzinfo=UTC), "version": "0.0.0"}
)


def order_problem(vda_order: VdaOrder, abilities: Abilities) -> Reason | None:
    """Return why the robot cannot execute a fitted VDA order (section 7.10); None if it can."""
    return next(_order_problems(vda_order, abilities), None)


def instant_action_problem(action: Action, abilities: Abilities) -> Reason | None:
    """Return why the robot cannot execute a fitted instant action (section 7.10); None if it can."""
    if action.action_type in ALWAYS_THERE:
        return None
    message = InstantActions(**_header_fields(abilities), actions=(action,))
    problems = chain(
        _action_problems(action, ActionScope.INSTANT, abilities),
        _bad_ids((action.action_id,), abilities),
        _wire_problems(message, abilities),
    )
    return next(problems, None)


def _order_problems(vda_order: VdaOrder, abilities: Abilities) -> Iterator[Reason]:
    yield from _long_lists(vda_order, abilities)
    for node in vda_order.nodes:
        for action in node.actions:
            yield from _action_problems(action, ActionScope.NODE, abilities)
    for edge in vda_order.edges:
        for action in edge.actions:
            yield from _action_problems(action, ActionScope.EDGE, abilities)
    required = abilities.required_fields
    document = vda_order.model_dump(mode="json", by_alias=True, exclude_none=True) if required else {}
    for path in required:
        if not _is_filled(document, path.split(".")):
            yield Reason(R.MISSING_FIELD, field=path)
    # Only a host's coordinate needs its heading: at a point the robot may stop as it arrives.
    positions = (node.node_position for node in vda_order.nodes if node.node_id.startswith(GOAL_PREFIX))
    is_headed = any(position and position.theta is not None for position in positions)
    if is_headed and not abilities.takes_field(THETA_FIELD):
        yield Reason(R.NO_HEADINGS)
    names = chain(
        (vda_order.order_id,),
        (node.node_id for node in vda_order.nodes),
        (node.node_position.map_id for node in vda_order.nodes if node.node_position),
        (edge.edge_id for edge in vda_order.edges),
        vda_order.action_ids,
    )
    yield from _bad_ids(names, abilities)
    order = Order(
        **_header_fields(abilities),
        order_id=vda_order.order_id,
        order_update_id=0,
        nodes=vda_order.nodes,
        edges=vda_order.edges,
    )
    yield from _wire_problems(order, abilities)


def _long_lists(vda_order: VdaOrder, abilities: Abilities) -> Iterator[Reason]:
    """Yield lists that are too long in the order, or would be in the robot's states."""
    limits = abilities.factsheet.protocol_limits.maximum_array_lengths
    if not any(vars(limits).values()):
        return
    yield from _too_many(len(vda_order.nodes), limits.order_nodes, R.NODES)
    yield from _too_many(len(vda_order.edges), limits.order_edges, R.EDGES)
    for node in vda_order.nodes:
        yield from _too_many(len(node.actions), limits.node_actions, R.NODE_ACTIONS, node=node.node_id)
    for edge in vda_order.edges:
        yield from _too_many(len(edge.actions), limits.edge_actions, R.EDGE_ACTIONS, edge=edge.edge_id)
    # 6.6.2: the first node is reached at once, so states list one fewer.
    yield from _too_many(len(vda_order.nodes) - 1, limits.state_node_states, R.NODE_STATES)
    yield from _too_many(len(vda_order.edges), limits.state_edge_states, R.EDGE_STATES)
    yield from _too_many(len(vda_order.actions), limits.state_action_states, R.ACTION_STATES)


def _action_problems(action: Action, scope: ActionScope, abilities: Abilities) -> Iterator[Reason]:
    limits, name = abilities.factsheet.protocol_limits, action.action_type
    most = limits.maximum_array_lengths.action_parameters
    yield from _too_many(len(action.action_parameters), most, R.ACTION_PARAMETERS, action=name)
    load_id, longest = action.parameter("loadId"), limits.maximum_string_lengths.maximum_load_id_length
    if longest and isinstance(load_id, str) and len(load_id) > longest:
        yield Reason(R.LONG_LOAD_ID, load=load_id, limit=longest)
    if not abilities.lists_actions:
        return
    declared = abilities.declared_actions(action.action_type)
    if not declared:
        yield Reason(R.UNLISTED_ACTION, action=name)
        return
    # Some robots declare an action once per scope: one declaration that fits is enough.
    problems = [next(_declaration_problems(action, scope, declaration), None) for declaration in declared]
    if all(problems):
        yield from filter(None, problems[:1])


def _declaration_problems(
    action: Action, scope: ActionScope, declared: MobileRobotAction
) -> Iterator[Reason]:
    name = action.action_type
    if declared.action_scopes and scope not in declared.action_scopes:
        scopes = ", ".join(declared.action_scopes)
        yield Reason(R.OTHER_SCOPES, action=name, scopes=scopes, scope=scope)
    blocking = declared.blocking_types
    if scope is not ActionScope.INSTANT and blocking and action.blocking_type not in blocking:
        yield Reason(R.OTHER_BLOCKING, action=name, types=", ".join(blocking))
    wanted = {parameter.key: parameter for parameter in declared.action_parameters or ()}
    keys = {parameter.key for parameter in action.action_parameters}
    for parameter in wanted.values():
        if parameter.is_optional is False and parameter.key not in keys:
            yield Reason(R.MISSING_PARAMETER, action=name, parameter=parameter.key)
    if wanted:
        yield from _value_problems(action, wanted)


def _value_problems(action: Action, wanted: Mapping[str, ActionParameterDescription]) -> Iterator[Reason]:
    for parameter in action.action_parameters:
        declared = wanted.get(parameter.key)
        if declared is None:
            names = ", ".join(wanted)
            yield Reason(R.UNKNOWN_PARAMETER, action=action.action_type, parameter=parameter.key, known=names)
        elif not _TYPE_CHECKS[declared.value_data_type](parameter.value):
            yield Reason(
                R.OTHER_TYPE,
                parameter=parameter.key,
                action=action.action_type,
                type=declared.value_data_type,
                given=repr(parameter.value),
            )


def _is_filled(part: JsonValue, path: list[str]) -> bool:
    """Return whether ``path`` exists in each item of the lists along it."""
    if isinstance(part, list):
        return all(_is_filled(item, path) for item in part)
    if not path:
        return True
    return isinstance(part, dict) and path[0] in part and _is_filled(part[path[0]], path[1:])


def _bad_ids(ids: Iterable[str], abilities: Abilities) -> Iterator[Reason]:
    limits = abilities.factsheet.protocol_limits.maximum_string_lengths
    for name in ids if limits.maximum_id_length or limits.id_numerical_only else ():
        if limits.maximum_id_length and len(name) > limits.maximum_id_length:
            yield Reason(R.LONG_ID, id=name, limit=limits.maximum_id_length)
        if limits.id_numerical_only and not name.isdecimal():
            yield Reason(R.NOT_NUMERIC, id=name)


def _too_many(count: int, limit: int | None, what: ReasonCode, **values: str) -> Iterator[Reason]:
    if limit and count > limit:
        yield Reason(R.TOO_MANY, Reason(what, **values), limit=limit, count=count)


def _wire_problems(message: Header, abilities: Abilities) -> Iterator[Reason]:
    if abilities.codec is None:
        return
    limit = abilities.factsheet.protocol_limits.maximum_string_lengths.maximum_message_length
    try:
        wire = abilities.codec.formed(message)
    except (MalformedMessageError, ValidationError) as error:
        yield Reason(R.INEXPRESSIBLE, str(error), version=abilities.codec.version)
        return
    if limit and (size := len(abilities.codec.written(wire))) > limit:
        yield Reason(R.LONG_MESSAGE, limit=limit, count=size)


def _header_fields(abilities: Abilities) -> dict[str, Any]:
    robot = abilities.factsheet
    return {
        **_LONGEST_HEADER,
        "manufacturer": robot.manufacturer,
        "serial_number": robot.serial_number,
    }
