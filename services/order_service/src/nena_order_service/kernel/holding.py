"""Holding orders, and letting them go on."""

from __future__ import annotations

from nena_order_service.kernel.failure_flow import OrderFlow
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.orders import transport_order
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.traffic.driving import Driving, Pauses
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import DriveOrderState, Hold, TransportOrderState
from nena_shared.log import get_logger

log = get_logger(__name__)


class Holding:
    """Lets orders wait until a person resumes them, inside of the kernel's steps."""

    def __init__(
        self,
        flow: OrderFlow,
        *,
        book: OrderBook,
        missions: MissionBook,
        driving: Driving,
        pauses: Pauses,
        registry: VehicleRegistry,
        clock: Clock,
    ) -> None:
        self._flow = flow
        self._book = book
        self._missions = missions
        self._driving = driving
        self._pauses = pauses
        self._registry = registry
        self._clock = clock

    def hold(self, order: TransportOrder, by: str, reason: str, *, immediate: bool) -> None:
        """Let an order wait; one that is held already is held by whom it was, and may only stop sooner.

        Who has it keeps it. Its robot is told to cancel where that is to be ``immediate``, else it drives on
        to the end of what it was given. An operation that has begun is done to its end in either case.
        """
        now = self._clock.now()
        if not order.held:
            order = transport_order.held(order, Hold(by=by, reason=reason, since=now), now)
            self._book.put(order)
            log.info("order held", order=order.name, by=by, reason=reason)
        if order.state is TransportOrderState.BEING_PROCESSED:
            self._stop(order, immediate=immediate)
        self._flow.dispatch_due = True

    def resume(self, order: TransportOrder, by: str, reason: str) -> None:
        """Let a held order go on from where its vehicle stands; one that nobody holds goes on anyway."""
        if order.held:
            resumed = transport_order.resumed(order, by, reason, self._clock.now())
            self._book.put(self._flow.as_conditions_are(resumed))
            log.info("order resumed", order=order.name, by=by, reason=reason)
            self._flow.dispatch_due = True

    def _stop(self, order: TransportOrder, *, immediate: bool) -> None:
        vehicle, record = self._registry.named(order.vehicle), self._missions.of_order(order)
        assert vehicle, "who has an order is in the registry"  # noqa: S101 - for the type
        if record is None:
            self._driving.abandon(vehicle)
            self._pauses.begin(vehicle, order)
        elif order.current.state is DriveOrderState.OPERATING:
            return
        elif immediate and not record.cancelled:
            self._driving.cancel(record)
        elif not immediate:
            self._driving.end_early(record, partial=True)
