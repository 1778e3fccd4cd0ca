from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_shared.mqtt.link import SUSPECTS_LIMIT, Suspects

TOPICS = st.sampled_from("abcdefgh")


def test_all_messages_in_flight_are_suspects() -> None:
    suspects = Suspects()
    assert suspects.note_end({"a", "b"}, alone=False) is None
    assert ["a" in suspects, "b" in suspects, "c" in suspects] == [True, True, False]


def test_a_message_that_is_twice_alone_is_refused() -> None:
    suspects = Suspects()
    suspects.note_end({"a", "b"}, alone=False)
    assert suspects.note_end({"a"}, alone=True) is None
    assert suspects.note_end({"a"}, alone=True) == "a"
    assert "a" not in suspects
    assert "b" in suspects


def test_an_acknowledgement_in_between_clears_a_suspect() -> None:
    suspects = Suspects()
    for _ in range(10):
        assert suspects.note_end({"a"}, alone=True) is None
        suspects.clear("a")


def test_a_message_among_others_is_never_refused() -> None:
    suspects = Suspects()
    assert [suspects.note_end({"a", "b"}, alone=False) for _ in range(10)] == [None] * 10


def test_an_end_without_messages_suspects_none() -> None:
    suspects = Suspects()
    assert suspects.note_end((), alone=False) is None
    assert not suspects


def test_the_number_of_suspects_is_limited() -> None:
    suspects = Suspects()
    for number in range(2 * SUSPECTS_LIMIT):
        suspects.note_end({f"a/{number}", f"b/{number}"}, alone=False)
    assert len(suspects) == SUSPECTS_LIMIT


@given(st.sets(TOPICS, min_size=1), st.sets(TOPICS, min_size=1))
def test_a_broker_that_refuses_some_topics_loses_exactly_these(sent: set[str], refused: set[str]) -> None:
    suspects = Suspects()
    set_aside: set[str] = set()
    suspects.note_end(sent, alone=False)
    for _ in range(2 * len(sent) + 1):  # connections, on each of which the suspects are sent one by one
        for topic in sorted(sent - set_aside):
            if topic in refused:
                found = suspects.note_end({topic}, alone=True)
                set_aside |= {found} if found else set()
                break
            suspects.clear(topic)
    assert set_aside == sent & refused
    assert not suspects
