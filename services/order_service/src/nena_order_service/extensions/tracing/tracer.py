"""Spans of transport orders and VDA orders, from committed changes and from events of fleet control.

IDs are derived from names and a transport order's span is built from its history, so traces need no store.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final

from nena_order_service.fleet import outputs
from nena_order_service.orders.transport_order import EventCode, TransportOrder
from nena_shared.clock import Clock
from nena_shared.extensions.tracing import (
    EVENTS_LIMIT,
    AttributeValue,
    Export,
    Span,
    SpanEvent,
    TraceContext,
    cut,
    new_span_id,
    order_name_of,
    order_span_id,
    trace_id_of,
    vda_order_span_id,
)
from nena_shared.fleet_api.transport_order import HistoryEntry, TransportOrderState, TransportOrderStatus
from nena_shared.vda5050.topics import RobotKey

PLANNED_AFTER: Final = frozenset(
    {
        EventCode.ASSIGNED_TO_VEHICLE,
        EventCode.DRIVE_ORDER_FINISHED,
        EventCode.RESUMED,
        EventCode.RETRIED,
        EventCode.REPLANNED,
        EventCode.SKIPPED,
        EventCode.ADOPTED_AFTER_RESTART,
    }
)
"""Events after which the next VDA order is planned."""
RUNNING_LIMIT: Final = 10_000
"""Maximum number of VDA orders whose end is awaited; beyond it, the oldest is forgotten."""


def order_spans(status: TransportOrderStatus) -> Iterator[Span]:
    """Yield the span of an ended transport order, and one for each wait for a vehicle."""
    yield Span(
        name="transport order",
        trace_id=trace_id_of(status.name),
        span_id=order_span_id(status.name),
        parent_id=None,
        begin=status.created,
        end=status.finished or status.history[-1].timestamp,
        attributes={
            "nena.transport_order": status.name,
            "nena.state": status.state.value,
            "nena.reason": cut(status.reason),
            "nena.type": status.type,
            "nena.vehicle": status.processing_vehicle or "",
            "nena.destinations": len(status.drive_orders),
            "nena.automatic": status.automatic,
            "nena.late": status.late,
        },
        events=tuple(map(_event_of, status.history[-EVENTS_LIMIT:])),
        # 0060: as the parent, it would decide the trace ID, which the robot could not derive.
        link=TraceContext.of(status.traceparent),
        error="" if status.state is TransportOrderState.FINISHED else cut(status.reason),
    )
    waits_since = status.created
    for entry in status.history:
        if entry.event_code == EventCode.ASSIGNED_TO_VEHICLE:
            vehicle, *why = entry.supplements or ("",)
            attributes: dict[str, AttributeValue] = {
                "nena.vehicle": vehicle,
                "nena.reason": cut(" ".join(why)),
            }
            yield part_of_order("dispatch", status.name, waits_since, entry.timestamp, attributes)
        elif entry.event_code == EventCode.REASSIGNED:
            waits_since = entry.timestamp


def part_of_order(
    name: str, order: str, begin: datetime, end: datetime, attributes: dict[str, AttributeValue] | None = None
) -> Span:
    """Return a child of a transport order's span."""
    attributes = {"nena.transport_order": order, **(attributes or {})}
    return Span(name, trace_id_of(order), new_span_id(), order_span_id(order), begin, end, attributes)


def _event_of(entry: HistoryEntry) -> SpanEvent:
    reason = cut(" ".join(entry.supplements))
    return SpanEvent(entry.event_code, entry.timestamp, {"nena.reason": reason} if reason else {})


@dataclass(slots=True)
class _FollowedOrder:
    """A VDA order that has not ended."""

    begin: datetime
    restored: bool
    sent: datetime | None = None
    accepted: bool = False
    messages: int = 0
    events: list[SpanEvent] = field(default_factory=list)


