"""The clauses that a robot is tested against, in the order in which they are tested."""

from __future__ import annotations

from math import hypot
from typing import Any, Final

from nena_conversations.kit.clause import ClauseFailedError, Clauses, NotApplicableError, Strength, require
from nena_conversations.kit.robot_content import FACTSHEETS, REFUSED, STATES, Edit, Wrong
from nena_conversations.kit.session import NO_HEADER, Errors, RobotSession, new_errors, new_id
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType, InstantActions
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.factsheet import ActionScope, Factsheet
from nena_shared.vda5050.order import Node
from nena_shared.vda5050.state import EmergencyStop, OperatingMode, State
from nena_shared.vda5050.topics import Topic

STATE_WITHIN: Final = 31.0
"""A state comes at least every 30 s, seconds."""
WILL_WITHIN: Final = 60.0
"""Time until the broker sends the last will, or the robot is back, seconds."""
UNMOVED: Final = 3.0
"""Time in which a robot that must not drive is watched, seconds."""
ARRIVED: Final = 0.5
"""Distance from a node at which a robot without another limit has arrived, m."""
REQUIRED: Final = ("startPause", "stopPause", "stateRequest", "factsheetRequest", "cancelOrder")
"""Instant actions that each robot has."""
ROBOT_CLAUSES: Final[Clauses[RobotSession]] = Clauses()
_clause = ROBOT_CLAUSES.add


@_clause("connection/retained", "The broker holds an ONLINE message of the robot", ("6.14", "6.5"))
async def _connection_is_retained(robot: RobotSession) -> None:
    await robot.until(lambda: robot.heard.connection, "a connection message")
    require(Topic.CONNECTION in robot.heard.retained, "the connection message is not retained")
    found = robot.heard.connection and robot.heard.connection.connection_state
    require(found is ConnectionState.ONLINE, f"the connection state is {found}, not ONLINE")


@_clause("state/interval", "A state at least every 30 s", ("6.10", "6.6"))
async def _states_come_regularly(robot: RobotSession) -> None:
    count = robot.heard.counts[Topic.STATE]
    await robot.until(lambda: robot.heard.counts[Topic.STATE] > count, "a state", STATE_WITHIN)


@_clause("state/position", "The state has a position, on a map", ("6.10.6", "7.8"))
async def _state_has_a_position(robot: RobotSession) -> None:
    state = await robot.state(lambda _: True, "a state")
    require(state.mobile_robot_position, "the state has no position: nothing can be driven to")


@_clause("factsheet/request", "factsheetRequest is answered with a factsheet", ("6.8.1", "6.2.3"))
async def _factsheet_is_sent(robot: RobotSession) -> None:
    count = robot.heard.counts[Topic.FACTSHEET]
    found = await robot.instant("factsheetRequest")
    robot.require_end(found, ActionStatus.FINISHED)
    await robot.until(lambda: robot.heard.counts[Topic.FACTSHEET] > count, "a factsheet")


@_clause("factsheet/actions", "The factsheet lists the actions that each robot has", ("6.15", "7.10"))
async def _factsheet_lists_required_actions(robot: RobotSession) -> None:
    factsheet = await robot.factsheet()
    listed = {
        each.action_type: each.action_scopes for each in factsheet.protocol_features.mobile_robot_actions
    }
    missing = [name for name in REQUIRED if name not in listed]
    require(not missing, f"the factsheet does not list {', '.join(missing)}")
    other = [name for name in REQUIRED if ActionScope.INSTANT not in listed[name]]
    require(not other, f"the factsheet lists {', '.join(other)}, but not as instant actions")


def _register_state(id_: str, title: str, sections: tuple[str | None, str], wrong: Wrong[State]) -> None:
    @_clause(f"state/{id_}", title, sections)
    async def state_is_right(robot: RobotSession) -> None:
        found = wrong(await robot.state(lambda _: True, "a state"))
        require(not found, f"in the state, {found}")


def _register_factsheet(
    id_: str, title: str, sections: tuple[str | None, str], wrong: Wrong[Factsheet]
) -> None:
    @_clause(f"factsheet/{id_}", title, sections)
    async def factsheet_is_right(robot: RobotSession) -> None:
        found = wrong(await robot.factsheet())
        require(not found, f"in the factsheet, {found}")


