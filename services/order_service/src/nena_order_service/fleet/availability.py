"""Whether a robot can be sent an order, with the reason in words, and how openTCS would call its state."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from nena_order_service.fleet import reported_errors
from nena_order_service.fleet.progress import is_idle
from nena_order_service.fleet.reported import State
from nena_order_service.fleet.view import LinkStatus
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.vda5050.state import EmergencyStop

LINK_REASONS: Final = {
    LinkStatus.UNKNOWN: "has never been heard of",
    LinkStatus.OFFLINE: "is offline: it has signed off from the broker",
    LinkStatus.HIBERNATING: "is hibernating",
    LinkStatus.CONNECTION_BROKEN: "has lost its connection to the broker",
    LinkStatus.SILENT: "is silent: it has not reported its state for too long",
}


def away(link: LinkStatus, *, broker: bool) -> str | None:
    """Say why the robot cannot be reached; None if it can."""
    if not broker:
        return "cannot be reached: the order service has no connection to the MQTT broker"
    return LINK_REASONS.get(link)


def occupied(state: State, instant_ids: Collection[str]) -> str | None:
    """Say what keeps a robot that can be reached from taking a new order (section 6.6.8); None if nothing."""
    if not state.operating_mode.takes_orders:
        return f"is in operating mode {state.operating_mode}, which takes no orders"
    if not is_idle(state, instant_ids):
        return f"still works on the order {state.order_id!r}"
    return None


def unfit(state: State) -> str | None:
    """Say why a free robot would refuse an order or could not drive it; None if it could."""
    error = reported_errors.fatal(state.errors)
    if error is not None:
        return f"has a fatal error: {reported_errors.in_words(error)}"
    if waiting := _without_navigation(state):
        return waiting
    position = state.mobile_robot_position
    lost = position is not None and not position.localized
    return "does not know where it is: set its initial position" if lost else None


def hindered(state: State) -> str | None:
    """Say what keeps a robot from driving now, though it takes orders; None if nothing."""
    if state.safety_state.active_emergency_stop is not EmergencyStop.NONE:
        return "has an active emergency stop"
    return "is paused" if state.paused else _without_navigation(state)


def _without_navigation(state: State) -> str | None:
    waiting = reported_errors.no_navigation(state.errors)
    return f"waits: {reported_errors.in_words(waiting)}" if waiting else None


def vehicle_state(state: State | None, link: LinkStatus, instant_ids: Collection[str]) -> VehicleState:
    """Give the state in openTCS's words; UNKNOWN is a robot that does not tell."""
    if state is None or link is not LinkStatus.ONLINE:
        return VehicleState.UNKNOWN
    if reported_errors.fatal(state.errors) is not None:
        return VehicleState.ERROR
    if not state.operating_mode.takes_orders:
        return VehicleState.UNAVAILABLE
    if not is_idle(state, instant_ids):
        return VehicleState.EXECUTING
    return VehicleState.CHARGING if state.power_supply.charging else VehicleState.IDLE
