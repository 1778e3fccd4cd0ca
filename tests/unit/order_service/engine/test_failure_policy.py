from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.engine.failure_policy import Situation, decide, is_carrying
from nena_order_service.fleet.failures import FailureKind as K
from nena_shared.fleet_api.transport_order import DriveOrderState, DriveOrderStatus, FailureStep
from nena_shared.fleet_api.transport_order import FailureMeasure as M
from support.fleet_examples import drive_order

S = DriveOrderState

POLICY = (
    FailureStep(do=M.RETRY, times=2),
    FailureStep(do=M.REPLAN),
    FailureStep(do=M.OTHER_VEHICLE),
    FailureStep(do=M.SKIP),
    FailureStep(do=M.HOLD),
)


def measures(*situations: Situation, policy: tuple[FailureStep, ...] = POLICY) -> list[M]:
    """Return the measures taken for failures one after the other, up to the last one."""
    taken, done = 0, []
    for situation in situations:
        decision = decide(policy, taken, situation)
        taken = decision.taken
        done.append(decision.step.do)
    return done


def test_each_failure_takes_the_next_measure() -> None:
    blocked = Situation(K.DRIVE)

    assert measures(*[blocked] * 5) == [M.RETRY, M.RETRY, M.REPLAN, M.OTHER_VEHICLE, M.HOLD]


def test_inapplicable_measures_are_skipped() -> None:
    failed = Situation(K.ACTION, begun=True)

    assert measures(*[failed] * 4) == [M.RETRY, M.RETRY, M.OTHER_VEHICLE, M.SKIP]


def test_an_exhausted_or_empty_policy_fails() -> None:
    assert measures(*[Situation(K.DRIVE)] * 3, policy=POLICY[:1]) == [M.RETRY, M.RETRY, M.FAIL]
    assert measures(Situation(K.DRIVE), policy=()) == [M.FAIL]


@pytest.mark.parametrize(
    ("situation", "measure", "why"),
    [
        (Situation(K.UNFIT), M.RETRY, "cannot execute it"),
        (Situation(K.NO_WAY), M.RETRY, "still be no route"),
        (Situation(K.ACTION), M.REPLAN, "the drive has not failed"),
        (Situation(K.DRIVE, other_way=False), M.REPLAN, "no other route"),
        (Situation(K.DRIVE, carrying=True), M.OTHER_VEHICLE, "carries a load"),
        (Situation(K.NOT_TAKEN, online=False), M.OTHER_VEHICLE, "silent"),
        (Situation(K.DRIVE, others=False), M.OTHER_VEHICLE, "no other suitable robot"),
        (Situation(K.DRIVE), M.SKIP, "no operation has failed"),
        (Situation(K.UNCLEAR), M.RETRY, "unknown"),
        (Situation(K.LOST, begun=True), M.RETRY, "unknown"),
    ],
)
def test_skipped_measures_are_explained(situation: Situation, measure: M, why: str) -> None:
    decision = decide([FailureStep(do=measure)], 0, situation)

    assert decision.step.do is M.FAIL
    texts = map(str, decision.passed_over)
    word = measure.replace("_", " ").lower()
    assert [text for text in texts if text.startswith(f"no {word}: ") and why in text]


def test_a_route_that_may_reappear_is_retried_later() -> None:
    assert measures(Situation(K.NO_WAY), policy=(FailureStep(do=M.RETRY, after=5),)) == [M.RETRY]


STEPS = st.lists(
    st.builds(FailureStep, do=st.sampled_from([M.RETRY, M.REPLAN, M.OTHER_VEHICLE]), times=st.integers(1, 5))
    | st.sampled_from([FailureStep(do=each) for each in (M.SKIP, M.HOLD, M.FAIL)]),
    max_size=6,
)
SITUATIONS = st.builds(
    Situation,
    st.sampled_from(K),
    **{name: st.booleans() for name in ("begun", "carrying", "others", "other_way", "online")},
)


@given(STEPS, st.lists(SITUATIONS, min_size=40, max_size=40))
def test_measures_are_finite_and_never_forbidden(
    policy: list[FailureStep], situations: list[Situation]
) -> None:
    taken = 0
    for situation in situations:
        decision = decide(policy, taken, situation)
        measure, unknown = decision.step.do, situation.kind is K.UNCLEAR
        lost = situation.kind is K.LOST and situation.begun
        assert measure.last or not (unknown or lost), "what may be done already is not done again"
        assert not (measure is M.OTHER_VEHICLE and (situation.carrying or not situation.others))
        assert measure is not M.SKIP or situation.kind is K.ACTION
        if measure is M.FAIL or measure is M.HOLD:
            return
        assert decision.taken > taken
        taken = decision.taken
    raise AssertionError("it went on for ever")


def stops(*parts: tuple[str, S]) -> list[DriveOrderStatus]:
    return [drive_order("somewhere", operation, state) for operation, state in parts]


@pytest.mark.parametrize(
    ("parts", "reported", "carrying"),
    [
        ([("Load", S.FINISHED), ("Unload", S.TRAVELLING)], None, True),
        ([("Load", S.FINISHED), ("Unload", S.TRAVELLING)], False, True),
        ([("Load", S.FINISHED), ("Unload", S.FINISHED), ("Load", S.TRAVELLING)], None, False),
        ([("Load", S.FINISHED), ("Unload", S.FAILED), ("MOVE", S.TRAVELLING)], None, True),
        ([("Load", S.FAILED), ("MOVE", S.TRAVELLING)], None, False),
        ([("Load", S.TRAVELLING)], None, False),
        ([("Load", S.OPERATING)], None, True),
        ([("Load", S.OPERATING)], False, False),
        ([("Load", S.OPERATING)], True, True),
        ([("MOVE", S.TRAVELLING)], True, True),
        ([("Load", S.FINISHED), ("Unload", S.OPERATING)], None, True),
    ],
)
def test_is_carrying(parts: list[tuple[str, S]], reported: bool | None, carrying: bool) -> None:  # noqa: FBT001 - an example
    assert is_carrying(stops(*parts), picks=["Load"], drops=["Unload"], reported=reported) is carrying