for each_state in STATES:
    _register_state(*each_state)
for each_factsheet in FACTSHEETS:
    _register_factsheet(*each_factsheet)


@_clause("factsheet/retained", "The broker holds the factsheet", ("6.15", "7.10"), Strength.SHOULD)
async def _factsheet_is_retained(robot: RobotSession) -> None:
    await robot.factsheet()
    require(Topic.FACTSHEET in robot.heard.retained, "the factsheet was not retained when the test began")


@_clause("stateRequest", "stateRequest is answered with a state", ("6.8.1", "6.2.3"))
async def _state_is_sent(robot: RobotSession) -> None:
    count = robot.heard.counts[Topic.STATE]
    found = await robot.instant("stateRequest")
    robot.require_end(found, ActionStatus.FINISHED)
    require(robot.heard.counts[Topic.STATE] > count, "no state came after stateRequest")


@_clause("instantAction/unknown", "An unknown instant action fails, and is named", ("6.9", "6.2.1"))
async def _unknown_instant_action_fails(robot: RobotSession) -> None:
    errors = robot.errors
    found = await robot.instant("danceLikeNobodyIsWatching")
    robot.require_end(found, ActionStatus.FAILED)
    await robot.state(lambda state: new_errors(state, errors), "an error about the unknown action")


@_clause("cancelOrder/idle", "cancelOrder without an order fails", ("6.6.3", "6.1.3"))
async def _cancel_without_order_fails(robot: RobotSession) -> None:
    found = await robot.instant("cancelOrder")
    robot.require_end(found, ActionStatus.FAILED)


@_clause("pause/standing", "startPause and stopPause show in the state", ("6.8.1", "6.2.3"))
async def _pause_shows(robot: RobotSession) -> None:
    for action, paused in (("startPause", True), ("stopPause", False)):
        found = await robot.instant(action)
        robot.require_end(found, ActionStatus.FINISHED)
        await _paused(robot, paused=paused)


async def _paused(robot: RobotSession, *, paused: bool) -> None:
    await robot.state(lambda state: bool(state.paused) is paused, f"paused {str(paused).lower()}")


@_clause("order/json", "A message that is no JSON changes nothing", ("6.7", "7.3"))
async def _broken_json_is_survived(robot: RobotSession) -> None:
    before = await robot.state(lambda _: True, "a state")
    robot.send_bytes(Topic.ORDER, b'{"headerId": 1, ')
    count = robot.heard.counts[Topic.STATE]
    await robot.instant("stateRequest")
    await robot.until(lambda: robot.heard.counts[Topic.STATE] > count, "a state after a broken order")
    require(robot.heard.state and robot.heard.state.order_id == before.order_id, "a broken order was taken")


def _register_refused(id_: str, title: str, sections: tuple[str | None, str], edit: Edit) -> None:
    """Register a clause on an order that the robot refuses."""

    @_clause(f"order/{id_}", title, sections)
    async def order_is_refused(robot: RobotSession) -> None:
        await robot.state(lambda state: state.mobile_robot_position, "a position")
        order_id, errors = new_id(), robot.errors
        order = {"orderId": order_id, "orderUpdateId": 0, **_two_nodes(robot)}
        edit(order)
        robot.send_json(Topic.ORDER, order)
        await robot.refused(order_id, errors, f"an order with {title[0].lower()}{title[1:]}")


def _two_nodes(robot: RobotSession) -> dict[str, Any]:
    """Return nodes and an edge where the robot stands, as they are sent."""
    x, y = robot.stand
    nodes = [
        {
            "nodeId": name,
            "sequenceId": sequence,
            "released": True,
            "nodePosition": {"x": x, "y": y, "mapId": robot.map_id},
            "actions": [],
        }
        for name, sequence in (("here", 0), ("there", 2))
    ]
    edge = {"edgeId": "here-there", "sequenceId": 1, "released": True, "actions": []}
    return {"nodes": nodes, "edges": [{**edge, "startNodeId": "here", "endNodeId": "there"}]}


for each in REFUSED:
    _register_refused(*each)


