"""The neutral state message, made from the robot's parts (section 7.8)."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from nena_edge_agent.driver.port import BatteryReport, GoalReport, GoalTable
from nena_edge_agent.protocol.events import SafetyReport
from nena_edge_agent.protocol.geometry import turn
from nena_edge_agent.protocol.journey import Journey
from nena_edge_agent.protocol.journey_report import intermediate_path, progress_information
from nena_edge_agent.protocol.parts import RobotParts, Senses
from nena_edge_agent.protocol.session import session_information
from nena_shared.vda5050.error import ErrorReference
from nena_shared.vda5050.state import (
    InfoLevel,
    Information,
    IntermediatePath,
    MobileRobotPosition,
    PowerSupply,
    SafetyState,
    State,
    Velocity,
)
from nena_shared.vda5050.visualization import Visualization

PERMANENTLY_FED = 100.0
"""State of charge of a robot that has not told of a battery."""


LASTING = (
    *("order_id", "order_update_id", "last_node_id", "last_node_sequence_id", "node_states", "edge_states"),
    *("planned_path", "distance_since_last_node", "new_base_request", "action_states"),
    *("instant_action_states", "loads", "paused", "operating_mode", "zone_sets", "zone_requests"),
)
"""What a state tells of the memory."""


def make_state(
    header: dict[str, Any], parts: RobotParts, journey: Journey, *, new_base_request: bool
) -> State:
    """Make the state message; ``header`` holds its five header fields by their neutral names."""
    progress = parts.progress
    ahead = progress.ahead
    return State(
        **header,
        maps=parts.maps,
        zone_sets=parts.zone_sets.states,
        zone_requests=parts.zone_access.states,
        order_id=progress.order_id,
        order_update_id=progress.order_update_id,
        last_node_id=progress.last_node_id,
        last_node_sequence_id=progress.last_node_sequence_id,
        node_states=ahead.node_states,
        edge_states=ahead.edge_states,
        planned_path=ahead.planned_path,
        intermediate_path=_way(header, parts, journey),
        distance_since_last_node=journey.since_node,
        mobile_robot_position=position(parts.senses),
        velocity=velocity(parts.senses),
        loads=parts.loads,
        driving=parts.goal.moving or parts.senses.velocity.moves or bool(parts.senses.goals.external),
        paused=parts.paused or parts.senses.pause_button,
        new_base_request=new_base_request,
        action_states=parts.actions.states,
        instant_action_states=parts.instants.states,
        power_supply=_power_supply(parts.senses.battery, charging=parts.charging),
        operating_mode=parts.operating_mode,
        errors=parts.errors.entries,
        information=(
            *progress_information(journey),
            *_information(parts.senses.goals),
            *session_information(parts.senses.session),
        ),
        safety_state=_safety_state(parts.senses.safety),
    )


def as_recorded(state: State, before: State) -> State:
    """Give ``state`` as far as a restart would not take it back: what lasts is as in ``before``.

    A goal that waits for the disk is not driven to, so the robot drives if it moves.
    """
    speed = state.velocity
    stands = speed is not None and not speed.vx and not speed.omega
    kept = {name: getattr(before, name) for name in LASTING}
    return state.model_copy(update=kept | {"driving": state.driving and not stands})


def make_visualization(
    header: dict[str, Any], parts: RobotParts, journey: Journey, *, state_header_id: int
) -> Visualization:
    """Make the visualization message; ``header`` as in :func:`make_state`."""
    return Visualization(
        **header,
        reference_state_header_id=state_header_id,
        mobile_robot_position=position(parts.senses),
        velocity=velocity(parts.senses),
        planned_path=parts.progress.ahead.planned_path,
        intermediate_path=_way(header, parts, journey),
    )


def _way(header: dict[str, Any], parts: RobotParts, journey: Journey) -> IntermediatePath | None:
    limits = (parts.capabilities.maximum_speed, parts.speed_limit)
    speed = min(limit for limit in limits if limit is not None)
    return intermediate_path(journey, header["timestamp"], speed)


def position(senses: Senses) -> MobileRobotPosition | None:
    """Give where the robot is, None before it knows."""
    if senses.pose is None:
        return None
    pose = senses.pose.pose
    return MobileRobotPosition(
        x=pose.x,
        y=pose.y,
        theta=turn(0.0, pose.theta),
        map_id=pose.map_id,
        localized=senses.pose.localized,
    )


def velocity(senses: Senses) -> Velocity | None:
    """Give how fast the robot is, None where that is not known."""
    if senses.velocity.vx is None:
        return None
    return Velocity(vx=senses.velocity.vx, vy=0.0, omega=senses.velocity.omega)


@lru_cache(maxsize=64)
def _safety_state(safety: SafetyReport) -> SafetyState:
    return SafetyState(active_emergency_stop=safety.emergency_stop, field_violation=safety.field_violation)


@lru_cache(maxsize=1024)
def _power_supply(battery: BatteryReport | None, *, charging: bool) -> PowerSupply:
    if battery is None:
        return PowerSupply(state_of_charge=PERMANENTLY_FED, charging=charging)
    return PowerSupply(
        state_of_charge=battery.state_of_charge,
        battery_voltage=battery.voltage,
        battery_current=battery.current,
        charging=battery.charging or charging,
    )


def _information(table: GoalTable) -> tuple[Information, ...]:
    """Show the goals that navigation knows of, and whose they are."""
    return tuple(
        Information(
            info_type="externalGoal" if goal.external else "goal",
            info_level=InfoLevel.INFO,
            info_references=(
                ErrorReference(reference_key="goalId", reference_value=goal.goal_id),
                ErrorReference(reference_key="status", reference_value=goal.status),
            ),
            info_descriptor=f"a goal that {_giver(goal)} gave is {goal.status}",
        )
        for goal in table.goals
    )


def _giver(goal: GoalReport) -> str:
    return "somebody else" if goal.external else "this robot's agent"
