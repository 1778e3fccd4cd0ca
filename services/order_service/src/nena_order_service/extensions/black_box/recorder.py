"""The decisions of the order service, with their reasons."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Final

from nena_order_service.fleet import outputs
from nena_order_service.orders.transport_order import EventCode
from nena_shared.clock import Clock
from nena_shared.extensions.black_box.box import BlackBox
from nena_shared.extensions.black_box.ring import Channel
from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.vda5050.state import EmergencyStop, State
from nena_shared.vda5050.topics import RobotKey, Topic

ORDERS: Final = Channel("/nena/orders")
DISPATCH: Final = Channel("/nena/dispatch")
ROUTING: Final = Channel("/nena/routing")
TRAFFIC: Final = Channel("/nena/traffic")
WITHDRAWAL: Final = Channel("/nena/withdrawal")
DELIVERY: Final = Channel("/nena/delivery")
CHANNELS: Final[Mapping[str, Channel]] = {
    EventCode.DISPATCHING_DEFERRED: DISPATCH,
    EventCode.ASSIGNED_TO_VEHICLE: DISPATCH,
    EventCode.REASSIGNED: DISPATCH,
    EventCode.INTENDED_VEHICLE_CHANGED: DISPATCH,
    EventCode.REROUTED: ROUTING,
    EventCode.REPLANNED: ROUTING,
    EventCode.WITHDRAWAL_REQUESTED: WITHDRAWAL,
}
"""Topics of events of orders; all others belong to :data:`ORDERS`."""

NODE_ID: Final = attrgetter("node_id")
RELEASED: Final = attrgetter("released")

ORDER_FAILED: Final = "order-failed"
EMERGENCY_STOP: Final = "emergency-stop"
STOP: Final = "stop"
"""Reasons of recordings, besides :data:`nena_shared.extensions.black_box.box.REQUEST`."""


@dataclass(frozen=True, slots=True)
class _RecordedOrder:
    """What was last recorded of an order."""

    status: TransportOrderStatus
    route: tuple[str, ...] | None


class DecisionRecorder:
    """Listens to the engine and to fleet control; a failed order or a stop starts a recording."""

    def __init__(self, box: BlackBox, clock: Clock, state_of: Callable[[RobotKey], State | None]) -> None:
        """Record into ``box``; ``state_of`` returns the last state of a robot."""
        self._box = box
        self._clock = clock
        self._state_of = state_of
        self._since = clock.now()
        self._orders: dict[str, _RecordedOrder] = {}
        """Unfinished orders."""
        self._vehicles: dict[str, VehicleStatus] = {}
        self._stopped: dict[RobotKey, bool] = {}
        """Whether each robot has an active emergency stop."""

    # Changes of the engine

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Record what has happened to an order, and its new route."""
        last = self._orders.pop(status.name, None)
        history = status.history
        if last:
            recorded = last.status.history
            # The engine replaces the last entry if dispatching is deferred again for another reason.
            unchanged = bool(recorded) and history[len(recorded) - 1] is recorded[-1]
            entries = history[len(recorded) if unchanged else max(len(recorded) - 1, 0) :]
        else:
            # After a restart, the first status brings the history of the previous run too.
            entries = tuple(entry for entry in history if entry.timestamp >= self._since)
        about: dict[str, object] = {
            "order": status.name,
            "state": status.state,
            "vehicle": status.processing_vehicle,
        }
        for entry in entries:
            about |= {"event": entry.event_code, "explanation": entry.supplements}
            self._add_decision(CHANNELS.get(entry.event_code, ORDERS), about | {"reason": status.reason})
        if not entries and last and last.status.reason != status.reason:
            self._add_decision(ORDERS, about | {"reason": status.reason})
        route = self._record_route(status, last.route if last else None)
        if not status.state.final:
            self._orders[status.name] = _RecordedOrder(status, route)
        elif status.outcome is OrderOutcome.UNROUTABLE or (
            status.outcome is OrderOutcome.FAILED and status.processing_vehicle
        ):
            self._box.fail(ORDER_FAILED)

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Record what a vehicle waits for, what stops it, and why it has no order."""
        last = self._vehicles.get(status.name)
        self._vehicles[status.name] = status
        wait, stop = (last.wait, last.stop) if last else (None, None)
        traffic = status.wait != wait or status.stop != stop
        idle = not status.transport_order and (last is None or last.reason != status.reason)
        if not (traffic or idle):
            return
        about = {"vehicle": status.name, "order": status.transport_order, "reason": status.reason}
        if traffic:
            self._add_decision(TRAFFIC, about | {"wait": status.wait, "stop": status.stop})
        if idle:
            self._add_decision(DISPATCH, about | {"connection": status.connection})
        # Without an earlier status, the stop may be from before the start.
        if status.stop and not stop and last:
            self._box.fail(STOP)

    # Events of fleet control

    def published(self, topic: Topic, output: outputs.Publish) -> None:
        """Record a VDA order that was sent, with the part that the vehicle holds, or instant actions."""
        match output:
            case outputs.PublishOrder(robot, order, update):
                nodes, released = tuple(map(NODE_ID, order.nodes)), sum(map(RELEASED, order.nodes))
                values: Mapping[str, object] = {
                    "orderId": order.order_id,
                    "orderUpdateId": update,
                    "base": nodes[:released],
                    "horizon": nodes[released:],
                }
            case outputs.PublishInstantActions(robot, actions):
                values = {"actions": [action.action_type for action in actions]}
            case _:
                return
        self._add_event(robot, f"{topic}Sent", values)

    def happened(self, event: outputs.FleetOutput) -> None:
        """Record how a VDA order or an action went on; notice emergency stops."""
        match event:
            case outputs.RobotChanged(robot):
                # 0061: states are not recorded; those of a thousand robots would fill the memory in seconds.
                self._look_for_stop(robot)
            case outputs.VdaOrderFailed(robot, order_id, reason, details):
                failure = {"orderId": order_id, "reason": str(reason), "details": details, "kind": event.kind}
                self._add_event(robot, "orderFailed", failure)
            case outputs.VdaOrderAccepted(robot, order_id):
                self._add_event(robot, "orderAccepted", {"orderId": order_id})
            case outputs.VdaOrderFinished(robot, order_id):
                self._add_event(robot, "orderFinished", {"orderId": order_id})
            case outputs.VdaOrderCancelled(robot, order_id):
                self._add_event(robot, "orderCancelled", {"orderId": order_id})
            case outputs.InstantActionEnded(robot, action, status, reason):
                values = {"actions": [action.action_type], "status": status, "reason": str(reason)}
                self._add_event(robot, "instantActionEnded", values)
            case _:
                pass

    def _look_for_stop(self, robot: RobotKey) -> None:
        state = self._state_of(robot)
        if state is None:
            return
        stop = state.safety_state.active_emergency_stop
        was_stopped, stopped = self._stopped.get(robot), stop is not EmergencyStop.NONE
        self._stopped[robot] = stopped
        if stopped is (was_stopped or False):
            return
        self._add_decision(TRAFFIC, {"robot": str(robot), "emergencyStop": stop})
        if stopped and was_stopped is not None:  # the first state may show a stop from before the start
            self._box.fail(EMERGENCY_STOP)

    def _record_route(
        self, status: TransportOrderStatus, last: tuple[str, ...] | None
    ) -> tuple[str, ...] | None:
        """Record the route to the current destination if it is a new one; return it."""
        index = status.current_drive_order_index
        if index < 0:
            return None
        current = status.drive_orders[index]
        if current.route and current.route != last and not status.state.final:
            route = {"destination": index + 1, "route": current.route, "avoided": current.avoided}
            self._add_decision(ROUTING, {"order": status.name, "vehicle": status.processing_vehicle, **route})
        return current.route

    def _add_event(self, robot: RobotKey, event: str, values: Mapping[str, object]) -> None:
        self._add_decision(DELIVERY, {"robot": str(robot), "event": event, **values})

    def _add_decision(self, channel: Channel, decision: Mapping[str, object]) -> None:
        """Record a decision; fields without a value are left out of the file."""
        self._box.ring.add(channel, decision, self._clock.monotonic())