@_clause("order/accept", "An order at the robot's place is accepted and done", ("6.6.4.1", "6.1.4.1"))
async def _order_is_accepted(robot: RobotSession) -> None:
    await robot.state(lambda state: state.mobile_robot_position, "a position")
    order = robot.order(new_id(), 0, [robot.here()])
    await robot.accepted(order)
    state = await robot.done(order.order_id)
    require(
        (state.last_node_id, state.last_node_sequence_id) == (order.nodes[0].node_id, 0),
        f"lastNodeId is {state.last_node_id!r} ({state.last_node_sequence_id}), not the order's node",
    )


@_clause("order/repeat", "An order that comes again changes nothing", ("6.6.4.3", "6.1.4.4"))
async def _repeated_order_is_ignored(robot: RobotSession) -> None:
    order = robot.order(new_id(), 0, [robot.here()])
    await robot.accepted(order)
    before = await robot.done(order.order_id)
    robot.send(Topic.ORDER, order)
    await robot.instant("stateRequest")
    await robot.never(
        lambda state: state.driving or state.node_states, "the robot began the order again", 1.0
    )
    state = robot.heard.state
    require(state and state.order_id == before.order_id, "a repeated order replaced the order")


@_clause("order/action", "An action of a node runs once, and its state stays", ("6.11", "6.6.9"))
async def _node_action_runs(robot: RobotSession) -> None:
    if not robot.action:
        raise NotApplicableError(
            "an action may move something: name one for nodes, without parameters, with --action"
        )
    order_id = new_id()
    action = Action(action_type=robot.action, action_id=f"{order_id}-a", blocking_type=BlockingType.HARD)
    await robot.accepted(robot.order(order_id, 0, [robot.here(actions=(action,))]))
    await robot.state(
        lambda state: any(
            each.action_id == action.action_id and each.action_status.ended for each in state.action_states
        ),
        f"the end of action {robot.action!r}",
        robot.drive_within,
    )


@_clause("update/outdated", "An update with a lower orderUpdateId is refused", ("6.6.4.3", "6.1.4.4"))
async def _outdated_update_is_refused(robot: RobotSession) -> None:
    order_id = new_id()
    await robot.accepted(robot.order(order_id, 0, [robot.here()]))
    await robot.done(order_id)
    await robot.accepted(robot.order(order_id, 2, [robot.here()]))
    errors = robot.errors
    robot.send(Topic.ORDER, robot.order(order_id, 1, [robot.here()]))
    state = await robot.state(lambda state: new_errors(state, errors), "an error about an outdated update")
    require(state.order_update_id == 2, f"the robot went back to update {state.order_update_id}")  # noqa: PLR2004


@_clause("errors/references", "The error about an order names it", ("6.10.5", "6.6.5.4"), Strength.SHOULD)
async def _error_names_the_order(robot: RobotSession) -> None:
    order_id, found = await _refusal(robot)
    named = {each.reference_value for error in found for each in error.error_references}
    require(order_id in named, f"no error has the orderId {order_id!r} in its references")


@_clause("errors/level", "A refused order is no reason to stop", ("6.10.5", "6.6.5.1"))
async def _refusal_is_a_warning(robot: RobotSession) -> None:
    _, found = await _refusal(robot)
    levels = {each.error_level for each in found}
    require(ErrorLevel.FATAL not in levels, f"a refused order is reported as {ErrorLevel.FATAL}")


@_clause("errors/cleared", "An accepted order ends the error about a refused one", ("6.6.4", "6.6.5.4"))
async def _acceptance_clears_refusals(robot: RobotSession) -> None:
    _, found = await _refusal(robot)
    order = robot.order(new_id(), 0, [robot.here()])
    await robot.accepted(order)
    await robot.state(lambda state: not set(found) & set(state.errors), "a state without that error")


async def _refusal(robot: RobotSession) -> tuple[str, Errors]:
    """Send an order with an unknown action; return its ID and the errors about it."""
    await robot.state(lambda state: state.mobile_robot_position, "a position")
    order_id, before = new_id(), robot.errors
    unknown = Action(action_type="danceAtNode", action_id=f"{order_id}-a", blocking_type=BlockingType.HARD)
    robot.send(Topic.ORDER, robot.order(order_id, 0, [robot.here(actions=(unknown,))]))
    state = await robot.refused(order_id, before, "an order with an unknown action")
    return order_id, new_errors(state, before)


