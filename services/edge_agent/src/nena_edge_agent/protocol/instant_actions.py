"""Instant actions, which fleet control sends independently of the order (sections 6.2.1, 6.2.3 and 7.4).

Each action is checked on its own, and a repeated actionId is ignored.
"""

from __future__ import annotations

from nena_edge_agent.driver.port import Pose, PositionInitialized
from nena_edge_agent.protocol import actions, declaration, driving, orders, power, zones
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.declaration import (
    CANCEL_ORDER,
    FACTSHEET_REQUEST,
    INITIALIZE_POSITION,
    START_PAUSE,
    STATE_REQUEST,
)
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import SendFactsheet, SetPosition, StartAction
from nena_edge_agent.protocol.order_acceptance import EPOCH_HINT, map_list
from nena_edge_agent.protocol.robot_state import (
    INSTANT_ACTION_LIMIT,
    PositionRequest,
    PowerPhase,
    RobotState,
)
from nena_shared.vda5050 import action as vda_actions
from nena_shared.vda5050.action import SHUTDOWN, Action, ActionStatus, InstantActions
from nena_shared.vda5050.base import ANGLE_LIMIT
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope

MESSAGE_LIMIT = 100
"""Maximum number of actions in a message; a longer message is refused as a whole."""
IDS_KNOWN = 1000
"""Number of recent actionIds that are recognised when they are resent."""
CORE_ACTIONS = frozenset(
    {
        declaration.CANCEL_ORDER,
        declaration.START_PAUSE,
        declaration.STOP_PAUSE,
        declaration.INITIALIZE_POSITION,
        declaration.STATE_REQUEST,
        declaration.FACTSHEET_REQUEST,
        declaration.CLEAR_INSTANT_ACTIONS,
        declaration.ENABLE_ZONE_SET,
        declaration.DELETE_ZONE_SET,
        declaration.RETRY,
        declaration.SKIP_RETRY,
        declaration.TRIGGER,
        vda_actions.START_HIBERNATION,
        vda_actions.STOP_HIBERNATION,
        vda_actions.SHUTDOWN,
    }
)
"""Instant actions that the core does itself."""
IN_EVERY_MODE = frozenset({STATE_REQUEST, FACTSHEET_REQUEST})
"""Accepted in every operating mode."""
POSITION_TIMEOUT = 30.0
"""Timeout for the localisation to accept a position, seconds."""
FLEET_CONTROL = "FLEET_CONTROL"
"""The type of trigger that fleet control releases."""


def receive(robot: RobotState, message: InstantActions) -> None:
    """Start or refuse each action; one that was received before is ignored (section 6.2.1)."""
    refusal: tuple[ErrorType, str, str] | None = None
    if len(message.actions) > MESSAGE_LIMIT:
        text = f"the message has {len(message.actions)} instant actions, the robot accepts {MESSAGE_LIMIT}"
        refusal = ErrorType.INSUFFICIENT_MEMORY, text, "send them in parts"
    elif problem := robot.history.outdated(message.nena_epoch):
        text = f"the instant actions are refused: {problem}"
        refusal = ErrorType.VALIDATION_FAILURE, text, EPOCH_HINT
    if refusal:
        kind, text, hint = refusal
        entry = error(kind, text, hint=hint, topic="instantActions", header_id=message.header_id)
        robot.errors.report(entry, Until.INSTANT_ACTION_ACCEPTED)
        return
    robot.history.begin_epoch(message.nena_epoch, robot.utc_now)
    for action in message.actions:
        # QoS 0 and resends: an action that was received before is not executed twice (6.2.1).
        if action.action_id in robot.known_instant_ids:
            continue
        _remember_action(robot, action)
        if problem := _action_problem(robot, action):
            hint = "the factsheet lists the robot's actions"
            _refuse_action(robot, action, problem, hint=hint, header_id=message.header_id)
        else:
            _start_action(robot, action)


def _action_problem(robot: RobotState, action: Action) -> str | None:
    if action.action_id in robot.actions:
        return "the actionId is used by an action of the order"
    if problem := _mode_problem(robot, action):
        return problem
    declared = robot.capabilities.actions.get(action.action_type)
    if declared is None:
        return f"the robot does not support action '{action.action_type}'"
    if action.action_type not in CORE_ACTIONS and robot.instant_actions_running > INSTANT_ACTION_LIMIT:
        return f"{INSTANT_ACTION_LIMIT} instant actions are running already"
    idle = robot.idle and not robot.clearing and not robot.goal.moving
    if declared.needs_idle and not idle:
        return f"order '{robot.progress.order_id}' is active; wait for its end or cancel it"
    loaded = bool(robot.loads)
    return declared.problem(action, ActionScope.INSTANT) or declared.load_problem(loaded=loaded)


