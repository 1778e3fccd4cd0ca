"""Choose the next measure of a failure policy.

:func:`decide` is pure: from the policy, the number of measures already taken and the situation, it returns a
measure. Each call uses up at least one step of a finite list, so the measures end, at the latest with FAIL.
:class:`FailureAssessment` determines the situation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from nena_order_service.dispatching.candidates import why_not_accepted
from nena_order_service.engine.context import Context
from nena_order_service.engine.order_knowledge import OrderFit
from nena_order_service.fleet.failures import FailureKind, OrderFailure
from nena_order_service.fleet.position import NotLocatedError
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.vda_order import DROP, PICK
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    DriveOrderStatus,
    FailureMeasure,
    FailurePolicy,
    FailureStep,
)
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.plant import UnknownObjectError

FAIL: Final = FailureStep(do=FailureMeasure.FAIL)

K = FailureKind
R = ReasonCode


@dataclass(frozen=True, slots=True)
class Situation:
    """A failure, and what was known when it happened."""

    kind: FailureKind
    begun: bool = False
    """Whether the operation at the destination is known to have begun."""
    carrying: bool = False
    """Whether the vehicle carries something for the order."""
    others: bool = True
    """Whether another vehicle that is online may and can execute the order."""
    other_way: bool = True
    """Whether there is a route around the position of the failure."""
    online: bool = True
    """Whether the robot is online and reports."""


@dataclass(frozen=True, slots=True)
class Decision:
    """The step of the policy to take, and how many of its measures are then used up.

    ``passed_over`` explains why earlier steps were skipped.
    """

    step: FailureStep
    taken: int
    passed_over: tuple[Reason, ...] = ()


def decide(policy: Sequence[FailureStep], taken: int, situation: Situation) -> Decision:
    """Return the next measure of ``policy``, of which ``taken`` measures are used up."""
    passed_over: list[Reason] = []
    for number, step in enumerate(_one_by_one(policy), start=1):
        if number <= taken:
            continue
        objection = _objection(step, situation)
        if not objection:
            return Decision(step, number, tuple(passed_over))
        words = Reason(R.NO_MEASURE, objection, measure=step.do)
        if words not in passed_over:
            passed_over.append(words)
    return Decision(FAIL, taken, tuple(passed_over))


def _one_by_one(policy: Iterable[FailureStep]) -> Iterator[FailureStep]:
    return (step for step in policy for _ in range(step.times))


def _objection(step: FailureStep, situation: Situation) -> Reason | None:
    """Return why a measure does not apply; None if it does."""
    if step.do.last:
        return None
    if situation.kind is K.UNCLEAR or (situation.kind is K.LOST and situation.begun):
        return Reason(R.UNKNOWN_PROGRESS)
    return _AGAINST[step.do](step, situation)


def _against_retry(step: FailureStep, situation: Situation) -> Reason | None:
    if situation.kind is K.UNFIT:
        return Reason(R.ROBOT_INCAPABLE)
    useless = situation.kind is K.NO_WAY and not step.after
    return Reason(R.STILL_NO_ROUTE) if useless else None


def _against_other_way(_: FailureStep, situation: Situation) -> Reason | None:
    if situation.kind is not K.DRIVE:
        return Reason(R.DRIVE_NOT_FAILED)
    return None if situation.other_way else Reason(R.NO_OTHER_ROUTE)


def _against_other_vehicle(_: FailureStep, situation: Situation) -> Reason | None:
    if situation.carrying:
        return Reason(R.CARRIES_ITS_LOAD)
    if not situation.online:
        return Reason(R.ROBOT_SILENT)
    return None if situation.others else Reason(R.NO_OTHER_VEHICLE)


def _against_skip(_: FailureStep, situation: Situation) -> Reason | None:
    return None if situation.kind is K.ACTION else Reason(R.NO_OPERATION_FAILED)


_AGAINST: Final[Mapping[FailureMeasure, Callable[[FailureStep, Situation], Reason | None]]] = (
    MappingProxyType(
        {
            FailureMeasure.RETRY: _against_retry,
            FailureMeasure.REPLAN: _against_other_way,
            FailureMeasure.OTHER_VEHICLE: _against_other_vehicle,
            FailureMeasure.SKIP: _against_skip,
        }
    )
)


def is_carrying(
    drive_orders: Iterable[DriveOrderStatus],
    *,
    picks: Iterable[str],
    drops: Iterable[str],
    reported: bool | None,
) -> bool:
    """Return whether a vehicle carries something for an order.

    ``picks`` and ``drops`` are the operations that pick up and drop loads. ``reported`` is whether the robot
    reports a load; None if it does not report loads. A pick that has begun counts as done, unless the robot
    reports otherwise; a drop counts as done only once it has finished.
    """
    taking, giving = frozenset(picks), frozenset(drops)
    carrying = False
    for each in drive_orders:
        operation = each.destination.operation
        if operation in taking:
            begun = each.state is DriveOrderState.OPERATING and reported is not False
            carrying = carrying or begun or each.state is DriveOrderState.FINISHED
        elif operation in giving and each.state is DriveOrderState.FINISHED:
            carrying = False
    return carrying or bool(reported)


class FailureAssessment:
    """Chooses the measure for a failed order by its failure policy."""

    def __init__(self, context: Context, fit: OrderFit) -> None:
        self._context = context
        self._fit = fit

    def policy(self, order: TransportOrder) -> FailurePolicy:
        """Return the current failure policy: the destination's, the order's or the default."""
        own = order.current.destination.on_failure
        own = order.status.on_failure if own is None else own
        return self._context.on_failure if own is None else own

    def retries_actions(self, order: TransportOrder) -> bool:
        """Return whether an action that fails may be retried."""
        return any(step.do is FailureMeasure.RETRY for step in self.policy(order))

    def decide(self, order: TransportOrder, failure: OrderFailure) -> Decision:
        """Return the measure for a failure."""
        situation = self._situation(order, failure)
        return decide(self.policy(order), order.current.measures_taken, situation)

    def _situation(self, order: TransportOrder, failure: OrderFailure) -> Situation:
        vehicle = self._vehicle(order)
        view = self._context.view(vehicle)
        loads = view.state.loads if view.state else None
        operations = {each.destination.operation for each in order.status.drive_orders}
        return Situation(
            failure.kind,
            begun=order.current.state is DriveOrderState.OPERATING,
            carrying=is_carrying(
                order.with_operation_begun(),
                picks=[each for each in operations if self._context.planner.action_type(each) == PICK],
                drops=[each for each in operations if self._context.planner.action_type(each) == DROP],
                reported=None if loads is None else bool(loads),
            ),
            others=self._others(order),
            other_way=bool(self.detour(order, failure.ahead)),
            online=view.link is LinkStatus.ONLINE,
        )

    def _others(self, order: TransportOrder) -> bool:
        if order.status.intended_vehicle is not None or order.status.wrapping_sequence is not None:
            return False  # one vehicle executes a whole sequence
        tried = {order.vehicle, *order.status.excluded_vehicles}
        others = map(self._context.registry.named, self._context.registry.names() - tried)
        return any(each and self._may_take_over(order, each) for each in others)

    def _may_take_over(self, order: TransportOrder, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle may and can execute an order without a person at it."""
        level = self._context.state.vehicles.of(vehicle.key).integration_level
        online = self._context.view(vehicle).link is LinkStatus.ONLINE
        if not online or level is not IntegrationLevel.TO_BE_UTILIZED:
            return False
        refusal = why_not_accepted(self._fit.order_types(vehicle), order.status.type)
        return not refusal and self._has_way(order, vehicle)

    def detour(self, order: TransportOrder, ahead: tuple[str, ...]) -> tuple[str, ...]:
        """Return what a detour around the failure avoids: the path and its end point, or only the path."""
        paths = self._context.planner.paths(ahead)
        for avoided in (ahead, paths):
            if paths and self._has_way(order, self._vehicle(order), avoided):
                return avoided
        return ()

    def _has_way(self, order: TransportOrder, vehicle: FleetVehicle, avoided: tuple[str, ...] = ()) -> bool:
        try:
            standing = self._context.planner.standing(vehicle, self._context.view(vehicle))
            self._context.planner.way(order, vehicle, standing, frozenset(avoided))
        except (NotLocatedError, NoRouteError, UnknownObjectError):
            return False
        return True

    def _vehicle(self, order: TransportOrder) -> FleetVehicle:
        vehicle = self._context.registry.named(order.vehicle)
        assert vehicle, "a vehicle with an order is registered"  # noqa: S101 - for the type
        return vehicle


def with_others(words: Reason, decision: Decision) -> Reason:
    """Append why other measures of the policy were skipped."""
    return Reason(R.PASSED_OVER, words, *decision.passed_over) if decision.passed_over else words