@_clause("instantAction/repeated", "An instant action that comes again is not done again", ("6.9", "7.4"))
async def _repeated_action_is_ignored(robot: RobotSession) -> None:
    action_id = await _sent_again(robot, "startPause")
    await robot.instant("stopPause")
    robot.send(Topic.INSTANT_ACTIONS, _actions(("startPause", action_id)))
    await robot.instant("stateRequest")
    state = await robot.state(lambda _: True, "a state")
    require(not state.paused, "a startPause that was done before has paused the robot")


async def _sent_again(robot: RobotSession, action_type: str) -> str:
    action_id = new_id()
    robot.send(Topic.INSTANT_ACTIONS, _actions((action_type, action_id)))
    await robot.until(lambda: _has_ended(robot, action_id), f"the end of {action_type}")
    return action_id


def _actions(*pairs: tuple[str, str]) -> InstantActions:
    """Return instant actions by type and ID."""
    actions = (
        Action(action_type=kind, action_id=id_, blocking_type=BlockingType.NONE) for kind, id_ in pairs
    )
    return InstantActions(**NO_HEADER, actions=tuple(actions))


def _has_ended(robot: RobotSession, action_id: str) -> bool:
    state = robot.instant_state(action_id)
    return state is not None and state.action_status.ended


@_clause("instantAction/two", "Several instant actions in one message are all done", ("6.9", "7.4"))
async def _two_actions_are_done(robot: RobotSession) -> None:
    ids = (new_id(), new_id())
    robot.send(Topic.INSTANT_ACTIONS, _actions(*(("stateRequest", each) for each in ids)))
    await robot.until(lambda: all(_has_ended(robot, each) for each in ids), "the end of both stateRequests")


@_clause("instantAction/json", "Instant actions that are no JSON change nothing", ("6.9", "7.4"))
async def _broken_actions_are_survived(robot: RobotSession) -> None:
    robot.send_bytes(Topic.INSTANT_ACTIONS, b'{"headerId": 1, ')
    await robot.instant("stateRequest")


@_clause("instantAction/kept", "Instant actions stay in the state until they are cleared", (None, "6.6.9"))
async def _instant_actions_stay(robot: RobotSession) -> None:
    action_id = await _sent_again(robot, "stateRequest")
    await robot.accepted(robot.order(new_id(), 0, [robot.here()]))
    require(_has_ended(robot, action_id), "the state of an instant action is gone with the next order")


@_clause("clearInstantActions", "clearInstantActions clears them", (None, "6.2.3"))
async def _instant_actions_are_cleared(robot: RobotSession) -> None:
    action_id = await _sent_again(robot, "stateRequest")
    await robot.instant("clearInstantActions")
    await robot.until(lambda: robot.instant_state(action_id) is None, "a state without the ended action")


@_clause("cancelOrder/other", "cancelOrder of another order fails", (None, "6.1.3"), moves=True)
async def _cancel_of_another_order_fails(robot: RobotSession) -> None:
    order_id, _ = await _begin_drive(robot, released=2)
    found = await robot.instant("cancelOrder", orderId="another-order")
    robot.require_end(found, ActionStatus.FAILED)
    state = await robot.done(order_id, robot.drive_within)
    require(state.last_node_id == "place-1", "the order was cancelled")


def _unknown(action_type: str, sections: tuple[str | None, str], **parameters: str) -> None:
    """Register a clause on an action about something that the robot does not have."""

    @_clause(f"{action_type}/unknown", f"{action_type} of something unknown fails", sections)
    async def action_fails(robot: RobotSession) -> None:
        actions = (await robot.factsheet()).protocol_features.mobile_robot_actions
        if action_type not in {each.action_type for each in actions}:
            raise NotApplicableError(f"the factsheet does not list {action_type}")
        found = await robot.instant(action_type, **parameters)
        robot.require_end(found, ActionStatus.FAILED)


_unknown("enableMap", ("6.7", "6.2.3"), mapId="no-such-map", mapVersion="1")
_unknown("deleteMap", ("6.7", "6.2.3"), mapId="no-such-map", mapVersion="1")
_unknown("enableZoneSet", (None, "6.2.3"), zoneSetId="no-such-zone-set")
_unknown("deleteZoneSet", (None, "6.2.3"), zoneSetId="no-such-zone-set")


