"""The queue of messages that wait for the broker."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_shared.mqtt import Outbound
from nena_shared.mqtt.link import Outbox


def status(topic: str, payload: bytes) -> Outbound:
    return Outbound(topic, payload, retain=True)


def drained(outbox: Outbox) -> list[Outbound]:
    return [outbox.pop() for _ in range(len(outbox))]


def test_messages_leave_in_order() -> None:
    outbox = Outbox(limit=10)
    sent = [status("a", b"1"), Outbound("b", b"2"), status("c", b"3"), Outbound("b", b"4")]
    for message in sent:
        assert outbox.add(message) is None
    assert list(outbox) == drained(outbox) == sent


def test_only_messages_that_are_not_retained_are_dropped() -> None:
    outbox = Outbox(limit=2)
    others = [Outbound("b", bytes([number])) for number in range(4)]
    for number in range(100):
        assert outbox.add(status(f"a/{number}", b"1")) is None
    assert [outbox.add(message) for message in others] == [None, None, others[0], others[1]]
    assert drained(outbox)[100:] == others[2:]
    assert outbox.add(others[0]) is None


MESSAGES = st.builds(
    Outbound,
    topic=st.sampled_from("abc"),
    payload=st.sampled_from([b"", b"1", b"2"]),
    retain=st.booleans(),
)


@given(st.lists(MESSAGES | st.none(), max_size=60), st.integers(1, 3))
def test_each_topic_ends_with_the_last_retained_message_published_on_it(
    steps: list[Outbound | None], limit: int
) -> None:
    """``None`` stands for a message that leaves the queue."""
    outbox, broker, published = Outbox(limit), dict[str, bytes](), dict[str, bytes]()
    for step in steps:
        if step is not None:
            outbox.add(step)
            if step.retain:
                published[step.topic] = step.payload
        elif len(outbox):
            left = outbox.pop()
            if left.retain:
                broker[left.topic] = left.payload
        assert sum(not each.retain for each in outbox) <= limit
        assert sum(each.retain for each in outbox) <= 2 * len("abc")
    for left in drained(outbox):
        if left.retain:
            broker[left.topic] = left.payload
    assert broker == published
