from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.engine.conditions import Dependencies
from support.order_service import raw_order


def test_an_order_reports_what_it_waits_for_while_it_waits() -> None:
    dependencies = Dependencies()
    order = raw_order(number=9)
    dependencies.add_waiting(order, ["B", "A"])
    assert str(dependencies.why_waiting(order)) == "waits until 'A', 'B' are finished"
    assert dependencies.release_dependents("A") == (9,)
    assert str(dependencies.why_waiting(order)) == "waits until 'B' is finished"
    assert dependencies.release_dependents("B") == (9,)
    assert dependencies.why_waiting(order) is None
    assert dependencies.release_dependents("B") == ()


def test_many_are_counted_not_named() -> None:
    dependencies = Dependencies()
    dependencies.add_waiting(raw_order(), [f"T-{number}" for number in range(2, 9)])
    assert (
        str(dependencies.why_waiting(raw_order()))
        == "waits until 'T-2', 'T-3', 'T-4' and 4 more are finished"
    )


def test_a_forgotten_order_is_no_longer_published() -> None:
    dependencies = Dependencies()
    for number in (1, 2):
        dependencies.add_waiting(raw_order(number=number), ["A", "B"])
    dependencies.remove_waiting(raw_order(number=1))
    assert dependencies.release_dependents("A") == (2,)
    dependencies.remove_waiting(raw_order(number=2))
    assert dependencies.release_dependents("B") == ()


@given(
    st.dictionaries(st.integers(1, 5), st.sets(st.sampled_from("ABC")), max_size=5),
    st.permutations(list("ABC")),
)
def test_each_order_waits_exactly_for_unsettled_dependencies(
    waits: dict[int, set[str]], ends: list[str]
) -> None:
    dependencies = Dependencies()
    for number, names in waits.items():
        dependencies.add_waiting(raw_order(number=number), names)
    left = {number: set(names) for number, names in waits.items()}
    for name in ends:
        told = dependencies.release_dependents(name)
        assert set(told) == {number for number, names in left.items() if name in names}
        for number, names in left.items():
            names.discard(name)
            assert bool(dependencies.why_waiting(raw_order(number=number))) == bool(names)