@_clause("update/same", "The same orderUpdateId with another content is refused", (None, "6.1.4.5"))
async def _changed_repetition_is_refused(robot: RobotSession) -> None:
    order = robot.order(new_id(), 0, [robot.here()])
    await robot.accepted(order)
    before = robot.errors
    (node,) = order.nodes
    changed = order.model_copy(update={"nodes": (node.model_copy(update={"node_descriptor": "changed"}),)})
    robot.send(Topic.ORDER, changed)
    await robot.state(lambda state: new_errors(state, before), "an error about the changed order")


@_clause("update/afterCancel", "An update of a cancelled order is refused", ("6.6.3", "6.1.3.1"), moves=True)
async def _update_after_cancel_is_refused(robot: RobotSession) -> None:
    robot.require_plan(3)
    order_id, nodes = await _begin_drive(robot, released=2, places=3)
    await robot.state(lambda state: state.driving, "driving true", robot.drive_within)
    await robot.instant("cancelOrder")
    before = robot.errors
    tail = [nodes[1], nodes[2].model_copy(update={"released": True})]
    robot.send(Topic.ORDER, robot.order(order_id, 1, tail, first_sequence=2))
    state = await robot.state(lambda state: new_errors(state, before), "an error about the update")
    require(not state.driving and not state.node_states, "the robot has taken up a cancelled order again")


@_clause(
    "update/stitchChanged", "An update that changes the last node is refused", (None, "6.1.2"), moves=True
)
async def _changed_stitch_is_refused(robot: RobotSession) -> None:
    robot.require_plan(3)
    order_id, nodes = await _begin_drive(robot, released=2, places=3)
    before = robot.errors
    tail = [nodes[1].model_copy(update={"node_descriptor": "changed"}), nodes[2]]
    robot.send(Topic.ORDER, robot.order(order_id, 1, tail, first_sequence=2))
    await robot.state(lambda state: new_errors(state, before), "an error about the update")


@_clause("update/horizon", "An update may take the horizon away", ("6.6.2", "6.1.2"), moves=True)
async def _horizon_is_taken_away(robot: RobotSession) -> None:
    robot.require_plan(3)
    order_id, nodes = await _begin_drive(robot, released=2, places=3)
    await robot.accepted(robot.order(order_id, 1, [nodes[1]], first_sequence=2))
    state = await robot.done(order_id, robot.drive_within)
    require(state.last_node_id == "place-1", f"lastNodeId is {state.last_node_id!r}, not the last node")


@_clause(
    "order/states", "An accepted order has its nodes and edges in the state", ("6.10.6", "6.6.2"), moves=True
)
async def _accepted_order_is_shown(robot: RobotSession) -> None:
    robot.require_plan(3)
    order_id, _ = await _begin_drive(robot, released=2, places=3)
    state = await robot.state(lambda state: state.order_id == order_id, "the order in the state")
    shown = [(each.node_id, each.released) for each in state.node_states if each.sequence_id]
    require(shown == [("place-1", True), ("place-2", False)], f"nodeStates are {shown}")
    require(len(state.edge_states) == len(shown), f"there are {len(state.edge_states)} edgeStates")


@_clause("drive", "A base is driven to its end, node by node", ("6.6.1", "6.1.1"), moves=True)
async def _base_is_driven(robot: RobotSession) -> None:
    order_id, _ = await _begin_drive(robot, released=2)
    await robot.state(lambda state: state.driving, "driving true", robot.drive_within)
    state = await robot.done(order_id, robot.drive_within)
    require(state.last_node_id == "place-1", f"lastNodeId is {state.last_node_id!r}, not the last node")
    require(not state.edge_states, "the state still has edges at the end of the order")
    _check_arrival(robot, state, 1)


@_clause("drive/horizon", "The robot stops at the end of its base", ("6.6.1", "6.1.1"), moves=True)
async def _horizon_is_not_driven(robot: RobotSession) -> None:
    robot.require_plan(3)
    order_id, nodes = await _begin_drive(robot, released=2, places=3)
    state = await robot.state(
        lambda state: state.order_id == order_id and state.last_node_id == "place-1" and not state.driving,
        "the robot at the end of its base",
        robot.drive_within,
    )
    require(
        [node.node_id for node in state.node_states] == ["place-2"],
        "the horizon is no longer in nodeStates at the end of the base",
    )
    await robot.never(lambda state: state.driving, "the robot drove into its horizon", UNMOVED)
    tail = [nodes[1], nodes[2].model_copy(update={"released": True})]
    await robot.accepted(robot.order(order_id, 1, tail, first_sequence=2))
    state = await robot.done(order_id, robot.drive_within)
    require(state.last_node_id == "place-2", f"lastNodeId is {state.last_node_id!r} after the update")
    _check_arrival(robot, state, 2)


