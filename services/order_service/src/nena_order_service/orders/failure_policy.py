"""Which measure of a failure policy is taken next, for a failure as it is.

Pure: the policy, how far it is used up and the situation go in; a measure comes out. Each call uses up at
least one step of a list that ends, so the measures end too, in FAIL where nothing else does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from nena_order_service.fleet.failures import FailureKind
from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    DriveOrderStatus,
    FailureMeasure,
    FailureStep,
)

FAIL: Final = FailureStep(do=FailureMeasure.FAIL)

K = FailureKind


@dataclass(frozen=True, slots=True)
class Situation:
    """A failure, and what is known at that time."""

    kind: FailureKind
    begun: bool = False
    """Whether the operation at the destination is known to have begun."""
    carrying: bool = False
    """Whether the vehicle carries something for the order."""
    others: bool = True
    """Whether there are other vehicles that may do it."""
    other_way: bool = True
    """Whether there is a way that avoids where it failed."""
    heard: bool = True
    """Whether the robot is there, and says what it does."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What is to be done: a step of the policy, up to which it is used up then.

    ``passed_over`` says of the steps before it why they were not taken.
    """

    step: FailureStep
    taken: int
    passed_over: tuple[str, ...] = ()


def decide(policy: Sequence[FailureStep], taken: int, situation: Situation) -> Decision:
    """Give the next measure of ``policy``, of which ``taken`` measures are used up."""
    passed_over: list[str] = []
    for number, step in enumerate(_one_by_one(policy), start=1):
        if number <= taken:
            continue
        objection = _objection(step, situation)
        if not objection:
            return Decision(step, number, tuple(passed_over))
        words = f"no {step.do}: {objection}"
        if words not in passed_over:
            passed_over.append(words)
    return Decision(FAIL, taken, tuple(passed_over))


def _one_by_one(policy: Iterable[FailureStep]) -> Iterator[FailureStep]:
    return (step for step in policy for _ in range(step.times))


def _objection(step: FailureStep, situation: Situation) -> str:
    """Say what speaks against a measure; empty for nothing."""
    if step.do.last:
        return ""
    if situation.kind is K.UNCLEAR or (situation.kind is K.LOST and situation.begun):
        return "nobody knows what the robot has done of it"
    return _AGAINST[step.do](step, situation)


def _against_retry(step: FailureStep, situation: Situation) -> str:
    if situation.kind is K.UNFIT:
        return "the robot would never take it"
    useless = situation.kind is K.NO_WAY and not step.after
    return "there would be no way again" if useless else ""


def _against_other_way(_: FailureStep, situation: Situation) -> str:
    if situation.kind is not K.DRIVE:
        return "it is not the way that has failed"
    return "" if situation.other_way else "there is no other way"


def _against_other_vehicle(_: FailureStep, situation: Situation) -> str:
    if situation.carrying:
        return "the vehicle carries something for the order, so no other one can go on with it"
    if not situation.heard:
        return "the robot says nothing, so nobody knows what it does"
    return "" if situation.others else "there is no other vehicle for it"


def _against_skip(_: FailureStep, situation: Situation) -> str:
    return "" if situation.kind is K.ACTION else "it is not an operation that has failed"


_AGAINST: Final[Mapping[FailureMeasure, Callable[[FailureStep, Situation], str]]] = MappingProxyType(
    {
        FailureMeasure.RETRY: _against_retry,
        FailureMeasure.REPLAN: _against_other_way,
        FailureMeasure.OTHER_VEHICLE: _against_other_vehicle,
        FailureMeasure.SKIP: _against_skip,
    }
)


def is_carrying(
    drive_orders: Iterable[DriveOrderStatus],
    *,
    picks: Iterable[str],
    drops: Iterable[str],
    reported: bool | None,
) -> bool:
    """Tell whether a vehicle carries something for an order.

    ``picks`` and ``drops`` are the operations that take and give loads; ``reported`` tells whether its robot
    says that it has a load, None: it says nothing of that. A pick that has begun counts as done, unless the
    robot says otherwise; a drop that is not known to be done counts as not done.
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
