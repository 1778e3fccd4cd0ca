from __future__ import annotations

from nena_order_service.orders.names import sortable_id


def test_ids_are_of_one_length_and_never_the_same() -> None:
    made = {sortable_id() for _ in range(100)}
    assert len(made) == 100
    assert {len(each) for each in made} == {22}