class OrderTracer:
    """Listens to the engine and to fleet control, and exports a span for each ended piece of work."""

    def __init__(self, find: Callable[[str], TransportOrder | None], clock: Clock, export: Export) -> None:
        """``find`` returns a transport order by its name, as long as it is in memory."""
        self._find = find
        self._clock = clock
        self._export = export
        self._since = clock.now()
        self._created: set[str] = set()
        """Unfinished orders whose creation has been exported."""
        self._running: dict[str, _FollowedOrder] = {}

    # Changes of the engine

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Export the creation of a new order, and the whole of an ended one."""
        # Orders from before the start were exported by the previous run.
        if status.created >= self._since and status.name not in self._created:
            self._created.add(status.name)
            self._export(part_of_order("create order", status.name, status.created, self._clock.now()))
        if status.state.final:
            self._created.discard(status.name)
            for span in order_spans(status):
                self._export(span)

    # Events of fleet control

    def begun(self, order_id: str, *, restored: bool) -> None:
        """Export the planning of a VDA order that is to be sent."""
        moment, order = self._clock.now(), self._find(order_name_of(order_id))
        self._running[order_id] = _FollowedOrder(moment, restored)
        if len(self._running) > RUNNING_LIMIT:
            del self._running[next(iter(self._running))]
        if order is None or restored:
            return
        starts = [entry.timestamp for entry in order.status.history if entry.event_code in PLANNED_AFTER]
        if starts:
            attributes: dict[str, AttributeValue] = {"vda5050.order_id": order_id}
            self._export(part_of_order("plan", order.name, starts[-1], moment, attributes))

    def published(self, output: outputs.Publish) -> None:
        """Note that an order or an update was sent."""
        if not isinstance(output, outputs.PublishOrder):
            return
        execution = self._running.get(output.vda_order.order_id)
        if execution:
            execution.sent = execution.sent or self._clock.now()
            execution.messages += 1
            self._add_event(execution, "vda5050.orderSent", order_update_id=output.order_update_id)

    def happened(self, event: outputs.FleetOutput) -> None:
        """Note an event of a VDA order; export its span once it has ended."""
        match event:
            case outputs.VdaOrderAccepted(order_id=order_id) if execution := self._running.get(order_id):
                self._export_delivery(order_id, execution)
            case outputs.NodePassed(order_id=order_id, node_id=node) if execution := self._running.get(
                order_id
            ):
                self._add_event(execution, "vda5050.nodePassed", node_id=node)
            case outputs.OperationStarted(order_id=order_id) if execution := self._running.get(order_id):
                self._add_event(execution, "vda5050.operationStarted")
            case outputs.VdaOrderFinished(robot, order_id):
                self._export_execution(robot, order_id, "finished")
            case outputs.VdaOrderCancelled(robot, order_id):
                self._export_execution(robot, order_id, "cancelled")
            case outputs.VdaOrderFailed(robot, order_id, reason):
                self._export_execution(robot, order_id, "failed", error=cut(str(reason)))
            case _:
                pass

    def _add_event(self, execution: _FollowedOrder, name: str, **attributes: AttributeValue) -> None:
        if len(execution.events) < EVENTS_LIMIT:
            prefixed = {f"vda5050.{key}": value for key, value in attributes.items()}
            execution.events.append(SpanEvent(name, self._clock.now(), prefixed))

    def _export_delivery(self, order_id: str, execution: _FollowedOrder) -> None:
        self._add_event(execution, "vda5050.orderAccepted")
        # Updates are accepted too; only the first acceptance is the delivery of the order.
        if execution.sent and not execution.accepted:
            trace, parent = trace_id_of(order_name_of(order_id)), vda_order_span_id(order_id)
            attributes: dict[str, AttributeValue] = {
                "vda5050.order_id": order_id,
                "nena.messages": execution.messages,
            }
            delivered = self._clock.now()
            self._export(Span("deliver", trace, new_span_id(), parent, execution.sent, delivered, attributes))
        execution.accepted = True

    def _export_execution(self, robot: RobotKey, order_id: str, outcome: str, *, error: str = "") -> None:
        execution = self._running.pop(order_id, None)
        if execution is None:
            return
        name = order_name_of(order_id)
        serves_order = self._find(name) is not None  # otherwise, it makes room for others
        self._export(
            Span(
                name="VDA 5050 order",
                trace_id=trace_id_of(name),
                span_id=vda_order_span_id(order_id),
                parent_id=order_span_id(name) if serves_order else None,
                begin=execution.begin,
                end=self._clock.now(),
                attributes={
                    "vda5050.order_id": order_id,
                    "vda5050.manufacturer": robot.manufacturer,
                    "vda5050.serial_number": robot.serial_number,
                    "nena.outcome": outcome,
                    "nena.messages": execution.messages,
                    "nena.restored": execution.restored,
                },
                events=tuple(execution.events),
                error=error,
            )
        )
