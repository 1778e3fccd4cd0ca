"""Actions that have failed and may be tried again at the robot (VDA 5050 3.0 sections 6.2.3 and 6.6.9)."""

from __future__ import annotations

from nena_order_service.fleet import ActionRetriable, FailureKind, InstantActionEnded, retry_or_skip
from nena_order_service.fleet.failures import with_details
from nena_order_service.fleet.mission import fresh_id
from nena_order_service.kernel.failure_flow import Failure, FailureFlow
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.orders import transport_order
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.traffic.driving import Driving
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import FailureMeasure, TransportOrderState
from nena_shared.log import get_logger
from nena_shared.vda5050.action import ActionStatus

log = get_logger(__name__)


class ActionRetries:
    """Answers robots that wait with a RETRIABLE action, with ``retry`` or ``skipRetry``.

    ``retry`` where the policy says that it is tried again at once; else ``skipRetry``: the mission fails by
    that, as with robots that know no retry, and the policy goes on. The mission of a robot that takes neither
    is cancelled.
    """

    def __init__(
        self,
        book: OrderBook,
        missions: MissionBook,
        driving: Driving,
        failures: FailureFlow,
        clock: Clock,
    ) -> None:
        self._book = book
        self._missions = missions
        self._driving = driving
        self._failures = failures
        self._clock = clock
        self._asked: dict[str, tuple[str, str]] = {}
        """Missions and words of failures, by the ids of the instant actions that robots were sent."""
        self._given_up: dict[str, Failure] = {}
        """The failures for which missions are cancelled, by the missions' ids."""

    def failed(self, news: ActionRetriable) -> None:
        """Answer a robot whose action has failed."""
        record = self._missions.find(news.mission_id)
        number = self._missions.order_number(news.robot)
        if record is None or record.cancelled or record.evasion or number is None:
            return
        words = with_details(news.reason, news.details)
        retry = self._is_tried_again(self._book.get(number), words)
        action = retry_or_skip(fresh_id(), news.action_id, retry=retry)
        self._asked[action.action_id] = news.mission_id, words
        log.info("action has failed", mission=news.mission_id, answer=action.action_type, reason=words)
        self._driving.instruct(record, action)

    def _is_tried_again(self, order: TransportOrder, words: str) -> bool:
        if order.held or order.state is not TransportOrderState.BEING_PROCESSED:
            return False
        decision = self._failures.decide(order, Failure(FailureKind.ACTION, words))
        if decision.step.do is not FailureMeasure.RETRY or decision.step.after:
            return False
        self._book.put(transport_order.retried(order, decision.taken, words, now=self._clock.now()))
        return True

    def answered(self, news: InstantActionEnded) -> None:
        """Cancel the mission of a robot that did not take the answer."""
        name, words = self._asked.pop(news.action.action_id, ("", ""))
        record = self._missions.find(name)
        if record and not record.cancelled and news.status is not ActionStatus.FINISHED:
            log.warning("robot takes no answer to its failed action", mission=name, reason=news.reason)
            known = news.status is ActionStatus.FAILED  # else it may be trying again right now
            self._given_up[name] = Failure(FailureKind.ACTION if known else FailureKind.UNCLEAR, words)
            self._driving.cancel(record)

    def given_up(self, mission_id: str) -> Failure | None:
        """Give, once, the failure for which a mission was cancelled; None where it was for another reason."""
        return self._given_up.pop(mission_id, None)
