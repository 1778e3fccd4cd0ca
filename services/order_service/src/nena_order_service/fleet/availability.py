"""Determine whether a robot can accept an order now, and which fields of its state this depends on."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from nena_order_service.fleet import failures
from nena_order_service.fleet.robot import LinkStatus, is_idle
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.vda5050.state import EmergencyStop, State

LINK_REASONS: Final = {
    LinkStatus.UNKNOWN: "has never connected",
    LinkStatus.OFFLINE: "is offline: it has disconnected from the broker",
    LinkStatus.HIBERNATING: "is hibernating",
    LinkStatus.CONNECTION_BROKEN: "has lost its connection to the broker",
    LinkStatus.SILENT: "is silent: it has not reported its state for too long",
}


def away(link: LinkStatus, unreadable: str = "", *, broker: bool, unread: bool = False) -> str | None:
    """Return, as a predicate, why the robot cannot be reached; None if it can.

    ``unreadable`` describes the problem with its messages; ``broker`` is whether our own link is up.
    ``unread``: the robot must report before it is sent anything, see :meth:`FleetController.on_broker`.
    """
    if unread and link is not LinkStatus.HIBERNATING:
        return "has not reported its state since the order service took over"
    if not broker:
        return "cannot be reached: the order service has no connection to the MQTT broker"
    if link is LinkStatus.UNREADABLE:
        return unreadable
    return LINK_REASONS.get(link)


def occupied(state: State, instant_ids: Collection[str]) -> str | None:
    """Return, as a predicate, why a reachable robot is not free for a new order (section 6.6.8), or None."""
    if not state.operating_mode.takes_orders:
        return f"is in operating mode {state.operating_mode}, which takes no orders"
    if not is_idle(state, instant_ids):
        return f"still works on the order {state.order_id!r}"
    return None


def unfit(state: State, *, placed: bool) -> str | None:
    """Return, as a predicate, why a free robot would refuse or could not drive an order; or None.

    ``placed``: the robot reports its position in general.
    """
    error = failures.fatal(state.errors)
    if error is not None:
        return f"has a fatal error: {failures.describe(error)}"
    if waiting := _without_navigation(state):
        return waiting
    return "is not localised: set its initial position" if lost(state, placed=placed) else None


def lost(state: State, *, placed: bool) -> bool:
    """Return whether a robot is not localised; ``placed`` as for :func:`unfit`.

    After a robot's start, states may arrive before its localisation has reported a pose.
    """
    position = state.mobile_robot_position
    return placed if position is None else not position.localized


def cannot_drive(state: State) -> str | None:
    """Return, as a predicate, why a robot that accepts orders cannot drive now; None if it can."""
    if state.safety_state.active_emergency_stop is not EmergencyStop.NONE:
        return "has an active emergency stop"
    return "is paused" if state.paused else _without_navigation(state)


def _without_navigation(state: State) -> str | None:
    waiting = failures.no_navigation(state.errors)
    return f"waits: {failures.describe(waiting)}" if waiting else None


def vehicle_state(state: State | None, link: LinkStatus, instant_ids: Collection[str]) -> VehicleState:
    """Return the vehicle state (openTCS); UNKNOWN for a robot that does not report."""
    if state is None or link is not LinkStatus.ONLINE:
        return VehicleState.UNKNOWN
    if failures.fatal(state.errors) is not None:
        return VehicleState.ERROR
    if not state.operating_mode.takes_orders:
        return VehicleState.UNAVAILABLE
    if not is_idle(state, instant_ids):
        return VehicleState.EXECUTING
    return VehicleState.CHARGING if state.power_supply.charging else VehicleState.IDLE


def significant_fields(state: State) -> tuple[object, ...]:
    """Return the significant fields of a state: those on which VDA orders and events depend.

    Position and fractions of the charge are left out. Of the remaining nodes and edges, the first node and
    whether there are edges suffice, because all others follow from them.
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
    """Return the load positions and maps of a robot, as far as the dispatcher needs them."""
    return state.loads and tuple(each.load_position for each in state.loads), state.maps