@_clause("drive/extended", "A base that grows in time is driven on", ("6.6.2", "6.1.2"), moves=True)
async def _base_is_extended(robot: RobotSession) -> None:
    robot.require_plan(3)
    order_id, nodes = await _begin_drive(robot, released=2, places=3)
    await robot.state(lambda state: state.driving, "driving true", robot.drive_within)
    tail = [nodes[1], nodes[2].model_copy(update={"released": True})]
    await robot.accepted(robot.order(order_id, 1, tail, first_sequence=2))
    state = await robot.done(order_id, robot.drive_within * 2)
    require(state.last_node_id == "place-2", f"lastNodeId is {state.last_node_id!r} after the update")


@_clause(
    "update/stitch",
    "An update that does not continue the base is refused",
    ("6.6.4.3", "6.1.4.4"),
    moves=True,
)
async def _wrong_stitch_is_refused(robot: RobotSession) -> None:
    robot.require_plan(3)
    order_id, nodes = await _begin_drive(robot, released=2, places=3)
    errors = robot.errors
    far_on = nodes[2].model_copy(update={"released": True})
    robot.send(Topic.ORDER, robot.order(order_id, 1, [far_on], first_sequence=8))
    state = await robot.state(lambda state: new_errors(state, errors), "an error about the update")
    require(state.order_update_id == 0, "the robot took an update that does not continue its base")


@_clause("order/other", "Another order is refused while one is driven", ("6.6.4.1", "6.1.4.6"), moves=True)
async def _other_order_is_refused(robot: RobotSession) -> None:
    order_id, _ = await _begin_drive(robot, released=2)
    await robot.state(lambda state: state.driving, "driving true", robot.drive_within)
    errors, other = robot.errors, new_id()
    robot.send(Topic.ORDER, robot.order(other, 0, [robot.here()]))
    state = await robot.refused(other, errors, "another order during an order")
    require(state.order_id == order_id, "the robot lost its order")
    await robot.done(order_id, robot.drive_within)


@_clause("pause/driving", "startPause stops a drive, stopPause continues it", ("6.8.1", "6.2.3"), moves=True)
async def _pause_stops_the_drive(robot: RobotSession) -> None:
    order_id, _ = await _begin_drive(robot, released=2)
    await robot.state(lambda state: state.driving, "driving true", robot.drive_within)
    found = await robot.instant("startPause")
    robot.require_end(found, ActionStatus.FINISHED)
    await robot.state(lambda state: state.paused and not state.driving, "a paused robot that stands")
    await robot.never(lambda state: state.driving, "the paused robot drove", UNMOVED)
    await robot.instant("stopPause")
    state = await robot.done(order_id, robot.drive_within)
    require(state.last_node_id == "place-1", "the drive did not continue after stopPause")


@_clause("cancelOrder", "cancelOrder ends an order that is driven", ("6.6.3", "6.1.3"), moves=True)
async def _order_is_cancelled(robot: RobotSession) -> None:
    order_id, _ = await _begin_drive(robot, released=2)
    await robot.state(lambda state: state.driving, "driving true", robot.drive_within)
    found = await robot.instant("cancelOrder")
    robot.require_end(found, ActionStatus.FINISHED)
    state = await robot.state(lambda state: not state.driving, "a robot that stands")
    require(not state.node_states and not state.edge_states, "nodes or edges remain after cancelOrder")
    require(state.order_id == order_id, f"orderId is {state.order_id!r} after cancelOrder, not the order's")


@_clause("order/afterCancel", "A new order is accepted after cancelOrder", ("6.6.3", "6.1.3"), moves=True)
async def _order_follows_a_cancelled_one(robot: RobotSession) -> None:
    await _begin_drive(robot, released=2)
    await robot.state(lambda state: state.driving, "driving true", robot.drive_within)
    await robot.instant("cancelOrder")
    order_id, _ = await _begin_drive(robot, released=2)
    await robot.done(order_id, robot.drive_within)


