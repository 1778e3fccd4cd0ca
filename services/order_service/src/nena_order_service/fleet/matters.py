"""What of a robot's state matters to fleet control; most states under way say nothing new of it."""

from __future__ import annotations

from nena_order_service.fleet.reported import State


def matters(state: State) -> tuple[object, ...]:
    """Give all that missions and news are made of: not where the robot is, nor fractions of a percent.

    Of the nodes and edges to come the first counts, and whether there are any: all others follow it.
    """
    power, position = state.power_supply, state.mobile_robot_position
    return (
        state.order_id,
        state.order_update_id,
        state.last_node_id,
        state.last_node_sequence_id,
        state.node_states[0].sequence_id if state.node_states else None,
        bool(state.edge_states),
        state.action_states,
        state.instant_action_states,
        state.driving,
        state.paused,
        state.new_base_request,
        state.operating_mode,
        state.errors,
        state.safety_state,
        int(power.state_of_charge),
        power.charging,
        position and (position.map_id, position.localized),
        equipment(state),
    )


def equipment(state: State) -> tuple[object, ...]:
    """Give where a robot has loads, and its maps, for the dispatcher; not what changes all the time."""
    return state.loads and tuple(each.load_position for each in state.loads), state.maps
