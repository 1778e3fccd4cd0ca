"""Who uses what."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.traffic.resources import UseIndex


def test_others_are_those_who_cannot_share() -> None:
    index = UseIndex()
    index.add("a", {"x": None, "aisle": "north"})
    index.add("b", {"aisle": "north"})

    assert set(index.others("c", {"x": None})) == {("a", "x")}
    assert set(index.others("c", {"aisle": "north"})) == set()
    assert set(index.others("c", {"aisle": "south"})) == {("a", "aisle"), ("b", "aisle")}
    assert set(index.others("c", {"aisle": None})) == {("a", "aisle"), ("b", "aisle")}
    assert set(index.others("a", {"x": None})) == set()
    assert index.users("aisle") == {"a", "b"}


USES = st.dictionaries(st.sampled_from("xyz"), st.sampled_from([None, "n", "s"]), min_size=1)


@given(st.lists(st.tuples(st.sampled_from("ab"), USES), max_size=12))
def test_a_resource_is_used_until_each_use_was_taken_back(
    uses: list[tuple[str, dict[str, str | None]]],
) -> None:
    index, left = UseIndex(), Counter[tuple[str, str]]()
    for vehicle, each in uses:
        index.add(vehicle, each)
        left.update((vehicle, resource) for resource in each)
    for vehicle, each in reversed(uses):
        index.remove(vehicle, each)
        left.subtract((vehicle, resource) for resource in each)
        for resource in "xyz":
            assert index.users(resource) == {who for who in "ab" if left[who, resource]}
