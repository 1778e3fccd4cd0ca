"""The ring keeps what is new, within its limits."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_shared.extensions.black_box.ring import DOCUMENT_SIZE, ENTRY_OVERHEAD, Channel, Ring

STATE = Channel("uagv/v2/ACME/1/state")


def test_a_payload_that_would_replace_most_others_is_left_out() -> None:
    ring = Ring(seconds=10.0, limit=10_000)
    ring.add(STATE, b"small", 0.0)
    ring.add(STATE, bytes(9000), 0.0)

    assert [each.payload for each in ring.entries(0.0)] == [b"small"]
    assert ring.too_large == 1


@given(st.lists(st.tuples(st.integers(0, 3000), st.floats(0, 5)), max_size=60))
def test_size_and_age_never_exceed_their_limits(added: list[tuple[int, float]]) -> None:
    ring, now = Ring(seconds=20.0, limit=8000), 0.0
    for size, pause in added:
        now += pause
        ring.add(STATE, bytes(size), now)
        kept = ring.entries(now)
        assert ring.size == sum(len(each.payload) + ENTRY_OVERHEAD for each in kept) <= 8000
        assert all(each.at >= now - 20.0 for each in kept)


def test_documents_count_with_an_estimate() -> None:
    ring = Ring(seconds=60.0, limit=10 * (DOCUMENT_SIZE + ENTRY_OVERHEAD))
    for number in range(15):
        ring.add(Channel("a"), {"number": number}, 0.0)

    assert [each.payload for each in ring.entries(0.0)] == [{"number": number} for number in range(5, 15)]
    assert (ring.displaced, ring.size) == (5, 10 * (DOCUMENT_SIZE + ENTRY_OVERHEAD))
