"""The flow of orders whose robots tell what has become of their missions."""

from __future__ import annotations

from nena_order_service.fleet import (
    ActionRetriable,
    FailureKind,
    InstantActionEnded,
    MissionAccepted,
    MissionCancelled,
    MissionFailed,
    MissionFinished,
    OperationStarted,
)
from nena_order_service.fleet.failures import with_details
from nena_order_service.kernel.action_retries import ActionRetries
from nena_order_service.kernel.failure_flow import Failure, FailureFlow, OrderFlow
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.steps import Steps
from nena_order_service.orders import transport_order
from nena_order_service.orders.transport_order import TransportOrder, why_withdrawn
from nena_order_service.orders.vda_orders import MissionRecord
from nena_order_service.traffic.driving import Driving
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderState
from nena_shared.log import get_logger

log = get_logger(__name__)

BEGUN_MEANWHILE = "the vehicle had begun its operation when it was stopped; look what is done"

MissionNews = MissionAccepted | OperationStarted | MissionFinished | MissionFailed | MissionCancelled


class MissionFlow:
    """Changes orders by what robots do of them, inside of the kernel's steps."""

    def __init__(
        self,
        flow: OrderFlow,
        *,
        book: OrderBook,
        missions: MissionBook,
        driving: Driving,
        failures: FailureFlow,
        registry: VehicleRegistry,
        steps: Steps,
        clock: Clock,
    ) -> None:
        self._flow = flow
        self._book = book
        self._missions = missions
        self._driving = driving
        self._failures = failures
        self._registry = registry
        self._steps = steps
        self._clock = clock
        self._retries = ActionRetries(book, missions, driving, failures, clock)

    def on_mission(self, news: MissionNews) -> None:
        """Take in what has become of a mission."""
        record = self._missions.find(news.mission_id)
        if record is None:
            log.warning(
                "news of a mission that nobody follows", robot=str(news.robot), mission=news.mission_id
            )
            return
        ahead = self._driving.ahead_of(record)
        if isinstance(news, MissionAccepted):
            self._missions.put(record.model_copy(update={"accepted": True}))
        elif isinstance(news, MissionFinished):
            self._driving.finished(record)
        elif isinstance(news, MissionFailed | MissionCancelled):
            self._driving.broken_off(record, news)
        vehicle = self._registry.discover(record.robot)
        self._steps.vehicle_changed(vehicle.name)
        if record.evasion:
            self._evasion(vehicle, news)
        else:
            self._mission(record, news, ahead)

    def on_retriable(self, news: ActionRetriable) -> None:
        """Have a robot try an action again, or let it have failed."""
        self._retries.failed(news)

    def on_instant_action(self, news: InstantActionEnded) -> None:
        """Take notice of the end of what a robot was asked to do about an action."""
        self._retries.answered(news)

    def _evasion(self, vehicle: FleetVehicle, news: MissionNews) -> None:
        if isinstance(news, MissionFailed):
            log.warning("vehicle did not make room", vehicle=vehicle.name, reason=news.reason)
        if isinstance(news, MissionFinished | MissionFailed | MissionCancelled):
            self._flow.dispatch_due = True

    def _mission(self, record: MissionRecord, news: MissionNews, ahead: tuple[str, ...]) -> None:
        number = self._missions.order_number(record.robot)
        assert number is not None, "who has an order's mission works for the order"  # noqa: S101 - for the type
        assert record.drive_order_index is not None, "evasions have none"  # noqa: S101 - for the type
        order, now = self._book.get(number), self._clock.now()
        match news:
            case MissionAccepted():
                pass
            case OperationStarted():
                self._book.put(order.operating(record.drive_order_index, now))
            case MissionFinished():
                self._mission_finished(order, record)
            case MissionFailed():
                words = with_details(news.reason, news.details)
                self._mission_failed(order, Failure(news.kind, words, ahead))
            case MissionCancelled():
                self._mission_cancelled(order, record)

    def _mission_failed(self, order: TransportOrder, failure: Failure) -> None:
        if order.state is TransportOrderState.WITHDRAWN:
            words = f"withdrawn: {why_withdrawn(order.status)}; {failure.words}"
            self._flow.end(order.failed(words, self._clock.now()))
        elif order.held:
            self._flow.go_on(transport_order.failed_while_held(order, failure.words), again=True)
        else:
            self._failures.failed(order, failure)

    def _mission_cancelled(self, order: TransportOrder, record: MissionRecord) -> None:
        """End an order that was withdrawn; one that was held meanwhile waits, or goes on if it is resumed."""
        given_up = self._retries.given_up(record.mission.mission_id)
        if order.state is TransportOrderState.WITHDRAWN:
            words = f"withdrawn: {why_withdrawn(order.status)}; the vehicle has let it go"
            self._flow.end(order.failed(words, self._clock.now()))
        elif given_up and not order.held:
            self._failures.failed(order, given_up)
        elif order.current.state is DriveOrderState.OPERATING and not given_up:
            self._mission_failed(order, Failure(FailureKind.UNCLEAR, BEGUN_MEANWHILE))
        else:
            self._flow.go_on(order, again=True)

    def _mission_finished(self, order: TransportOrder, record: MissionRecord) -> None:
        now, index = self._clock.now(), order.status.current_drive_order_index
        if order.state is TransportOrderState.WITHDRAWN:
            words = f"withdrawn: {why_withdrawn(order.status)}; the vehicle had done what it had been sent"
            self._flow.end(order.failed(words, now))
        elif record.partial:
            self._flow.go_on(order, again=True)
        elif index + 1 == len(order.status.drive_orders):
            self._flow.end(order.drive_order_finished(index, now).finished(now))
        else:
            self._flow.go_on(order.drive_order_finished(index, now))
