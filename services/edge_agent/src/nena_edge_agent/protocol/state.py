"""The version-neutral state and visualization messages (sections 6.6, 7.8 and 7.9)."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from nena_edge_agent.driver.port import BatteryReport, GoalTable
from nena_edge_agent.protocol import driving, route_progress
from nena_edge_agent.protocol.conditions import collision_information, session_information
from nena_edge_agent.protocol.geometry import turn
from nena_edge_agent.protocol.robot_state import Reports, RobotState
from nena_shared.vda5050.error import ErrorReference
from nena_shared.vda5050.state import (
    InfoLevel,
    Information,
    MobileRobotPosition,
    PowerSupply,
    SafetyState,
    State,
    Velocity,
)
from nena_shared.vda5050.visualization import Visualization

CHARGE_WITHOUT_BATTERY = 100.0
"""State of charge of a robot that reports no battery."""


DURABLE_FIELDS = (
    *("order_id", "order_update_id", "last_node_id", "last_node_sequence_id", "node_states", "edge_states"),
    *("planned_path", "distance_since_last_node", "new_base_request", "action_states"),
    *("instant_action_states", "loads", "paused", "operating_mode", "zone_sets", "zone_requests"),
)
"""Fields of the state that are stored in the journal."""


def make_state(header: dict[str, Any], robot: RobotState) -> State:
    """Return the state message (section 7.8); ``header`` has its header fields by their neutral names."""
    progress, safety = robot.progress, robot.reports.safety
    return State(
        **header,
        # Section 7.8; each version of VDA 5050 leaves out what it lacks.
        maps=robot.maps,
        zone_sets=robot.zone_sets.states,
        zone_requests=robot.zone_requests.states,
        order_id=progress.order_id,
        order_update_id=progress.order_update_id,
        last_node_id=progress.last_node_id,
        last_node_sequence_id=progress.last_node_sequence_id,
        node_states=progress.node_states,
        edge_states=progress.edge_states,
        planned_path=progress.planned_path,
        # Navigation's own plan is the intermediate path, the order's the planned one (6.6.2).
        intermediate_path=route_progress.intermediate_path(robot, header["timestamp"]),
        distance_since_last_node=route_progress.since_node(robot),
        mobile_robot_position=position(robot.reports),
        velocity=velocity(robot.reports),
        loads=robot.loads,
        driving=_is_driving(robot),
        paused=robot.paused or robot.reports.pause_button,
        new_base_request=driving.new_base_request(robot),
        action_states=robot.actions.states,
        instant_action_states=robot.instant_actions.states,
        power_supply=_power_supply(robot.reports.battery, charging=robot.charging),
        operating_mode=robot.operating_mode,
        errors=robot.errors.entries,
        information=(
            *route_progress.information(robot),
            *_goal_information(robot.reports.goals),
            *session_information(robot.reports.session),
            *collision_information(robot),
        ),
        safety_state=SafetyState(
            active_emergency_stop=safety.emergency_stop, field_violation=safety.field_violation
        ),
    )


def _is_driving(robot: RobotState) -> bool:
    """Return whether the robot drives, or may drive because no odometry has arrived since a restart.

    A robot whose goal waits for navigation does not drive if its odometry confirms standstill.
    """
    velocity = robot.reports.velocity
    unknown = robot.goal.pending and velocity.vx is None
    waits = not robot.reports.navigation.available and not robot.goal.halting and velocity.vx is not None
    moving = robot.goal.moving and not waits
    return moving or velocity.moves or unknown or bool(robot.reports.goals.external)


def with_recorded_fields(state: State, before: State, *, last: bool = False) -> State:
    """Return ``state`` with the durable fields of ``before``, which are on disk: no restart can revert them.

    A goal that waits for the disk is not sent, so the robot only drives if it moves. ``last``: this is the
    last state before a shutdown, which also reports the end of that action.
    """
    speed = state.velocity
    stands = speed is not None and not speed.vx and not speed.omega
    kept = {name: getattr(before, name) for name in DURABLE_FIELDS}
    if last:
        del kept["instant_action_states"]
    return state.model_copy(update=kept | {"driving": state.driving and not stands})


def make_visualization(header: dict[str, Any], robot: RobotState, *, state_header_id: int) -> Visualization:
    """Return the visualization message (section 7.9); ``header`` as in :func:`make_state`."""
    return Visualization(
        **header,
        reference_state_header_id=state_header_id,
        mobile_robot_position=position(robot.reports),
        velocity=velocity(robot.reports),
        planned_path=robot.progress.planned_path,
        intermediate_path=route_progress.intermediate_path(robot, header["timestamp"]),
    )


def position(reports: Reports) -> MobileRobotPosition | None:
    """Return the robot's position, None before the first pose (section 7.8)."""
    if reports.pose is None:
        return None
    pose = reports.pose.pose
    return MobileRobotPosition(
        x=pose.x,
        y=pose.y,
        theta=turn(0.0, pose.theta),
        map_id=pose.map_id,
        localized=reports.pose.localized,
    )


def velocity(reports: Reports) -> Velocity | None:
    """Return the robot's velocity, None if it is unknown (section 7.8)."""
    if reports.velocity.vx is None:
        return None
    return Velocity(vx=reports.velocity.vx, vy=0.0, omega=reports.velocity.omega)


@lru_cache(maxsize=1024)
def _power_supply(battery: BatteryReport | None, *, charging: bool) -> PowerSupply:
    if battery is None:
        return PowerSupply(state_of_charge=CHARGE_WITHOUT_BATTERY, charging=charging)
    return PowerSupply(
        state_of_charge=battery.state_of_charge,
        battery_voltage=battery.voltage,
        battery_current=battery.current,
        charging=battery.charging or charging,
    )


def _goal_information(table: GoalTable) -> tuple[Information, ...]:
    """Return an information entry for each goal of navigation, with its sender (section 6.6.4)."""
    senders = {False: "this robot's agent", True: "another program"}
    return tuple(
        Information(
            info_type="externalGoal" if goal.external else "goal",
            info_level=InfoLevel.INFO,
            info_references=(
                ErrorReference(reference_key="goalId", reference_value=goal.goal_id),
                ErrorReference(reference_key="status", reference_value=goal.status),
            ),
            info_descriptor=f"a goal of {senders[goal.external]} is {goal.status}",
        )
        for goal in table.goals
    )