@_clause("visualization", "The robot sends visualizations", ("6.13", "7.9"), Strength.SHOULD, moves=True)
async def _visualizations_come(robot: RobotSession) -> None:
    order_id, _ = await _begin_drive(robot, released=2)
    await robot.done(order_id, robot.drive_within)
    require(robot.heard.counts[Topic.VISUALIZATION], "no visualization came, not even in a drive")


@_clause("person/emergencyStop", "A pressed emergency stop shows in the state", ("6.10.6", "7.8"))
async def _emergency_stop_shows(robot: RobotSession) -> None:
    await robot.ask("press the emergency stop of the robot")
    await robot.state(_is_stopped, "an active emergency stop")
    await robot.ask("release the emergency stop, and acknowledge it")
    await robot.state(lambda state: not _is_stopped(state), "the end of the emergency stop")


def _is_stopped(state: State) -> bool:
    return state.safety_state.active_emergency_stop is not EmergencyStop.NONE


@_clause("person/manual", "A robot in MANUAL says so, and takes no order", ("6.10.6", "6.6.6"))
async def _manual_robot_takes_no_order(robot: RobotSession) -> None:
    await robot.ask("switch the robot to MANUAL")
    await robot.state(lambda state: state.operating_mode is OperatingMode.MANUAL, "the mode MANUAL")
    order, before = robot.order(new_id(), 0, [robot.here()]), robot.errors
    robot.send(Topic.ORDER, order)
    await robot.refused(order.order_id, before, "an order to a robot in MANUAL")


@_clause("person/automatic", "A robot that is back in AUTOMATIC takes orders", ("6.10.6", "6.6.6"))
async def _automatic_robot_takes_orders(robot: RobotSession) -> None:
    await robot.ask("switch the robot to AUTOMATIC")
    await robot.state(lambda state: state.operating_mode is OperatingMode.AUTOMATIC, "the mode AUTOMATIC")
    await robot.accepted(robot.order(new_id(), 0, [robot.here()]))


@_clause("person/link", "A broken link shows, and a state follows its end", ("6.14", "6.5"))
async def _broken_link_shows(robot: RobotSession) -> None:
    await robot.ask("cut the robot's link, such as its radio")
    broken = ConnectionState.CONNECTION_BROKEN
    await robot.until(lambda: _connection(robot) is broken, f"the last will {broken}", WILL_WITHIN)
    await robot.ask("restore the robot's link")
    count = robot.heard.counts[Topic.STATE]
    await robot.until(lambda: _connection(robot) is ConnectionState.ONLINE, "ONLINE", WILL_WITHIN)
    await robot.until(lambda: robot.heard.counts[Topic.STATE] > count, "a state after ONLINE", STATE_WITHIN)


def _connection(robot: RobotSession) -> ConnectionState | None:
    return robot.heard.connection.connection_state if robot.heard.connection else None


async def _begin_drive(robot: RobotSession, *, released: int, places: int = 2) -> tuple[str, list[Node]]:
    """Drive back to the first place, then send an order along the plan; return its ID and nodes."""
    robot.require_plan(places)
    await robot.state(lambda state: state.mobile_robot_position, "a position")
    nodes = [robot.node(at, released=at < released) for at in range(places)]
    back = new_id()
    x, y = robot.stand
    at_start = hypot(x - robot.plan[0][0], y - robot.plan[0][1]) < ARRIVED
    await robot.accepted(robot.order(back, 0, nodes[:1] if at_start else [robot.here(), nodes[0]]))
    await robot.done(back, robot.drive_within * 2)
    order_id = new_id()
    await robot.accepted(robot.order(order_id, 0, nodes))
    return order_id, list(robot.order(order_id, 0, nodes).nodes)


def _check_arrival(robot: RobotSession, state: State, place: int) -> None:
    position = state.mobile_robot_position
    if position is None:
        raise ClauseFailedError("the robot has lost its position")
    x, y = robot.plan[place]
    away = hypot(position.x - x, position.y - y)
    require(away <= ARRIVED, f"the robot reports its arrival {away:.2f} m from the node")
