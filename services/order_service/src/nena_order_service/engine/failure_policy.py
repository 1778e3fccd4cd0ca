"""Choose the next measure of a failure policy.

:func:`decide` is pure: from the policy, the number of measures already taken and the situation, it returns a
measure. Each call uses up at least one step of a finite list, so the measures end, at the latest with FAIL.
:class:`FailureAssessment` determines the situation.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
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
    single_steps = (step for step in policy for _ in range(step.times))
    for number, step in enumerate(single_steps, start=1):
        if number <= taken:
            continue
        objection = _objection_to(step, situation)
        if not objection:
            return Decision(step, number, tuple(passed_over))
        reason = Reason(R.NO_MEASURE, objection, measure=step.do)
        if reason not in passed_over:
            passed_over.append(reason)
    return Decision(FAIL, taken, tuple(passed_over))


def _objection_to(step: FailureStep, situation: Situation) -> Reason | None:
    """Return why a measure does not apply; None if it does."""
    if step.do.last:
        return None
    # An operation that may have been executed must not be executed again without a person looking at it.
    if situation.kind is K.UNCLEAR or (situation.kind is K.LOST and situation.begun):
        return Reason(R.UNKNOWN_PROGRESS)
    # For each measure, in the order in which they are named: the conditions under which it makes no sense.
    objections: Mapping[FailureMeasure, Sequence[tuple[bool, ReasonCode]]] = {
        FailureMeasure.RETRY: (
            (situation.kind is K.UNFIT, R.ROBOT_INCAPABLE),
            (situation.kind is K.NO_WAY and not step.after, R.STILL_NO_ROUTE),
        ),
        FailureMeasure.REPLAN: (
            (situation.kind is not K.DRIVE, R.DRIVE_NOT_FAILED),
            (not situation.other_way, R.NO_OTHER_ROUTE),
        ),
        FailureMeasure.OTHER_VEHICLE: (
            (situation.carrying, R.CARRIES_ITS_LOAD),
            (not situation.online, R.ROBOT_SILENT),
            (not situation.others, R.NO_OTHER_VEHICLE),
        ),
        FailureMeasure.SKIP: ((situation.kind is not K.ACTION, R.NO_OPERATION_FAILED),),
    }
    return next((Reason(code) for applies, code in objections[step.do] if applies), None)


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
    pick_operations, drop_operations = frozenset(picks), frozenset(drops)
    carrying = False
    for drive_order in drive_orders:
        operation = drive_order.destination.operation
        is_finished = drive_order.state is DriveOrderState.FINISHED
        if operation in pick_operations:
            has_begun = drive_order.state is DriveOrderState.OPERATING and reported is not False
            carrying = carrying or has_begun or is_finished
        elif operation in drop_operations and is_finished:
            carrying = False
    return carrying or bool(reported)


class FailureAssessment:
    """Chooses the measure for a failed order by its failure policy."""

    def __init__(self, context: Context, fit: OrderFit) -> None:
        self._context = context
        self._fit = fit

    def policy_of(self, order: TransportOrder) -> FailurePolicy:
        """Return the current failure policy: the destination's, the order's or the default."""
        policies = order.current.destination.on_failure, order.status.on_failure
        # An empty policy is one, too: it lets the order fail at once.
        return next((policy for policy in policies if policy is not None), self._context.on_failure)

    def retries_actions(self, order: TransportOrder) -> bool:
        """Return whether an action that fails may be retried."""
        return any(step.do is FailureMeasure.RETRY for step in self.policy_of(order))

    def decide(self, order: TransportOrder, failure: OrderFailure) -> Decision:
        """Return the measure for a failure."""
        view = self._context.view(self._vehicle_of(order))
        loads = view.state.loads if view.state else None
        action_type = self._context.planner.action_type
        operations = {drive_order.destination.operation for drive_order in order.status.drive_orders}
        situation = Situation(
            failure.kind,
            begun=order.current.state is DriveOrderState.OPERATING,
            carrying=is_carrying(
                order.with_operation_begun(),
                picks=[operation for operation in operations if action_type(operation) == PICK],
                drops=[operation for operation in operations if action_type(operation) == DROP],
                reported=None if loads is None else bool(loads),
            ),
            others=self._can_other_take_over(order),
            other_way=bool(self.detour_of(order, failure.ahead)),
            online=view.link is LinkStatus.ONLINE,
        )
        return decide(self.policy_of(order), order.current.measures_taken, situation)

    def _can_other_take_over(self, order: TransportOrder) -> bool:
        """Return whether another vehicle may and can execute an order without a person at it."""
        if order.status.intended_vehicle is not None or order.status.wrapping_sequence is not None:
            return False  # one vehicle executes a whole sequence
        tried = {order.vehicle, *order.status.excluded_vehicles}
        others = map(self._context.registry.named, self._context.registry.names() - tried)
        return any(
            vehicle
            and self._context.view(vehicle).link is LinkStatus.ONLINE
            and self._context.state.vehicles.of(vehicle.key).integration_level
            is IntegrationLevel.TO_BE_UTILIZED
            and not why_not_accepted(self._fit.order_types(vehicle), order.status.type)
            and self._has_route(order, vehicle)
            for vehicle in others
        )

    def detour_of(self, order: TransportOrder, ahead: tuple[str, ...]) -> tuple[str, ...]:
        """Return what a detour around the failure avoids: the path and its end point, or only the path."""
        paths = self._context.planner.paths(ahead)
        for avoided in (ahead, paths):  # only the path, if the destination is behind the point
            if paths and self._has_route(order, self._vehicle_of(order), avoided):
                return avoided
        return ()

    def _has_route(self, order: TransportOrder, vehicle: FleetVehicle, avoided: tuple[str, ...] = ()) -> bool:
        try:
            standing = self._context.planner.standing(vehicle, self._context.view(vehicle))
            self._context.planner.way(order, vehicle, standing, frozenset(avoided))
        except (NotLocatedError, NoRouteError, UnknownObjectError):
            return False
        return True

    def _vehicle_of(self, order: TransportOrder) -> FleetVehicle:
        vehicle = self._context.registry.named(order.vehicle)
        assert vehicle, "a vehicle with an order is registered"  # noqa: S101 - for the type
        return vehicle


def with_passed_over(reason: Reason, decision: Decision) -> Reason:
    """Append why other measures of the policy were skipped."""
    return Reason(R.PASSED_OVER, reason, *decision.passed_over) if decision.passed_over else reason