def _mode_problem(robot: RobotState, action: Action) -> str | None:
    """Return why the action is refused: the robot shuts down, or a person controls it (section 6.6.6)."""
    if robot.power is PowerPhase.SHUTTING_DOWN and action.action_type != SHUTDOWN:
        return "the robot is about to shut down"
    mode = robot.next_mode
    # A silent robot gets no other action than stopHibernation, which wakes it in each mode.
    if mode.fleet_controls or action.action_type in IN_EVERY_MODE or robot.power.silent:
        return None
    # INTERVENED accepts orders, and of the instant actions only cancelOrder (6.6.6).
    if mode.takes_orders and action.action_type == CANCEL_ORDER:
        return None
    return f"the robot is in mode {mode}"


def _start_action(robot: RobotState, action: Action) -> None:
    robot.errors.end(Until.INSTANT_ACTION_ACCEPTED)
    if action.action_type in CORE_ACTIONS:
        _do_core_action(robot, action)
    elif robot.holds_for(action):
        robot.instant_queue.append((action,))
        actions.schedule(robot)
    else:
        robot.instant_actions.change(action.action_id, ActionStatus.INITIALIZING)
        robot.effects.append(StartAction(action, robot.loads))


def _do_core_action(robot: RobotState, action: Action) -> None:  # noqa: C901, PLR0912 - a case for each type
    """Do what the core does itself (section 6.2.3); other instant actions are done by plug-ins."""
    change, action_id = robot.instant_actions.change, action.action_id
    match action.action_type:
        case declaration.CANCEL_ORDER:
            orders.cancel(robot, action)
        case declaration.START_PAUSE:  # it finishes when the robot has stopped
            change(action_id, ActionStatus.RUNNING)
            robot.paused = True
            if robot.goal.halt_problem:
                robot.request_halt()  # the driver answers again
        case declaration.STOP_PAUSE:  # a startPause that is still running fails
            robot.end_instant_actions(START_PAUSE, ActionStatus.FAILED, "revoked by stopPause")
            robot.paused = False
            pressed = robot.reports.pause_button  # which cannot be released remotely (6.2.3)
            status = ActionStatus.FAILED if pressed else ActionStatus.FINISHED
            change(action_id, status, "the pause button is pressed" if pressed else None)
        case declaration.INITIALIZE_POSITION:
            _initialize_position(robot, action)
        case declaration.STATE_REQUEST:
            change(action_id, ActionStatus.FINISHED)  # every instantActions message triggers a state
        case declaration.FACTSHEET_REQUEST:
            robot.effects.append(SendFactsheet())
            change(action_id, ActionStatus.FINISHED)
        case declaration.CLEAR_INSTANT_ACTIONS:
            change(action_id, *actions.clear_instant_actions(robot, action))
        case declaration.ENABLE_ZONE_SET:
            change(action_id, *zones.enable(robot, action))
        case declaration.DELETE_ZONE_SET:
            change(action_id, *zones.delete(robot, action))
        case declaration.RETRY | declaration.SKIP_RETRY:
            retries = action.action_type == declaration.RETRY
            problem = (actions.retry if retries else actions.skip_retry)(robot, action)
            if problem:
                hint = "the robot's state shows which actions are RETRIABLE"
                _refuse_action(robot, action, problem, hint=hint)
            else:
                change(action_id, ActionStatus.FINISHED)
        case declaration.TRIGGER:  # it releases all actions that wait for fleet control, as 3.0.1 specifies
            if actions.release(robot, FLEET_CONTROL):
                change(action_id, ActionStatus.FINISHED)
            else:
                change(action_id, ActionStatus.FAILED, "no action waits for a trigger of fleet control")
        case vda_actions.START_HIBERNATION:
            if problem := power.start_hibernation(robot, action):
                _refuse_action(robot, action, problem, hint="send a later wakeUpTime, and check the clocks")
        case vda_actions.STOP_HIBERNATION:
            power.stop_hibernation(robot, action)
        case vda_actions.SHUTDOWN:
            if problem := power.shut_down(robot, action):
                _refuse_action(robot, action, problem, hint="the robot's state shows what it is doing")


def _refuse_action(
    robot: RobotState, action: Action, problem: str, *, hint: str, header_id: int | None = None
) -> None:
    """Fail ``action``, and report why until the next instant action is accepted (section 6.6.5.4)."""
    robot.instant_actions.change(action.action_id, ActionStatus.FAILED, problem)
    entry = error(
        ErrorType.INVALID_INSTANT_ACTION,
        problem,
        hint=hint,
        topic="instantActions",
        header_id=header_id,
        action_id=action.action_id,
    )
    robot.errors.report(entry, Until.INSTANT_ACTION_ACCEPTED)


