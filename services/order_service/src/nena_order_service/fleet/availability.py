"""Determine whether a robot can accept an order now, and which fields of its state this depends on."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from nena_order_service.fleet import failures
from nena_order_service.fleet.robot import LinkStatus, is_idle
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.state import EmergencyStop, State

R = ReasonCode

LINK_REASONS: Final = {
    LinkStatus.UNKNOWN: Reason(R.NEVER_CONNECTED),
    LinkStatus.OFFLINE: Reason(R.IS_OFFLINE),
    LinkStatus.HIBERNATING: Reason(R.IS_HIBERNATING),
    LinkStatus.CONNECTION_BROKEN: Reason(R.CONNECTION_LOST),
    LinkStatus.SILENT: Reason(R.IS_SILENT),
}


_POSITIONS: Final = ("agvPosition", "mobileRobotPosition")
_LOCALISED: Final = {*_POSITIONS, "agvPosition.positionInitialized", "mobileRobotPosition.localized"}
_RESTS_ON: Final = {
    R.IN_MODE: {"operatingMode"},
    R.EMERGENCY_STOP: {"safetyState", "safetyState.eStop", "safetyState.activeEmergencyStop"},
    R.FATAL_ERROR: {"errors.errorLevel"},
    R.MUST_RECHARGE: {
        *("batteryState", "batteryState.batteryCharge"),
        *("powerSupply", "powerSupply.stateOfCharge"),
    },
    R.NOT_LOCALISED: _LOCALISED,
    R.NO_POSE: _LOCALISED,
}
"""Fields of a state on which reasons rest, by their paths on the wire."""


def with_received(reason: Reason, substituted: Collection[Repair]) -> Reason:
    """Return a reason with the received values, if it rests on what was read in place of them."""
    fields = _RESTS_ON.get(reason.code, ())
    received = "; ".join(f"{each.field} {each.received}" for each in substituted if each.field in fields)
    return Reason(R.SAFEST_READING, reason, received=received) if received else reason


def why_away(
    link: LinkStatus, unreadable: Reason | None = None, *, broker: bool, unread: bool = False
) -> Reason | None:
    """Return, as a predicate, why the robot cannot be reached; None if it can.

    ``unreadable`` describes the problem with its messages; ``broker`` is whether our own link is up.
    ``unread``: the robot must report before it is sent anything, see :meth:`FleetController.on_broker`.
    """
    if unread and link is not LinkStatus.HIBERNATING:
        return unreadable or Reason(R.UNSEEN_SINCE_TAKEOVER)
    if not broker:
        return Reason(R.NO_BROKER)
    if link in (LinkStatus.UNREADABLE, LinkStatus.UNKNOWN) and unreadable:
        return unreadable
    return LINK_REASONS.get(link)


def why_occupied(
    state: State, instant_ids: Collection[str], substituted: Collection[Repair]
) -> Reason | None:
    """Return, as a predicate, why a reachable robot is not free for a new order (section 6.6.8), or None."""
    if not state.operating_mode.takes_orders:
        return Reason(R.IN_MODE, mode=state.operating_mode)
    if not is_idle(state, instant_ids):
        return why_unread_action(state, substituted) or Reason(R.WORKS_ON_ORDER, order=state.order_id)
    return None


def why_unread_action(state: State, substituted: Collection[Repair]) -> Reason | None:
    """Return, as a predicate, that an action with an unreadable status keeps an order open; or None."""
    read = next((each for each in substituted if each.field == "actionStates.actionStatus"), None)
    if read is None or state.node_states or state.edge_states:
        return None
    return Reason(R.UNREAD_ACTION, field=read.field, received=read.received, allowed=", ".join(ActionStatus))


def why_unfit(state: State, *, placed: bool) -> Reason | None:
    """Return, as a predicate, why a free robot would refuse or could not drive an order; or None.

    ``placed``: the robot reports its position in general.
    """
    error = failures.first_fatal(state.errors)
    if error is not None:
        return Reason(R.FATAL_ERROR, failures.describe_error(error))
    if waiting := _why_without_navigation(state):
        return waiting
    return Reason(R.NOT_LOCALISED) if is_lost(state, placed=placed) else None


def is_lost(state: State, *, placed: bool) -> bool:
    """Return whether a robot is not localised; ``placed`` as for :func:`why_unfit`."""
    position = state.mobile_robot_position
    # Nav2's AMCL gives no pose before it has an initial one, so states without a position come first.
    return placed if position is None else not position.localized


def why_not_driving(state: State) -> Reason | None:
    """Return, as a predicate, why a robot cannot drive for its order now; None if it can."""
    if not state.operating_mode.takes_orders:
        return Reason(R.IN_MODE, mode=state.operating_mode)
    if state.safety_state.active_emergency_stop is not EmergencyStop.NONE:
        return Reason(R.EMERGENCY_STOP)
    return Reason(R.IS_PAUSED) if state.paused else _why_without_navigation(state)


def _why_without_navigation(state: State) -> Reason | None:
    waiting = (error for error in state.errors if error.error_type in failures.NO_NAVIGATION)
    return next((Reason(R.NO_NAVIGATION, failures.describe_error(error)) for error in waiting), None)


def vehicle_state_of(state: State | None, link: LinkStatus, instant_ids: Collection[str]) -> VehicleState:
    """Return the vehicle state (openTCS); UNKNOWN for a robot that does not report."""
    if state is None or link is not LinkStatus.ONLINE:
        return VehicleState.UNKNOWN
    if failures.first_fatal(state.errors) is not None:
        return VehicleState.ERROR
    if not state.operating_mode.takes_orders:
        return VehicleState.UNAVAILABLE
    if not is_idle(state, instant_ids):
        return VehicleState.EXECUTING
    return VehicleState.CHARGING if state.power_supply.charging else VehicleState.IDLE


def significant_fields(state: State) -> tuple[object, ...]:
    """Return the significant fields of a state: those on which VDA orders and events depend.

    Position and fractions of the charge are left out.
    """
    power, position = state.power_supply, state.mobile_robot_position
    return (
        state.order_id,
        state.order_update_id,
        state.last_node_id,
        state.last_node_sequence_id,
        # 6.6.2: nodes and edges leave the lists from the front, so the first one tells all of them.
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
        equipment_of(state),
    )


def equipment_of(state: State) -> tuple[object, ...]:
    """Return the load positions and maps of a robot, as far as the dispatcher needs them."""
    return state.loads and tuple(load.load_position for load in state.loads), state.maps
