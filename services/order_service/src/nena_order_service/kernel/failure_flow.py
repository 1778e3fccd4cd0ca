"""The flow of orders at which vehicles have failed: what the policy says is done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Protocol

from nena_order_service.fleet import LinkStatus, NotLocatedError, RobotView
from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.mission import DROP, PICK
from nena_order_service.orders import transport_order
from nena_order_service.orders.failure_policy import Decision, Situation, decide, is_carrying
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import MissionPlanner
from nena_order_service.routing import NoRouteError
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    FailureMeasure,
    FailurePolicy,
    FailureStep,
    Hold,
)
from nena_shared.log import get_logger
from nena_shared.plant import UnknownObjectError

log = get_logger(__name__)

POLICY = "failure policy"
"""Who holds an order that a vehicle has failed at."""


@dataclass(frozen=True, slots=True)
class Failure:
    """How a vehicle has failed, in words too; ``ahead`` names the path and the point that come next."""

    kind: FailureKind
    words: str
    ahead: tuple[str, ...] = ()


class OrderFlow(Protocol):
    """What can be done with an order of a vehicle."""

    dispatch_due: bool
    """Whether a vehicle or an order may have become free."""

    def end(self, order: TransportOrder) -> None:
        """Let it be at its end."""
        ...

    def go_on(self, order: TransportOrder, *, again: bool = False) -> None:
        """Drive to the current destination, ``again`` or for the first time, unless the order has to wait."""
        ...

    def give_to_another(self, order: TransportOrder) -> None:
        """Let it wait for another vehicle."""
        ...

    def as_conditions_are(self, order: TransportOrder) -> TransportOrder:
        """Give an order that waits, or may be dispatched, as it is with what it waits for."""
        ...


class FailureFlow:
    """Takes measures, inside of the kernel's steps."""

    def __init__(
        self,
        flow: OrderFlow,
        *,
        policy: FailurePolicy,
        registry: VehicleRegistry,
        planner: MissionPlanner,
        clock: Clock,
        view: Callable[[FleetVehicle], RobotView],
    ) -> None:
        self._flow = flow
        self._policy = policy
        self._registry = registry
        self._planner = planner
        self._clock = clock
        self._view = view

    def policy(self, order: TransportOrder) -> FailurePolicy:
        """Give the policy for where an order is: the destination's, the order's or the setting's."""
        own = order.current.destination.on_failure
        own = order.status.on_failure if own is None else own
        return self._policy if own is None else own

    def retries_actions(self, order: TransportOrder) -> bool:
        """Tell whether an action that fails may be tried again."""
        return any(step.do is FailureMeasure.RETRY for step in self.policy(order))

    def decide(self, order: TransportOrder, failure: Failure) -> Decision:
        """Say what is done about a failure."""
        situation = self._situation(order, failure)
        return decide(self.policy(order), order.current.measures_taken, situation)

    def failed(self, order: TransportOrder, failure: Failure) -> None:
        """Do what the policy says about an order whose vehicle has failed."""
        if self._registry.employed(order.vehicle) is None:
            why = f"there is no vehicle {order.vehicle!r} any more; {failure.words}"
            self._flow.end(order.failed(why, self._clock.now()))
            return
        decision = self.decide(order, failure)
        step, words = decision.step, failure.words
        log.info("measure taken", order=order.name, measure=step.do, kind=failure.kind, reason=words)
        now = self._clock.now()
        match step.do:
            case FailureMeasure.RETRY:
                order = transport_order.retried(
                    order, decision.taken, words, now=now, next_try=self._at(step)
                )
                self._flow.go_on(order, again=True)
            case FailureMeasure.REPLAN:
                self._replan(order, decision, failure)
            case FailureMeasure.OTHER_VEHICLE:
                self._flow.give_to_another(transport_order.reassigned(order, decision.taken, words, now))
            case FailureMeasure.SKIP:
                self._skip(transport_order.skipped(order, words, now))
            case FailureMeasure.HOLD:
                hold = Hold(by=POLICY, reason=_with_others(words, decision), since=now)
                self._flow.go_on(transport_order.held(order, hold, now), again=True)
            case FailureMeasure.FAIL:
                self._flow.end(order.failed(_with_others(words, decision), now))

    def _replan(self, order: TransportOrder, decision: Decision, failure: Failure) -> None:
        avoided = self._detour(order, failure.ahead)
        order = transport_order.replanned(
            order,
            decision.taken,
            failure.words,
            now=self._clock.now(),
            avoided=avoided,
            next_try=self._at(decision.step),
        )
        self._flow.go_on(order, again=True)

    def _skip(self, order: TransportOrder) -> None:
        if order.current.state is DriveOrderState.TRAVELLING:
            self._flow.go_on(order)
        else:
            self._flow.end(order.finished(self._clock.now()))

    def _at(self, step: FailureStep) -> datetime | None:
        return self._clock.now() + timedelta(seconds=step.after) if step.after else None

    def _situation(self, order: TransportOrder, failure: Failure) -> Situation:
        vehicle = self._vehicle(order)
        view = self._view(vehicle)
        loads = view.state.loads if view.state else None
        operations = {each.destination.operation for each in order.status.drive_orders}
        return Situation(
            failure.kind,
            begun=order.current.state is DriveOrderState.OPERATING,
            carrying=is_carrying(
                transport_order.with_operation_begun(order),
                picks=[each for each in operations if self._planner.action_type(each) == PICK],
                drops=[each for each in operations if self._planner.action_type(each) == DROP],
                reported=None if loads is None else bool(loads),
            ),
            others=self._others(order),
            other_way=bool(self._detour(order, failure.ahead)),
            heard=view.link is LinkStatus.ONLINE,
        )

    def _others(self, order: TransportOrder) -> bool:
        if order.status.intended_vehicle is not None or order.status.wrapping_sequence is not None:
            return False  # a sequence is done by one vehicle to its end
        tried = {order.vehicle, *order.status.excluded_vehicles}
        return bool(self._registry.names() - tried)

    def _detour(self, order: TransportOrder, ahead: tuple[str, ...]) -> tuple[str, ...]:
        """Give what a way around where the vehicle failed avoids: the point there too, if that can be."""
        paths = self._planner.paths(ahead)
        for avoided in (ahead, paths):
            if paths and self._leads_on(order, avoided):
                return avoided
        return ()

    def _leads_on(self, order: TransportOrder, avoided: tuple[str, ...]) -> bool:
        vehicle = self._vehicle(order)
        try:
            standing = self._planner.standing(vehicle, self._view(vehicle))
            self._planner.way(order, vehicle, standing, frozenset(avoided))
        except (NotLocatedError, NoRouteError, UnknownObjectError):
            return False
        return True

    def _vehicle(self, order: TransportOrder) -> FleetVehicle:
        vehicle = self._registry.named(order.vehicle)
        assert vehicle, "who has an order is in the registry"  # noqa: S101 - for the type
        return vehicle


def _with_others(words: str, decision: Decision) -> str:
    """Add why other measures of the policy were not taken."""
    return f"{words} ({'; '.join(decision.passed_over)})" if decision.passed_over else words