def _remember_action(robot: RobotState, action: Action) -> None:
    robot.known_instant_ids[action.action_id] = None
    while len(robot.known_instant_ids) > IDS_KNOWN:
        del robot.known_instant_ids[next(iter(robot.known_instant_ids))]
    # The state lists an actionId once; the one of the order stays.
    if action.action_id not in robot.actions:
        robot.instant_actions.add([ActionRecord(action, ActionScope.INSTANT, -1, ActionStatus.WAITING, None)])
    surplus = len(list(robot.instant_actions)) - INSTANT_ACTION_LIMIT
    if surplus > 0:
        ended = [record for record in robot.instant_actions if record.status.ended][:surplus]
        robot.instant_actions.remove(lambda record: record in ended)


# startPause and stopPause, and other reasons to pause the robot (section 6.2.3)


def apply_hold(robot: RobotState) -> None:
    """Pause or resume driving and actions, if a reason for a pause has begun or the last one has ended.

    Reasons are fleet control, the pause button, an emergency stop, a field violation, the mode INTERVENED and
    an error that stops the robot.
    """
    if robot.held == robot.hold_applied:
        return
    robot.hold_applied = robot.held
    if robot.hold_applied:
        actions.pause(robot)
        driving.stop(robot)
    else:
        actions.resume(robot)
        actions.schedule(robot)


def advance_pause(robot: RobotState) -> None:
    """Finish startPause when the robot has stopped (section 6.2.3)."""
    if robot.paused and robot.running_instant_actions(START_PAUSE) and driving.confirm_standstill(robot):
        robot.end_instant_actions(START_PAUSE, ActionStatus.FINISHED)


# initializePosition, initPosition in 2.x (section 6.2.3)


def _initialize_position(robot: RobotState, action: Action) -> None:
    """Send the position to the localisation, unless the robot drives or its order is at another node."""
    if problem := _position_problem(robot, action):
        robot.instant_actions.change(action.action_id, ActionStatus.FAILED, problem)
        return
    robot.instant_actions.change(action.action_id, ActionStatus.RUNNING)
    robot.position_request = PositionRequest(_text_parameter(action, "lastNodeId"), robot.now)
    pose = Pose(
        _number_parameter(action, "x"),
        _number_parameter(action, "y"),
        _number_parameter(action, "theta"),
        _text_parameter(action, "mapId"),
    )
    robot.effects.append(SetPosition(pose))


def position_initialized(robot: RobotState, answer: PositionInitialized) -> None:
    """End initializePosition with the localisation's answer, and set the requested last node (6.2.3)."""
    request, robot.position_request = robot.position_request, None
    if request is None:
        return
    if not answer.succeeded:
        robot.end_instant_actions(INITIALIZE_POSITION, ActionStatus.FAILED, answer.description)
        return
    if request.node_id != robot.progress.last_node_id or robot.idle:
        robot.progress.place_at(request.node_id)
    robot.end_instant_actions(INITIALIZE_POSITION, ActionStatus.FINISHED)


def advance_position(robot: RobotState) -> None:
    """Fail initializePosition (section 6.2.3) if the localisation takes too long."""
    request = robot.position_request
    if request and robot.now - request.requested_at >= POSITION_TIMEOUT:
        robot.position_request = None
        text = f"the localisation did not respond within {POSITION_TIMEOUT:.0f} s"
        robot.end_instant_actions(INITIALIZE_POSITION, ActionStatus.FAILED, text)


def _position_problem(robot: RobotState, action: Action) -> str | None:
    node_id, map_id = _text_parameter(action, "lastNodeId"), _text_parameter(action, "mapId")
    if map_id not in robot.map_ids:
        return f"the robot has {map_list(robot.map_ids)}, not '{map_id}'"
    if abs(theta := _number_parameter(action, "theta")) > ANGLE_LIMIT:
        return f"theta must be within -π and π, not {theta:g}"
    velocity = robot.reports.velocity
    # Nav2 does not become active without an initial position, so that a goal may wait for this very action.
    # If the robot was told to stop, its standstill must be confirmed.
    waits_for_navigation = (
        not robot.reports.navigation.available
        and not velocity.moves
        and (velocity.vx is not None or not robot.goal.halting)
    )
    if robot.goal.moving and not waits_for_navigation:
        return "the robot is driving; pause it or cancel its order first"
    if not robot.idle and node_id != robot.progress.last_node_id:
        return f"an order is active at node '{robot.progress.last_node_id}'; cancel it first"
    if len(robot.running_instant_actions(INITIALIZE_POSITION)) > 1:
        return "another position is being set"
    return None


def _number_parameter(action: Action, key: str) -> float:
    value = action.parameter(key)
    return float(value) if isinstance(value, int | float) else 0.0


def _text_parameter(action: Action, key: str) -> str:
    value = action.parameter(key)
    return value if isinstance(value, str) else ""
