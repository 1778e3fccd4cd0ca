from __future__ import annotations

from datetime import timedelta

from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.clock import SAMPLES, ClockSkew
from nena_status_aggregator.fleet.messages import GREATEST_HEADER_ID, Sequence, Verdict
from support.fleet_examples import START


def assess(sequence: Sequence, number: int, seconds: float) -> Verdict:
    return sequence.assess_message(number, START + timedelta(seconds=seconds))


def assessed(*messages: tuple[int, float]) -> list[str]:
    sequence = Sequence()
    return [assess(sequence, number, seconds).name for number, seconds in messages]


def test_increasing_header_ids_are_new() -> None:
    assert assessed((5, 0), (6, 1), (7, 1)) == ["NEW"] * 3


def test_the_same_message_again_is_repeated() -> None:
    assert assessed((5, 0), (6, 1), (6, 1)) == ["NEW", "NEW", "REPEATED"]


def test_an_older_message_is_late() -> None:
    assert assessed((5, 5), (9, 9), (7, 7)) == ["NEW", "NEW", "LATE"]


def test_two_older_messages_that_do_not_continue_each_other_are_both_late() -> None:
    assert assessed((5, 5), (9, 9), (5, 5), (7, 7)) == ["NEW", "NEW", "LATE", "LATE"]


def test_restart_at_zero_is_accepted_with_an_older_clock() -> None:
    assert assessed((5, 1000), (0, 10), (1, 11)) == ["NEW"] * 3


def test_the_first_message_of_a_session_repeated_later_is_no_restart() -> None:
    assert assessed((0, 0), (1, 1), (0, 0), (2, 2)) == ["NEW", "NEW", "REPEATED", "NEW"]


def test_a_lower_number_with_a_later_time_is_a_restart() -> None:
    sequence = Sequence()
    assert assess(sequence, 50, 0) is Verdict.NEW
    assert assess(sequence, 1, 10) is Verdict.NEW
    assert sequence.restarts == 1


def test_clock_set_back_does_not_block_the_robot() -> None:
    assert assessed((5, 1000), (6, 10), (7, 11)) == ["NEW"] * 3


def test_restart_at_1_with_an_older_clock_is_accepted_with_the_second_message() -> None:
    assert assessed((50, 1000), (1, 10), (2, 11), (3, 12)) == ["NEW", "LATE", "NEW", "NEW"]


def test_wrapping_header_ids_are_not_a_restart() -> None:
    sequence = Sequence()
    assess(sequence, GREATEST_HEADER_ID, 0)
    assert assess(sequence, 0, 1) is Verdict.NEW
    assert sequence.restarts == 0


def test_a_clock_set_back_is_followed_although_the_header_id_never_changes() -> None:
    sequence = Sequence()
    assess(sequence, 1, 3600)
    assert [assess(sequence, 1, seconds) for seconds in (5, 5, 6, 7)] == [
        Verdict.LATE,
        Verdict.LATE,
        Verdict.NEW,
        Verdict.NEW,
    ]


def test_gaps_are_counted() -> None:
    sequence = Sequence()
    assess(sequence, 3, 0)
    assess(sequence, 7, 1)
    assert sequence.missed == 3


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30)), max_size=40))
def test_sender_is_never_ignored_permanently(before: list[tuple[int, int]]) -> None:
    sequence = Sequence()
    for number, seconds in before:
        assess(sequence, number, seconds)
    following = [assess(sequence, number, number) for number in range(100, 104)]
    assert following[1:] == [Verdict.NEW] * 3


def measured(*differences: float) -> float | None:
    skew = ClockSkew()
    for each in differences:
        skew.measure(START + timedelta(seconds=each), START)
    return skew.seconds


def test_skew_is_unknown_before_the_first_message() -> None:
    assert measured() is None


def test_delays_do_not_count_as_skew() -> None:
    assert measured(-0.1, -30.0, -2.0) == -0.1


def test_a_fast_clock_shows() -> None:
    assert measured(59.8, 60.0, 59.9) == 60.0


def test_corrected_clock_is_recognised_after_some_messages() -> None:
    assert measured(60.0, *[0.0] * SAMPLES) == 0.0


def test_corrected_clock_is_recognised_by_the_first_message_a_minute_later() -> None:
    skew = ClockSkew()
    skew.measure(START + timedelta(seconds=60), START)
    later = START + timedelta(seconds=61)
    skew.measure(later, later)
    assert skew.seconds == 0.0


def test_own_corrected_clock_is_recognised_by_the_next_message() -> None:
    skew = ClockSkew()
    skew.measure(START, START - timedelta(seconds=90))
    skew.measure(START, START)
    assert skew.seconds == 0.0
