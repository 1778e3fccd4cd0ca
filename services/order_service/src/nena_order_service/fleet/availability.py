"""Whether a robot can accept an order now, and which fields of its state this depends on."""

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
    """Return why the robot cannot be reached; None if it can.

    ``unreadable`` is the problem of its messages, ``broker`` whether our own link is up. ``unread``: the
    robot has to report before anything is sent to it, see :meth:`FleetController.on_broker`.
    """
    if unread and link is not LinkStatus.HIBERNATING:
        return "has not reported its state since the order service took over"
    if not broker:
        return "cannot be reached: the order service has no connection to the MQTT broker"
    if link is LinkStatus.UNREADABLE:
        return unreadable
    return LINK_REASONS.get(link)


def occupied(state: State, instant_ids: Collection[str]) -> str | None:
    """Return what keeps a reachable robot from taking a new order (section 6.6.8), or None."""
    if not state.operating_mode.takes_orders:
        return f"is in operating mode {state.operating_mode}, which takes no orders"
    if not is_idle(state, instant_ids):
        return f"still works on the order {state.order_id!r}"
    return None


def unfit(state: State, *, placed: bool) -> str | None:
    """Return why a free robot would refuse an order or could not drive it; None if it could.

    ``placed``: the robot has reported its position before, and will do so again.
    """
    error = failures.fatal(state.errors)
    if error is not None:
        return f"has a fatal error: {failures.in_words(error)}"
    if waiting := _without_navigation(state):
        return waiting
    return "is not localised: set its initial position" if lost(state, placed=placed) else None


def lost(state: State, *, placed: bool) -> bool:
    """Return whether a robot is not localised; ``placed`` as for :func:`unfit`.

    The first states after a robot's start may arrive before its localisation has reported a pose.
    """
    position = state.mobile_robot_position
    return placed if position is None else not position.localized


def hindered(state: State) -> str | None:
    """Return what keeps a robot from driving now, although it accepts orders; None if nothing."""
    if state.safety_state.active_emergency_stop is not EmergencyStop.NONE:
        return "has an active emergency stop"
    return "is paused" if state.paused else _without_navigation(state)


def _without_navigation(state: State) -> str | None:
    waiting = failures.no_navigation(state.errors)
    return f"waits: {failures.in_words(waiting)}" if waiting else None


def vehicle_state(state: State | None, link: LinkStatus, instant_ids: Collection[str]) -> VehicleState:
    """Return the state in openTCS's terms; UNKNOWN is a robot that does not report it."""
    if state is None or link is not LinkStatus.ONLINE:
        return VehicleState.UNKNOWN
    if failures.fatal(state.errors) is not None:
        return VehicleState.ERROR
    if not state.operating_mode.takes_orders:
        return VehicleState.UNAVAILABLE
    if not is_idle(state, instant_ids):
        return VehicleState.EXECUTING
    return VehicleState.CHARGING if state.power_supply.charging else VehicleState.IDLE


def matters(state: State) -> tuple[object, ...]:
    """Return all fields that VDA orders and events depend on, without position and fractions of a percent.

    Of the coming nodes and edges, the first counts, and whether there are any: all others follow from it.
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
    """Return a robot's load positions and maps, for the dispatcher; no fields that change continuously."""
    return state.loads and tuple(each.load_position for each in state.loads), state.maps
